#pragma once

// Initial calibration: with the true rate Ω known, y_k − Ω over the first rest_s seconds gives each
// gyro's drift polynomial P_k⁰ by least squares. Fitted as sum and difference of the two gyros,
// because the sum shows whether the platform really stood still.

#include <array>
#include <cstdint>

#include "fusion/least_squares.h"
#include "fusion/polynomial.h"

namespace vgyro::fusion {

struct Calibration {
  double end_s = 0.0;                ///< the first window starts here
  Polynomial sum;                    ///< P₁⁰ + P₂⁰, deg/s
  Polynomial difference;             ///< P₁⁰ − P₂⁰, deg/s
  double common_variance = 0.0;      ///< of y₁ + y₂ − 2Ω about its polynomial, (deg/s)²
  double difference_variance = 0.0;  ///< of y₁ − y₂ about its polynomial, (deg/s)²

  [[nodiscard]] double bias_dps(std::size_t gyro, double t_s) const {
    return 0.5 * (sum.at(t_s) + (gyro == 0 ? difference.at(t_s) : -difference.at(t_s)));
  }
  /// Both gyros moved together far beyond their noises: the platform turned while it should have
  /// rested, and what was learnt holds part of that motion.
  [[nodiscard]] bool platform_moved() const;
};

class Calibrator {
 public:
  /// order 0…kOrderMax, rest_s > 0.
  Calibrator(int order, double rest_s);

  /// The next pair and the true rate at its time; t_s grows. Returns false when this pair lies
  /// behind the calibration's end and was not used: then result() is there.
  bool add(double t_s, const std::array<double, 2>& rate_dps, double true_rate_dps);

  /// Seconds covered so far.
  [[nodiscard]] double covered_s() const { return covered_s_; }
  /// Precondition: add() has returned false.
  [[nodiscard]] const Calibration& result() const { return result_; }

 private:
  int order_;
  double rest_s_;
  bool started_ = false;
  double from_s_ = 0.0;
  double covered_s_ = 0.0;
  LeastSquares sum_;
  LeastSquares difference_;
  Calibration result_;
};

}  // namespace vgyro::fusion

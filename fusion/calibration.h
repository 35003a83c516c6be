#pragma once

// Initial calibration: with the true rate Ω known, y_k − Ω over rest_s seconds gives each gyro's
// drift polynomial P_k⁰ by least squares. Sum and difference of the two gyros are fitted, because
// the sum shows whether the platform really stands still: a step of the common rate from second to
// second that noise cannot explain is motion, and the pairs gathered so far are discarded.

#include <array>
#include <cstdint>

#include "fusion/least_squares.h"
#include "fusion/polynomial.h"

namespace vgyro::fusion {

struct Calibration {
  double end_s = 0.0;         ///< the first window starts here
  double used_until_s = 0.0;  ///< pairs after this were not used: motion
  Polynomial sum;             ///< P₁⁰ + P₂⁰, deg/s
  Polynomial difference;      ///< P₁⁰ − P₂⁰, deg/s
  bool in_motion = false;     ///< the platform moved, and the motion was accepted

  /// Motion ended the calibration early.
  [[nodiscard]] bool cut_short() const { return used_until_s < end_s; }

  [[nodiscard]] double bias_dps(std::size_t gyro, double t_s) const {
    return 0.5 * (sum.at(t_s) + (gyro == 0 ? difference.at(t_s) : -difference.at(t_s)));
  }
};

/// What to do when the platform moves while it should rest.
enum class WhenMoving : std::uint8_t {
  kWait,    ///< begin again: the calibration is the first rest_s seconds of rest
  kAccept,  ///< continue, set Calibration::in_motion, and learn no slope from the motion
  kKnown    ///< the true rate comes from a reference: motion does not matter
};

class Calibrator {
 public:
  /// A common rate that moves less than this from second to second never counts as motion: no
  /// vehicle turns so slowly for long, and a platform that only sways must be able to calibrate.
  static constexpr double kStill_dps = 0.05;
  /// In addition, this many standard errors of a block's mean, from the noise of the difference.
  static constexpr double kNoiseFactor = 10.0;
  static constexpr double kBlock_s = 1.0;
  /// Blocks of fewer pairs are not judged; slow gyros get longer blocks.
  static constexpr std::uint64_t kBlockPairsMin = 8;
  /// Motion that begins after this share of rest_s ends the calibration instead of spoiling it.
  static constexpr double kEnoughShare = 0.9;
  /// Two sensors of one type may both have a bias, but not both of this size and equal within this
  /// share.
  static constexpr double kLargeBias_dps = 5.0;
  static constexpr double kSameBias = 0.1;

  /// order 0…kOrderMax, rest_s > 0.
  Calibrator(int order, double rest_s, WhenMoving when_moving = WhenMoving::kWait);

  /// The next pair and the true rate at its time; t_s grows. Returns false when the calibration is
  /// complete, without this pair: then result() is valid.
  bool add(double t_s, const std::array<double, 2>& rate_dps, double true_rate_dps);

  /// Seconds gathered so far.
  [[nodiscard]] double covered_s() const { return covered_s_; }
  /// Number of restarts because of motion or holes in the stream.
  [[nodiscard]] std::uint64_t restarts() const { return restarts_; }
  /// Precondition: add() has returned false.
  [[nodiscard]] const Calibration& result() const { return result_; }
  /// Precondition: add() has returned false. Can the readings at rest be the gyros' biases? Not if
  /// one is larger than `max_bias_dps` (infinite: not given), nor if both are large and equal: then
  /// the platform turns steadily.
  [[nodiscard]] bool plausible(const std::array<double, 2>& max_bias_dps) const;
  /// The result is rejected: begin again with the next pair.
  void reject();

  /// Motion was detected elsewhere, after standstill until `still_until_s`, at most a block ago.
  /// Acts as if these pairs had shown it: true when the calibration is complete; otherwise it
  /// begins again, or continues where motion is accepted or known. Precondition: add() has not
  /// returned false.
  bool cut_short(double t_s, double still_until_s);
  /// Motion was accepted: detected here, or reported by note_motion().
  [[nodiscard]] bool moved() const { return moved_; }
  void note_motion();

 private:
  struct Sums {
    LeastSquares sum;
    LeastSquares level;  ///< the sum as a constant
    LeastSquares difference;
  };
  /// A second of pairs, or more of slow gyros: is it as still as those before?
  struct StillnessBlock {
    double from_s = 0.0;
    std::uint64_t count = 0;
    double common = 0.0;              ///< Σ ½(y₁ + y₂) − Ω
    double difference = 0.0;          ///< Σ ½(y₁ − y₂)
    double difference_squares = 0.0;  ///< Σ of its squares
  };

  void begin(double t_s);
  [[nodiscard]] Sums empty_sums(double from_s) const;
  /// Judges the block that ends; false when it holds motion.
  bool close_block();
  bool finish(const Sums& sums, double t_s, double used_until_s);

  int order_;
  double rest_s_;
  WhenMoving when_moving_;
  bool started_ = false;
  bool moved_ = false;
  double from_s_ = 0.0;
  double covered_s_ = 0.0;
  std::uint64_t restarts_ = 0;
  Sums sums_;
  Sums calm_;  ///< up to the last block that was judged still
  double calm_until_s_ = 0.0;
  Sums calmer_;  ///< up to the still block before that
  double calmer_until_s_ = 0.0;
  StillnessBlock block_;
  double level_dps_ = 0.0;  ///< common rate of the last blocks, smoothed
  bool level_known_ = false;
  Calibration result_;
};

}  // namespace vgyro::fusion

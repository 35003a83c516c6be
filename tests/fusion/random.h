#pragma once

// Random numbers of the fusion tests, with fixed seeds, so that a failure can be reproduced.

#include <cmath>
#include <cstdint>
#include <random>

namespace vgyro::fusion {

class Random {
 public:
  explicit Random(std::uint64_t seed) : engine_(seed) {}
  double uniform(double from, double to) {
    return from + (to - from) * std::ldexp(static_cast<double>(engine_() >> 11U), -53);
  }
  double normal(double sigma = 1.0) { return sigma * normal_(engine_); }
  std::uint64_t below(std::uint64_t n) { return engine_() % n; }

 private:
  std::mt19937_64 engine_;
  std::normal_distribution<double> normal_;
};

/// Root mean square of the added values.
class Rms {
 public:
  void add(double value) {
    sum_ += value * value;
    ++count_;
  }
  [[nodiscard]] double value() const { return std::sqrt(sum_ / count_); }
  /// Standard error of value(), relative, for normally distributed values.
  [[nodiscard]] double relative_error() const { return 1.0 / std::sqrt(2.0 * count_); }

 private:
  double sum_ = 0.0;
  double count_ = 0.0;
};

/// Allowed deviation of a measured mean or rms, in standard errors.
inline constexpr double kSigmas = 3.5;

}  // namespace vgyro::fusion

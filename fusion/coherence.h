#pragma once

// Do the two gyros feel the same rotation? Compares the changes of their block means. A gyro that
// stays constant while the other one moves is blind to rotation, whatever its noise. Two gyros that
// both move, but not alike, are not on one platform, or one is configured wrongly. Both findings
// are probabilities that grow and fall block by block; a drift or a step of one gyro changes too
// few blocks to look like either.

#include <array>
#include <cstddef>

#include "fusion/quadratic.h"

namespace vgyro::fusion {

class Coherence {
 public:
  /// A block of both gyros: means, span, noise densities, and how far a skew may set the means
  /// apart.
  void judge(const std::array<double, 2>& mean_dps, double from_s, double to_s,
             const Symmetric& density, double skew_allowance_dps);
  /// Earlier blocks are not compared with later ones.
  void break_off() { count_ = 0; }
  void clear() { *this = {}; }

  /// Probability that this gyro feels no rotation. Near 1 only after long evidence.
  [[nodiscard]] double blind(std::size_t gyro) const;
  /// Both gyros move, but not alike.
  [[nodiscard]] bool contradict() const { return contradiction_ > 0.0; }
  /// There is evidence of a blind gyro or a contradiction: the present difference is not drift.
  [[nodiscard]] bool suspects() const {
    return contradict() || blind_[0] > kSuspicion || blind_[1] > kSuspicion;
  }

 private:
  static constexpr std::size_t kBack = 2;
  static constexpr double kSuspicion = 5.0;  ///< about the evidence of one block
  struct Mean {
    std::array<double, 2> rate_dps{};
    double length_s = 0.0;
    double to_s = 0.0;
  };

  std::array<Mean, kBack> before_;  ///< the last blocks, the newest last
  std::size_t count_ = 0;
  std::array<double, 2> blind_{};    ///< log odds above the prior
  std::array<double, 2> shown_s_{};  ///< time in which the other gyro moved and this one did not
  std::array<double, 2> since_s_{};  ///< start of that evidence
  double now_s_ = 0.0;
  double contradiction_ = -8.0;  ///< log odds
};

}  // namespace vgyro::fusion

#pragma once

// Do the two gyros feel the same rotation? Judged from how their block means change: a gyro that
// stays constant while the other one moves is blind to rotation, whatever its noise; two
// that both move, but not alike, are not on one platform, or one is configured wrongly. Both
// are probabilities that grow and fall block by block; a drift or a step of one
// gyro changes too few blocks to look like either.

#include <array>
#include <cstddef>

#include "fusion/quadratic.h"

namespace vgyro::fusion {

class Coherence {
 public:
  /// A block of both gyros: their means, its span, their noise densities, and how far a skew may
  /// set the two apart.
  void judge(const std::array<double, 2>& mean_dps, double from_s, double to_s,
             const Symmetric& density, double skew_allowance_dps);
  /// Earlier blocks are not compared with later ones.
  void break_off() { count_ = 0; }
  void clear() { *this = {}; }

  /// Probability that this gyro feels no rotation. Near 1 only when that has been seen for long.
  [[nodiscard]] double blind(std::size_t gyro) const;
  /// The gyros move, and not alike.
  [[nodiscard]] bool contradict() const { return contradiction_ > 0.0; }
  /// There is evidence for one of these: the present difference is not drift.
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
  std::array<double, 2> shown_s_{};  ///< for so long the other one has moved and this one has not
  std::array<double, 2> since_s_{};  ///< and began to
  double now_s_ = 0.0;
  double contradiction_ = -8.0;  ///< log odds
};

}  // namespace vgyro::fusion

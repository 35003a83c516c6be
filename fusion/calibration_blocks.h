#pragma once

// Means of the initial calibration, each over some seconds: they show drift, slope and noise of a
// rest of any length, in fixed memory.

#include <array>
#include <cmath>
#include <cstddef>

#include "fusion/cells.h"
#include "fusion/quadratic.h"

namespace vgyro::fusion {

/// Means of the calibration, each over some seconds.
class CalibrationBlocks {
 public:
  /// Capacity; when it is reached, neighbours are merged.
  static constexpr std::size_t kBlocks = 64;

  struct Mean {
    double from_s = 0.0;
    double to_s = 0.0;
    double length_s = 0.0;  ///< covered by samples
    std::array<double, 2> excess_dps{};
  };

  void clear() {
    count_ = 0;
    merge_ = 1;
    gathered_ = 0;
  }
  void add(const CellBlock& block) {
    const Mean mean{
        block.from_s, block.to_s, block.length_s(), {block.mean_dps(0), block.mean_dps(1)}};
    if (gathered_ == 0) {
      if (count_ == kBlocks) halve();
      means_[count_++] = mean;
    } else {
      means_[count_ - 1] = merged(means_[count_ - 1], mean);
    }
    gathered_ = (gathered_ + 1) % merge_;
  }
  [[nodiscard]] std::size_t count() const { return count_; }
  [[nodiscard]] const Mean& operator[](std::size_t i) const { return means_[i]; }

  /// Variance that the platform's own motion adds to both gyros' means in a block, (deg/s)²: the
  /// scatter of the common rate from block to block beyond the sensors' noise, enlarged because
  /// neighbours sway alike. 0 where noise explains the scatter.
  [[nodiscard]] double sway_variance(const Symmetric& density) const;

 private:
  static Mean merged(const Mean& a, const Mean& b) {
    Mean both{a.from_s, b.to_s, a.length_s + b.length_s, {}};
    for (std::size_t gyro = 0; gyro < 2; ++gyro) {
      both.excess_dps[gyro] =
          (a.excess_dps[gyro] * a.length_s + b.excess_dps[gyro] * b.length_s) / both.length_s;
    }
    return both;
  }
  void halve() {
    for (std::size_t i = 0; i < kBlocks / 2; ++i)
      means_[i] = merged(means_[2 * i], means_[2 * i + 1]);
    count_ = kBlocks / 2;
    merge_ *= 2;
  }

  std::array<Mean, kBlocks> means_;
  std::size_t count_ = 0;
  std::size_t merge_ = 1;     ///< blocks in each mean
  std::size_t gathered_ = 0;  ///< blocks in the last mean
};

inline double CalibrationBlocks::sway_variance(const Symmetric& density) const {
  // The quieter gyro counts most in the level, whose noise has a variance of N_v²/length.
  const double sum = density[0] + density[2] - 2.0 * density[1];
  const double first = sum > 0.0 ? (density[2] - density[1]) / sum : 0.5;
  const std::array<double, 2> weight{first, 1.0 - first};
  const auto level = [&](std::size_t i) {
    return weight[0] * means_[i].excess_dps[0] + weight[1] * means_[i].excess_dps[1];
  };
  // Second differences cancel a level and a slope. Several distances are used, because sway of one
  // period does not show at every distance.
  constexpr std::array<std::size_t, 6> kApart{1, 2, 3, 5, 8, 13};
  // A scatter that chance gives in one calibration of a thousand is still noise.
  constexpr double kChance = 4.0;
  constexpr double kAlikeBlocks = 4.0;
  double most = 0.0;
  for (const std::size_t apart : kApart) {
    double squares = 0.0;
    double noise = 0.0;
    double terms = 0.0;
    for (std::size_t i = 2 * apart; i < count_; ++i, terms += 1.0) {
      squares += squared(level(i) - 2.0 * level(i - apart) + level(i - 2 * apart)) / 6.0;
      noise += weighted(weight, density) / means_[i].length_s;
    }
    if (terms < 4.0) break;
    const double own_terms = std::max(terms / static_cast<double>(apart), 2.0);
    if (squares <= noise * (1.0 + kChance * std::sqrt(6.0 / own_terms))) continue;
    most = std::max(most, (squares - noise) / terms);
  }
  return kAlikeBlocks * most;
}

}  // namespace vgyro::fusion

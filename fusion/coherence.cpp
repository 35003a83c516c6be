#include "fusion/coherence.h"

#include <algorithm>
#include <cmath>

namespace vgyro::fusion {

namespace {

// Prior log odds: a gyro goes blind once in many thousand hours, here per block. The evidence of
// one block is bounded, so that a step of the other gyro, which shows in three blocks, is not
// enough.
constexpr double kBlindPrior = -20.0;
constexpr double kBlockTells = 6.0;
constexpr double kBlindMost = 12.0;
constexpr double kFades = 2.0;
// A platform has moved when a gyro's mean has changed by so many standard deviations.
constexpr double kMoved = 5.0;
// No bias drifts so far within a second.
constexpr double kMovedMin_dps = 0.05;
// Healthy gyros may differ by this share of a change: scale factors, and instants of blocks.
constexpr double kChangeTolerance = 0.05;
// For some seconds foreign frames may look like a gyro that moves. Until then the gyro that does
// not move may be the right one, and the probability is limited.
constexpr double kSure_s = 10.0;
constexpr double kShown_s = 2.5;  ///< of these, seconds in which only one of the two moved
constexpr double kUnsureMost = 0.95;
constexpr double kSureMost = 0.9995;
// Changes that differ by so many standard deviations are not chance.
constexpr double kUnlike = 6.0;
constexpr double kContradictionPrior = -8.0;
constexpr double kContradictionMost = 12.0;
constexpr double kAlikeTells = 2.0;
// Blocks with a longer hole between them are not compared.
constexpr double kGap_s = 1.0;

}  // namespace

void Coherence::judge(const std::array<double, 2>& mean_dps, double from_s, double to_s,
                      const Symmetric& density, double skew_allowance_dps) {
  now_s_ = to_s;
  if (count_ > 0 && from_s - before_[count_ - 1].to_s > kGap_s) count_ = 0;
  const Mean now{mean_dps, to_s - from_s, to_s};
  if (count_ < kBack) {
    before_[count_++] = now;
    return;
  }
  const Mean old = before_[0];
  before_[0] = before_[1];
  before_[1] = now;
  const double per_s = 1.0 / now.length_s + 1.0 / old.length_s;
  const std::array<double, 2> variance{density[0] * per_s, density[2] * per_s};
  const std::array<double, 2> change{now.rate_dps[0] - old.rate_dps[0],
                                     now.rate_dps[1] - old.rate_dps[1]};
  const double greatest = std::max(std::abs(change[0]), std::abs(change[1]));
  const double unlike = change[0] - change[1];
  const double unlike_variance = of_difference(density) * per_s +
                                 squared(kChangeTolerance * greatest) + squared(skew_allowance_dps);
  const double log_alike = -0.5 * (squared(unlike) / unlike_variance + std::log(unlike_variance));
  std::array<bool, 2> moved{};
  for (std::size_t gyro = 0; gyro < 2; ++gyro)
    moved[gyro] = squared(change[gyro]) > squared(kMoved) * variance[gyro] &&
                  std::abs(change[gyro]) > kMovedMin_dps;
  for (std::size_t gyro = 0; gyro < 2; ++gyro) {
    double tells = 0.0;
    if (moved[1 - gyro]) {
      const double log_blind =
          -0.5 * (squared(change[gyro]) / variance[gyro] + std::log(variance[gyro]));
      tells = std::clamp(log_blind - log_alike, -kBlockTells, kBlockTells);
      if (tells > 0.0) shown_s_[gyro] += now.length_s;
      if (tells > 0.0 && blind_[gyro] == 0.0) since_s_[gyro] = to_s;
    } else if (moved[gyro]) {
      tells = -kBlockTells;
    } else if (blind_[gyro] < -kBlindPrior) {
      // Evidence left by a step of the other gyro fades.
      tells = -kFades;
    }
    blind_[gyro] = std::clamp(blind_[gyro] + tells, 0.0, kBlindMost - kBlindPrior);
    if (blind_[gyro] == 0.0) shown_s_[gyro] = 0.0;
  }
  const bool both_moved = moved[0] && moved[1];
  if (both_moved || contradiction_ > 0.0) {
    const bool far = squared(unlike) > squared(kUnlike) * unlike_variance;
    contradiction_ = std::clamp(contradiction_ + (far ? kBlockTells : -kAlikeTells),
                                kContradictionPrior, kContradictionMost);
  }
}

double Coherence::blind(std::size_t gyro) const {
  const double probability = 1.0 / (1.0 + std::exp(-(kBlindPrior + blind_[gyro])));
  const bool sure = shown_s_[gyro] >= kShown_s && now_s_ - since_s_[gyro] >= kSure_s;
  return std::min(probability, sure ? kSureMost : kUnsureMost);
}

}  // namespace vgyro::fusion

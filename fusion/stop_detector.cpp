#include "fusion/stop_detector.h"

#include <algorithm>
#include <cmath>

#include "fusion/quadratic.h"

namespace vgyro::fusion {

namespace {

// A turn that no drift explains; so much of it between two refusals makes them separate stops.
constexpr double kTurning_dps = 2.0;
constexpr double kTurned_deg = 30.0;
constexpr double kRefusalRun_s = 5.0;

// Wheels that stand while the platform does this are broken, or the platform is carried.
constexpr double kNoStand_dps = 1.0;

// Weight of a new block in the recent level.
constexpr double kRecent = 0.25;

// Quantile of χ² over its degrees of freedom (Wilson and Hilferty), z standard deviations up.
double scatter_limit(double degrees, double z) {
  const double k = 2.0 / (9.0 * degrees);
  const double root = 1.0 - k + z * std::sqrt(k);
  return root * root * root;
}

}  // namespace

bool StopDetector::steady(const BlockLevel& block, bool on_wheels) {
  if (block.cells < 4.0) return false;
  const double limit = block.noise_variance * scatter_limit(block.cells - 1.0, kSteady);
  const double sway = on_wheels ? kSway_dps * kSway_dps : 0.0;
  if (block.cell_variance > std::max(limit, sway)) return false;
  // Sway does not average out within a block; noise does.
  sway_variance_ = block.cell_variance > limit ? block.cell_variance : 0.0;
  if (run_s_ == 0.0) return true;
  for (std::size_t gyro = 0; gyro < 2; ++gyro) {
    if (block.weight[gyro] == 0.0) continue;
    const double allowed = squared(kSteady) * (2.0 * block.excess_variance[gyro] + sway);
    if (squared(block.excess_dps[gyro] - recent_[gyro]) > allowed) return false;
  }
  return true;
}

bool StopDetector::proven() const {
  if (refusal_count_ < kRefusals || run_s_ < kRefusalRun_s || turned_deg_ < kTurned_deg)
    return false;
  for (const Refusal& refusal : refusals_) {
    if (squared(refusal.level_dps - run_level_) >
        squared(kGate) * (refusal.variance + run_variance_) + squared(0.2 * run_level_))
      return false;
  }
  return refusals_[1].turned_deg >= kTurned_deg;
}

void StopDetector::end_run() {
  if (run_refused_ && run_s_ >= kRefusalRun_s) {
    refusals_[0] = refusals_[1];
    refusals_[1] = {run_level_, run_variance_, turned_deg_};
    refusal_count_ = std::min(refusal_count_ + 1, kRefusals);
    turned_deg_ = 0.0;
  }
  run_s_ = 0.0;
  run_blocks_ = 0;
  run_refused_ = false;
}

StopDetector::Verdict StopDetector::judge(const BlockLevel& block, Wheels wheels) {
  const double doubt = std::sqrt(block.doubt_variance);
  double level = 0.0;
  double noise = 0.0;
  for (std::size_t gyro = 0; gyro < 2; ++gyro) {
    level += block.weight[gyro] * (block.excess_dps[gyro] - block.bias_dps[gyro]);
    noise += squared(block.weight[gyro]) * block.excess_variance[gyro];
  }
  if (wheels == Wheels::kRolling) wheels_distrusted_ = false;
  if (wheels == Wheels::kStanding && (std::abs(level) > kNoStand_dps + 6.0 * doubt ||
                                      block.cell_variance > squared(kNoStand_dps))) {
    wheels_distrusted_ = true;
  }
  if (wheels_distrusted_) wheels = Wheels::kUnknown;

  if (wheels == Wheels::kRolling || !steady(block, wheels == Wheels::kStanding)) {
    end_run();
    if (std::abs(level) > kTurning_dps) turned_deg_ += std::abs(level) * block.length_s;
    return Verdict::kMoving;
  }
  noise += sway_variance_;
  const double weight = block.length_s / (run_s_ + block.length_s);
  const double recent = std::max(kRecent, weight);
  for (std::size_t gyro = 0; gyro < 2; ++gyro)
    recent_[gyro] += recent * (block.excess_dps[gyro] - recent_[gyro]);
  run_level_ += weight * (level - run_level_);
  run_variance_ = squared(1.0 - weight) * run_variance_ + squared(weight) * noise;
  run_s_ += block.length_s;
  run_blocks_ = std::min(run_blocks_ + 1, kRunBlocks);
  if (run_s_ < kRun_s || run_blocks_ < kRunBlocks) return Verdict::kSteady;
  double recent_level = 0.0;
  for (std::size_t gyro = 0; gyro < 2; ++gyro)
    recent_level += block.weight[gyro] * (recent_[gyro] - block.bias_dps[gyro]);
  const double recent_variance = std::max(run_variance_, kRecent / (2.0 - kRecent) * noise);
  const bool possible =
      squared(recent_level) <= squared(kGate) * (block.doubt_variance + recent_variance);
  run_refused_ = !possible;
  if (!possible && !proven()) return Verdict::kRefused;
  refusal_count_ = 0;
  run_refused_ = false;
  return possible ? Verdict::kStop : Verdict::kRelearn;
}

}  // namespace vgyro::fusion

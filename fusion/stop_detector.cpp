#include "fusion/stop_detector.h"

#include <algorithm>
#include <cmath>

#include "fusion/quadratic.h"

namespace vgyro::fusion {

namespace {

// Least rate that counts as a turned angle: no drift explains it.
constexpr double kTurning_dps = 2.0;
// Turned angle, or time in unsteady blocks, after which the platform has moved on.
constexpr double kTurned_deg = 30.0;
constexpr double kMovedOn_s = 20.0;

// If the wheels stand while the platform turns this fast, their signal is faulty, or the vehicle is
// carried.
constexpr double kNoStand_dps = 1.0;
constexpr double kNoStandSigmas = 6.0;

// Weight of a new block in the recent level.
constexpr double kRecent = 0.25;

// Shares of a gyro's steady stretches: stops; bends and circles of a road; platforms that turn by
// themselves (ferry, turntable, ship at sea). With standing wheels only the last are left, and
// rare.
constexpr double kStops = 0.70;
constexpr double kRoadTurns = 0.25;
constexpr double kPlatformTurns = 0.05;
constexpr double kCarried = 0.03;

// Mean durations; some stops are parking.
constexpr double kStop_s = 60.0;
constexpr double kParking_s = 3600.0;
constexpr double kParkings = 0.2;
constexpr double kRoadTurn_s = 15.0;
constexpr double kPlatformTurn_s = 600.0;

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

void StopDetector::end_run() {
  run_s_ = 0.0;
  run_blocks_ = 0;
}

void StopDetector::note_motion(double level_dps, double length_s, bool rolls) {
  if (std::abs(level_dps) > kTurning_dps) turned_deg_ += std::abs(level_dps) * length_s;
  moving_s_ += length_s;
  moved_on_ = moved_on_ || rolls || turned_deg_ > kTurned_deg || moving_s_ > kMovedOn_s;
}

StopDetector::Steadiness StopDetector::judge(const BlockLevel& block, Wheels wheels,
                                             bool moves_elsewhere) {
  double level = 0.0;
  for (std::size_t gyro = 0; gyro < 2; ++gyro)
    level += block.weight[gyro] * (block.excess_dps[gyro] - block.bias_dps[gyro]);
  if (wheels == Wheels::kRolling) wheels_distrusted_ = false;
  const double no_stand = kNoStand_dps + kNoStandSigmas * std::sqrt(block.doubt_variance);
  if (wheels == Wheels::kStanding &&
      (std::abs(level) > no_stand || block.cell_variance > squared(kNoStand_dps))) {
    wheels_distrusted_ = true;
  }
  const bool on_wheels = wheels == Wheels::kStanding && !wheels_distrusted_;
  const bool rolling = wheels == Wheels::kRolling;
  moves_ = !rolling && !steady(block, on_wheels);
  const bool moves = rolling || moves_ || moves_elsewhere;
  if (moves) end_run();
  const bool rolls = moves && wheels == Wheels::kRolling;
  if (run_s_ < kRun_s) note_motion(level, block.length_s, rolls);
  if (moves) return Steadiness::kMoving;
  const double weight = block.length_s / (run_s_ + block.length_s);
  const double recent = std::max(kRecent, weight);
  for (std::size_t gyro = 0; gyro < 2; ++gyro)
    recent_[gyro] += recent * (block.excess_dps[gyro] - recent_[gyro]);
  run_s_ += block.length_s;
  run_blocks_ = std::min(run_blocks_ + 1, kRunBlocks);
  return run_s_ < kRun_s || run_blocks_ < kRunBlocks ? Steadiness::kUnsure : Steadiness::kSteady;
}

double StopDetector::log_turning(Wheels wheels) const {
  if (wheels == Wheels::kStanding && !wheels_distrusted_)
    return std::log(kCarried / (1.0 - kCarried));
  return std::log((kRoadTurns + kPlatformTurns) / kStops);
}

double StopDetector::log_turning_gain(Wheels wheels, double length_s) const {
  const double before_s = std::max(run_s_ - length_s, 0.0);
  const bool on_wheels = wheels == Wheels::kStanding && !wheels_distrusted_;
  const double road = on_wheels ? 0.0 : kRoadTurns;
  const auto turns = [&](double t_s) {
    return road * std::exp(-t_s / kRoadTurn_s) + kPlatformTurns * std::exp(-t_s / kPlatformTurn_s);
  };
  const auto stops = [](double t_s) {
    return (1.0 - kParkings) * std::exp(-t_s / kStop_s) + kParkings * std::exp(-t_s / kParking_s);
  };
  return std::log(turns(run_s_) / turns(before_s)) - std::log(stops(run_s_) / stops(before_s));
}

}  // namespace vgyro::fusion

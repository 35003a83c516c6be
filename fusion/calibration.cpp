#include "fusion/calibration.h"

#include <algorithm>
#include <cmath>

namespace vgyro::fusion {

namespace {
// The level follows slow drift of the gyros themselves within a few blocks.
constexpr double kLevelGain = 0.3;
}  // namespace

Calibrator::Calibrator(int order, double rest_s, WhenMoving when_moving)
    : order_(order),
      rest_s_(rest_s),
      when_moving_(when_moving),
      sums_(empty_sums(0.0)),
      calm_(sums_),
      calmer_(sums_) {}

Calibrator::Sums Calibrator::empty_sums(double from_s) const {
  return {LeastSquares(order_, from_s, rest_s_), LeastSquares(0, from_s, rest_s_),
          LeastSquares(order_, from_s, rest_s_)};
}

void Calibrator::begin(double t_s) {
  started_ = true;
  moved_ = false;
  level_known_ = false;
  from_s_ = t_s;
  calm_until_s_ = t_s;
  covered_s_ = 0.0;
  sums_ = empty_sums(t_s);
  calm_ = sums_;
  calmer_until_s_ = t_s;
  calmer_ = sums_;
  block_ = StillnessBlock{.from_s = t_s};
}

bool Calibrator::close_block() {
  const auto count = static_cast<double>(block_.count);
  if (block_.count < kBlockPairsMin) return true;
  const double common = block_.common / count;
  const double mean = block_.difference / count;
  const double variance = std::max(block_.difference_squares / count - mean * mean, 0.0);
  const double allowed = kStill_dps + kNoiseFactor * std::sqrt(variance / count);
  const bool still = !level_known_ || std::abs(common - level_dps_) <= allowed;
  level_dps_ = level_known_ ? level_dps_ + kLevelGain * (common - level_dps_) : common;
  level_known_ = true;
  return still;
}

bool Calibrator::finish(const Sums& sums, double t_s, double used_until_s) {
  const auto sum = moved_ ? sums.level.fit() : sums.sum.fit();
  const auto difference = sums.difference.fit();
  if (!sum || !difference) return false;
  result_ = {.end_s = t_s,
             .used_until_s = used_until_s,
             .sum = sum->polynomial,
             .difference = difference->polynomial,
             .in_motion = moved_};
  return true;
}

bool Calibrator::plausible(const std::array<double, 2>& max_bias_dps) const {
  const double first = result_.bias_dps(0, result_.used_until_s);
  const double second = result_.bias_dps(1, result_.used_until_s);
  if (std::abs(first) > max_bias_dps[0] || std::abs(second) > max_bias_dps[1]) return false;
  const double smaller = std::min(std::abs(first), std::abs(second));
  return smaller < kLargeBias_dps || std::abs(first - second) > kSameBias * smaller;
}

void Calibrator::reject() {
  ++restarts_;
  started_ = false;
  covered_s_ = 0.0;
}

bool Calibrator::cut_short(double t_s, double still_until_s) {
  if (when_moving_ != WhenMoving::kWait || !started_) return false;
  // Times of one instant were computed in different ways.
  constexpr double kRounding_s = 1e-6;
  const bool last_too = calm_until_s_ <= still_until_s + kRounding_s;
  const double until_s = last_too ? calm_until_s_ : calmer_until_s_;
  const bool enough = until_s - from_s_ >= kEnoughShare * rest_s_;
  if (enough && finish(last_too ? calm_ : calmer_, t_s, until_s)) return true;
  reject();
  return false;
}

void Calibrator::note_motion() {
  moved_ = moved_ || (started_ && when_moving_ == WhenMoving::kAccept);
}

bool Calibrator::add(double t_s, const std::array<double, 2>& rate_dps, double true_rate_dps) {
  if (!started_) begin(t_s);
  const bool complete = t_s - from_s_ >= rest_s_;
  const bool block_full = t_s - block_.from_s >= kBlock_s && block_.count >= kBlockPairsMin;
  if (complete || block_full) {
    const bool still = close_block();
    moved_ = moved_ || (!still && when_moving_ == WhenMoving::kAccept);
    if (!still && when_moving_ == WhenMoving::kWait) {
      const bool enough = calm_until_s_ - from_s_ >= kEnoughShare * rest_s_;
      if (enough && finish(calm_, t_s, calm_until_s_)) return false;
      ++restarts_;
      begin(t_s);
    } else if (complete) {
      covered_s_ = rest_s_;
      if (finish(sums_, from_s_ + rest_s_, from_s_ + rest_s_)) return false;
      ++restarts_;
      begin(t_s);
    } else {
      calmer_ = calm_;
      calmer_until_s_ = calm_until_s_;
      calm_ = sums_;
      calm_until_s_ = t_s;
      block_ = StillnessBlock{.from_s = t_s};
    }
  }
  covered_s_ = t_s - from_s_;
  const double common = 0.5 * (rate_dps[0] + rate_dps[1]) - true_rate_dps;
  const double difference = 0.5 * (rate_dps[0] - rate_dps[1]);
  sums_.sum.add(t_s, 2.0 * common);
  if (when_moving_ == WhenMoving::kAccept) sums_.level.add(t_s, 2.0 * common);
  sums_.difference.add(t_s, 2.0 * difference);
  ++block_.count;
  block_.common += common;
  block_.difference += difference;
  block_.difference_squares += difference * difference;
  return true;
}

}  // namespace vgyro::fusion

#include "gateway/estimator.h"

#include <array>
#include <cassert>
#include <limits>
#include <utility>

namespace vgyro::gateway {

namespace {

constexpr double kNone = std::numeric_limits<double>::quiet_NaN();

}  // namespace

std::unique_ptr<fusion::Corrector> make_corrector(const Plan& plan) {
  switch (plan.corrector.method) {
    case Method::kMean:
      return fusion::make_mean_corrector();
    case Method::kMutual:
      return fusion::make_mutual_corrector(plan.corrector.order, plan.corrector.window_s);
    case Method::kOptimal:
      break;
  }
  return fusion::make_optimal_corrector({.window_s = plan.corrector.window_s,
                                         .stop_rate_dps = plan.calibration.stop_rate_dps,
                                         .gyros = plan.corrector.gyros});
}

Estimator::Estimator(const Plan& plan, std::unique_ptr<fusion::Corrector> corrector)
    : plan_(plan),
      corrector_(std::move(corrector)),
      calibrator_(plan.corrector.order, plan.calibration.rest_s, plan.calibration.when_moving),
      calibrated_(!corrector_->needs_calibration()) {}

void Estimator::hear(const Surroundings& surroundings, TimePoint t) {
  corrector_->set_wheels(surroundings.wheels(t));
  corrector_->set_vibration(surroundings.vibration_g2());
  corrector_->set_temperature({surroundings.temperature_c(0), surroundings.temperature_c(1)});
}

void Estimator::set_resolution(std::size_t gyro, double step_dps) {
  corrector_->set_resolution(gyro, step_dps);
}

// --- calibration ---------------------------------------------------------------------------------

void Estimator::calibrate(const fusion::AlignedPair& pair) {
  if (!plan_.calibration.from_reference) {
    calibrate_with(pair, plan_.calibration.rate_dps);
    return;
  }
  reference_.add_pair(pair);
  calibrate_with_reference();
}

void Estimator::add_reference(TimePoint t, double rate_dps) {
  reference_.add_reference(t, rate_dps);
  if (plan_.calibration.from_reference) calibrate_with_reference();
}

void Estimator::calibrate_with_reference() {
  while (!calibrated_) {
    const auto ready = reference_.next();
    if (!ready) return;
    calibrate_with(ready->pair, ready->true_rate_dps);
  }
}

void Estimator::calibrate_with(const fusion::AlignedPair& pair, double true_rate_dps) {
  const std::uint64_t restarts = calibrator_.restarts();
  const bool used = calibrator_.add(seconds(pair.t), pair.rate_dps, true_rate_dps);
  if (calibrator_.restarts() != restarts) corrector_->restart_calibration();
  if (used) {
    corrector_->calibrate({seconds(pair.t), pair.rate_dps, pair.noise_gain}, true_rate_dps);
    return;
  }
  take_result();
}

void Estimator::take_result() {
  if (!result_can_be()) {
    calibrator_.reject();
    corrector_->restart_calibration();
    return;
  }
  corrector_->start(calibrator_.result());
  calibrated_ = true;
  moved_in_calibration_ = calibrator_.result().in_motion;
  if (calibrator_.result().cut_short())
    cut_at_ = origin_ + from_seconds(calibrator_.result().used_until_s);
}

void Estimator::restart_calibration() {
  if (calibrated_) return;
  calibrator_.reject();
  corrector_->restart_calibration();
}

void Estimator::end_calibration(TimePoint t, TimePoint still_until) {
  if (calibrated_) return;
  const std::uint64_t restarts = calibrator_.restarts();
  const bool complete = calibrator_.cut_short(seconds(t), seconds(still_until));
  if (calibrator_.restarts() != restarts) corrector_->restart_calibration();
  if (complete) take_result();
}

void Estimator::note_motion_in_calibration() {
  if (!calibrated_) calibrator_.note_motion();
}

// The result is checked only if the calibration waits for rest, since only then is it worth
// beginning again: with motion allowed the result would be the same, and a reference is trusted
// more.
bool Estimator::result_can_be() const {
  const bool waits_for_rest = !plan_.calibration.from_reference &&
                              plan_.calibration.when_moving == fusion::WhenMoving::kWait;
  constexpr double kAny = std::numeric_limits<double>::infinity();
  return !waits_for_rest || calibrator_.plausible({plan_.gyros[0].max_bias_dps.value_or(kAny),
                                                   plan_.gyros[1].max_bias_dps.value_or(kAny)});
}

// --- correction ----------------------------------------------------------------------------------

fusion::VirtualRate Estimator::update(const fusion::AlignedPair& pair) {
  assert(calibrated_);
  const fusion::VirtualRate rate =
      corrector_->update({seconds(pair.t), pair.rate_dps, pair.noise_gain});
  read_condition();
  // A stop measures each gyro against the known rate, as a calibration does; hence no calibration
  // runs beside restored biases.
  if (restored_ == Restored::kTakenUp && condition_.stops > 0) restored_ = Restored::kConfirmed;
  return rate;
}

// Reading the condition costs as much as a rate, and it is unchanged for some hundred pairs.
void Estimator::read_condition() {
  const std::uint64_t edition = corrector_->condition_edition();
  if (edition == condition_edition_) return;
  condition_edition_ = edition;
  condition_ = corrector_->condition();
}

fusion::VirtualRate Estimator::update_alone(std::size_t gyro, TimePoint t, double rate_dps) {
  assert(knows_gyros());
  fusion::RatePair single{.t_s = seconds(t)};
  single.rate_dps[gyro] = rate_dps;
  const fusion::VirtualRate rate = corrector_->update_alone(gyro, single);
  read_condition();
  return rate;
}

Quality Estimator::quality(bool both_in_use) const {
  if (!both_in_use || condition_.blind[0] || condition_.blind[1]) return Quality::kOneGyro;
  if (condition_.disagree) return Quality::kDisagree;
  if (condition_.ambiguous) return Quality::kAmbiguous;
  if (restored_ == Restored::kTakenUp) return Quality::kRestored;
  return moved_in_calibration_ ? Quality::kCalibrationUncertain : Quality::kTwoGyros;
}

BiasMode Estimator::bias_mode(bool both_in_use, bool any_in_use) const {
  if (!corrector_->needs_calibration()) return BiasMode::kNone;
  if (!calibrated_) return both_in_use ? BiasMode::kCalibrating : BiasMode::kNone;
  if (contradicted()) return BiasMode::kHold;
  if (condition_.ambiguous && any_in_use) return BiasMode::kAmbiguous;
  if (condition_.stopped && any_in_use) return BiasMode::kStop;
  return both_in_use ? BiasMode::kTracking : BiasMode::kHold;
}

// --- across a restart ----------------------------------------------------------------------------

Expected<void> Estimator::offer(const SavedState& state) {
  if (plan_.corrector.method != Method::kOptimal) {
    return fail({}, "has no effect: only `optimal` uses saved biases",
                "set `method = \"optimal\"` under [corrector] to use it");
  }
  if (Expected<void> same = check_devices(state, plan_); !same) return same;
  saved_ = state;
  restored_ = Restored::kOffered;
  return {};
}

void Estimator::begin(TimePoint t, TimePoint stamp) {
  origin_ = t;
  begun_ = true;
  if (!saved_) return;
  const bool age_is_known = stamp >= saved_->rate_stamp;
  const double age_s = age_is_known ? to_seconds(stamp - saved_->rate_stamp) : kUnknownAge_s;
  calibrated_ = corrector_->resume(saved_->drift, age_s, seconds(t));
  restored_ = calibrated_ ? Restored::kTakenUp : Restored::kRefused;
  restored_age_s_ = age_is_known ? age_s : kNone;
  restored_bias_sigma_dps_ = corrector_->drift(seconds(t)).bias_sigma_dps;
  if (calibrated_) relation_.resume(saved_->pair);
}

std::optional<SavedState> Estimator::memory(
    TimePoint t, Duration clock_offset,
    const std::array<std::optional<double>, 2>& temperature_c) const {
  if (restored_ == Restored::kOffered) return saved_;
  if (!knows_gyros()) return std::nullopt;
  // Motion that was learned as drift must not outlive the run.
  if (moved_in_calibration_ && corrector_->condition().stops == 0) return std::nullopt;
  const std::optional<fusion::DriftMemory> drift = corrector_->memory(seconds(t));
  if (!drift) return std::nullopt;
  return SavedState{.drift = *drift,
                    .rate_stamp = t - clock_offset,
                    .temperature_c = temperature_c,
                    .devices = {device_of(plan_.gyros[0]), device_of(plan_.gyros[1])},
                    .rest_rate_dps = plan_.calibration.rate_dps,
                    .pair = relation_.verdict()};
}

void Estimator::tell(Status& status) const {
  status.calibrated_s = calibrator_.covered_s();
  status.calibration_restarts = calibrator_.restarts();
  status.moved_in_calibration = moved_in_calibration_;
  status.restored = restored_;
  status.restored_age_s = restored_age_s_;
  status.restored_bias_sigma_dps = restored_bias_sigma_dps_;
  status.windows = corrector_->windows().completed;
  status.windows_skipped = corrector_->windows().skipped;
  status.disagreements = condition_.disagreements;
  status.pair = relation_.verdict();
  status.contradictions = relation_.times();
  status.ambiguous = condition_.ambiguous;
  status.probability = condition_.probability;
  status.stops = condition_.stops;
  status.stops_refused = condition_.stops_refused;
  status.stops_open = condition_.stops_open;
  status.estimate_restarts = condition_.restarts;
  status.normalized_innovation = condition_.normalized_innovation;
}

}  // namespace vgyro::gateway

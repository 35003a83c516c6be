#include "gateway/axis_pipeline.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <limits>
#include <utility>

#include "fusion/alignment.h"
#include "fusion/corrector.h"
#include "fusion/stamp_guard.h"
#include "gateway/attendance.h"
#include "gateway/estimator.h"
#include "gateway/intake.h"
#include "gateway/known_effects.h"
#include "gateway/router.h"
#include "gateway/sender.h"
#include "gateway/surroundings.h"
#include "model/catalogue.h"

namespace vgyro::gateway {

namespace {

constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
constexpr TimePoint kNever = TimePoint::min();

// A frame that comes this long after something was due follows a silence of the whole bus, or has a
// stamp that is garbage.
constexpr Duration kOverdueMax = std::chrono::seconds(30);

// The two are compared only if their rate exceeds so many σ of the other axes' unknown
// contribution.
constexpr double kCrossSigmas = 5.0;

TimePoint whole_microseconds(TimePoint t) {
  return TimePoint{Duration{to_ns(t) - to_ns(t) % 1000}};
}

}  // namespace

AxisPipeline::AxisPipeline(const Plan& the_plan, std::unique_ptr<fusion::Corrector> corrector)
    : plan_(the_plan),
      router_(plan_),
      inputs_{GyroIntake(0, GyroInput(plan_.gyros[0]), Timed::kSickToo),
              GyroIntake(1, GyroInput(plan_.gyros[1]), Timed::kSickToo)},
      surroundings_(plan_),
      known_effects_(plan_),
      aligner_({known_effects_.lag(0), known_effects_.lag(1)}),
      attendance_(plan_, aligner_, guard_),
      estimator_(plan_, std::move(corrector)),
      sender_(plan_.output),
      newest_(kNever),
      bias_sigma_dps_(kNone),
      earth_doubt_dps_(plan_.calibration.doubt_dps) {
  if (plan_.reference) reference_input_.emplace(reference_intake(*plan_.reference));
  for (GyroStatus& gyro : status_.gyros)
    gyro.last_rate_dps = kNone;
}

// --- frames in -----------------------------------------------------------------------------------

void AxisPipeline::receive(can::BusIndex bus, const can::Frame& frame, TimePoint stamp,
                           FrameSink& sink) {
  const std::uint8_t roles = router_.roles(bus, frame);
  // Most frames on a car's bus are none of the inputs; return at once if nothing is due either.
  if (roles == 0 && guard_.can_be_time(stamp) && stamp + guard_.offset() < deadline_) return;
  const Sender::Turn turn(sender_, sink, stamp);
  if (roles == 0) return let_time_pass(stamp);
  receive_besides(roles, frame, stamp);
  if ((roles & kGyro1) != 0) receive_gyro<0>(frame, stamp);
  if ((roles & kGyro2) != 0) receive_gyro<1>(frame, stamp);
}

void AxisPipeline::receive_besides(std::uint8_t roles, const can::Frame& frame, TimePoint stamp) {
  if (roles == 0) return let_time_pass(stamp);
  if (guard_.can_be_time(stamp)) surroundings_.begin(on_axis(stamp));
  if ((roles & (kAccelerometer | kSpeed)) != 0) {
    receive_surroundings(roles, frame, stamp);
    let_time_pass(stamp);
  }
  if ((roles & kReference) != 0) receive_reference(frame, stamp);
}

template <std::size_t gyro>
void AxisPipeline::receive_gyro(const can::Frame& frame, TimePoint stamp) {
  Reading reading;
  if (!admit_of<gyro>(frame, stamp, reading)) return;
  if (offer(gyro, reading, reading.rate_dps)) take_sample(gyro, reading.t, reading.rate_dps);
}

template <std::size_t gyro>
bool AxisPipeline::admit_of(const can::Frame& frame, TimePoint stamp, Reading& reading) {
  GyroStatus& own = status_.gyros[gyro];
  ++own.frames;
  const GyroIntake::Result taken = inputs_[gyro].take(frame, whole_microseconds(stamp), guard_);
  own.missing += taken.missing;
  if (taken.stamp.clock_step) step_clock();
  if (taken.reject) {
    pass_over(gyro, taken, stamp);
    return false;
  }
  const TimePoint t = taken.stamp.t;
  if (const auto cause = attendance_.judge(gyro, t, taken.rate_dps, estimator_.knows_gyros())) {
    refuse(gyro, *cause, t);
    return false;
  }
  reading.t = t;
  reading.raw_dps = taken.rate_dps;
  reading.rate_dps = take_back<gyro>(t, taken.rate_dps);
  return true;
}

bool AxisPipeline::admit(std::size_t gyro, const can::Frame& frame, TimePoint stamp,
                         Reading& reading) {
  return gyro == 0 ? admit_of<0>(frame, stamp, reading) : admit_of<1>(frame, stamp, reading);
}

bool AxisPipeline::offer(std::size_t gyro, const Reading& reading, double rate_dps) {
  GyroStatus& own = status_.gyros[gyro];
  if (!aligner_.push(gyro, reading.t, rate_dps)) {
    ++own.rejected[static_cast<std::size_t>(Reject::kLate)];
    return false;
  }
  ++own.samples;
  own.last_rate_dps = reading.raw_dps;
  return true;
}

// The sensor's own axis is sound here, and other axes may still need it.
void AxisPipeline::go_without(std::size_t gyro, TimePoint t, bool other_is_sick) {
  ++status_.gyros[gyro].rejected[static_cast<std::size_t>(Reject::kOtherAxis)];
  if (attendance_.go_without(gyro, other_is_sick)) carry_on_without(gyro, t);
  if (t >= deadline_) do_what_is_due(t);
}

// A frame without a usable value. If its stamp is believed, the fault counts as evidence about the
// gyro; otherwise the frame advances time at most, and with a repeated stamp not even that.
void AxisPipeline::pass_over(std::size_t gyro, const GyroIntake::Result& taken, TimePoint stamp) {
  if (taken.stamp.believed()) {
    attendance_.judge_refused(gyro, taken.stamp.t, *taken.reject);
    refuse(gyro, *taken.reject, taken.stamp.t);
    return;
  }
  ++status_.gyros[gyro].rejected[static_cast<std::size_t>(*taken.reject)];
  const bool stamp_alone = taken.reject == Reject::kStampJump;
  const bool repeated = taken.stamp.reject == Reject::kStampRepeated;
  if (!stamp_alone && !repeated) let_time_pass(stamp);
}

// Samples that wait for a partner belong to the time before the step.
void AxisPipeline::step_clock() {
  ++status_.clock_steps;
  aligner_.clear();
}

// The reading less the known effects.
template <std::size_t gyro>
double AxisPipeline::take_back(TimePoint t, double reading_dps) {
  surroundings_.reach(t);
  std::uint8_t needs = known_effects_.needs(gyro);
  if (plan_.corrector.gyros[gyro].learns_temperature) needs |= model::kNeedsTemperature;
  surroundings_.hear_gyro(gyro, t, inputs_[gyro].input(), needs);
  if (!plan_.gyros[gyro].flipped) [[likely]]
    return known_effects_.take_off(gyro, reading_dps, surroundings_, t);
  return -known_effects_.take_off(gyro, -reading_dps, surroundings_, t);
}

void AxisPipeline::receive_surroundings(std::uint8_t roles, const can::Frame& frame,
                                        TimePoint stamp) {
  const bool timely = guard_.can_be_time(stamp);
  const TimePoint raw = whole_microseconds(stamp);
  if ((roles & kAccelerometer) != 0) {
    ++status_.accelerometer_frames;
    const bool used = timely && surroundings_.receive_acceleration(frame, raw, guard_);
    if (!used) ++status_.accelerometer_rejected;
  }
  if ((roles & kSpeed) != 0) {
    ++status_.speed_frames;
    const bool used = timely && surroundings_.receive_speed(frame, raw, guard_);
    if (!used) ++status_.speed_rejected;
  }
}

// A frame with a believable stamp and an unusable rate.
void AxisPipeline::refuse(std::size_t gyro, Reject cause, TimePoint t) {
  ++status_.gyros[gyro].rejected[static_cast<std::size_t>(cause)];
  if (attendance_.hear_refused(gyro, t)) carry_on_without(gyro, t);
  if (t >= deadline_) do_what_is_due(t);
}

// Continues with the other gyro at once, without waiting for a time-out, beginning with its samples
// that still wait for a partner. It goes back one interval at most: VG_Age could not hold the age
// of older ones.
void AxisPipeline::carry_on_without(std::size_t gyro, TimePoint t) {
  estimator_.break_off_comparison();
  enter_state();
  const std::size_t other = 1 - gyro;
  if (!attendance_.in_use(other) || !estimator_.begun()) return;
  TimePoint sample_t =
      std::max(newest_, t - known_effects_.lag(other) - attendance_.usual_interval(other));
  double rate_dps = 0.0;
  while (aligner_.next_behind(other, sample_t, sample_t, rate_dps)) {
    take_single(other, sample_t, rate_dps, std::max(t - sample_t, Duration::zero()));
  }
}

void AxisPipeline::receive_reference(const can::Frame& frame, TimePoint stamp) {
  ++status_.reference_frames;
  std::optional<ScalarIntake::Result> taken;
  if (guard_.can_be_time(stamp)) {
    taken = reference_input_->take(frame, whole_microseconds(stamp), guard_);
  }
  if (!taken || taken->reject) {
    ++status_.reference_rejected;
    let_time_pass(stamp);
    return;
  }
  if (taken->stamp.clock_step) step_clock();
  const TimePoint t = taken->stamp.t;
  const double rate_dps = taken->value[0];
  const bool was_calibrated = estimator_.calibrated();
  if (!was_calibrated && plan_.calibration.from_reference) surroundings_.add_rate(t, rate_dps);
  estimator_.add_reference(t, rate_dps);
  if (estimator_.calibrated() && !was_calibrated) enter_state();
  let_time_pass(stamp);
}

void AxisPipeline::take_sample(std::size_t gyro, TimePoint t, double rate_dps) {
  arrive(gyro, t);
  fusion::AlignedPair pair;
  while (aligner_.pop(pair))
    take_pair(pair);
  speak_alone(gyro, t, rate_dps);
}

void AxisPipeline::arrive(std::size_t gyro, TimePoint t) {
  if (!attendance_.any_in_use() && !estimator_.begun()) attendance_.begin_waiting(t);
  // If the clock was set back during a silence, the deadline is too late; check now.
  if (!attendance_.in_use(gyro)) deadline_ = std::min(deadline_, t);
  // Check deadlines first, or a silence of both gyros would be noticed for one alone.
  if (t >= deadline_) do_what_is_due(t);
  attendance_.hear(gyro, t);
  reached_ = t;
}

void AxisPipeline::speak_alone(std::size_t gyro, TimePoint t, double rate_dps) {
  if (!attendance_.may_speak_alone(gyro, t, estimator_.begun())) return;
  const Duration lag = known_effects_.lag(gyro);
  take_single(gyro, t - lag, rate_dps, std::max(lag, Duration::zero()));
}

// --- rates ---------------------------------------------------------------------------------------

void AxisPipeline::take_pair(const fusion::AlignedPair& pair) {
  if (!estimator_.begun()) estimator_.begin(pair.t, pair.t - guard_.offset());
  ++status_.pairs;
  if (is_parallel_enough(pair)) {
    estimator_.compare(pair);
  } else {
    estimator_.break_off_comparison();
  }
  const bool contradicted = estimator_.contradicted();
  const bool changed = contradicted != (status_.state == State::kContradicted);
  // There is no pair any more, so withdraw the corrector's findings about both gyros.
  if (changed && contradicted) attendance_.set_opinion(pair.t, {});
  if (attendance_.hear_pair() || changed) enter_state();
  tell_estimator(pair.t);
  if (!estimator_.calibrated()) {
    estimator_.calibrate(pair);
    if (known_effects_.is_doubted()) known_effects_.settle(surroundings_, pair.t);
    if (estimator_.calibrated()) enter_state();
  }
  // While one gyro was missing, rates of the other one alone may have gone out for later instants.
  if (pair.t <= newest_) return;
  newest_ = pair.t;
  const bool valid = estimator_.calibrated() && !contradicted;
  fusion::VirtualRate rate = valid ? estimator_.update(pair) : fusion::VirtualRate{};
  if (valid) note_condition(pair.t);
  if (valid && known_effects_.is_doubted()) add_doubt(rate, pair.t);
  if (valid && has_cross_) add_cross_doubt(rate);
  tell_surroundings(pair.t, rate.rate_dps, valid);
  if (observer_ != nullptr) {
    observer_->on_rate(pair.t - guard_.offset(), pair.rate_dps, valid ? rate.rate_dps : kNone);
  }
  // A silence before the aligner chose the pacing gyro makes the waiting pairs too old to be sent.
  const Duration age = pair.complete - pair.t;
  // The known lag of the gyros is no lateness.
  const Duration late = age - known_effects_.lag_most();
  const bool too_late = estimator_.calibrated() && late > Attendance::kTimeOutMin &&
                        late > attendance_.time_out(aligner_.pacing_gyro());
  if (!too_late) publish(rate, valid, pair.t, age);
}

void AxisPipeline::end_calibration(TimePoint t, TimePoint still_until) {
  if (estimator_.calibrated() || !estimator_.begun()) return;
  estimator_.end_calibration(t, still_until);
  if (estimator_.calibrated()) enter_state();
}

void AxisPipeline::take_single(std::size_t gyro, TimePoint t, double rate_dps, Duration age) {
  if (t <= newest_) return;
  newest_ = t;
  attendance_.hear_alone(gyro);
  if (gyro == 1 && has_cross_) rate_dps -= cross_dps_;
  bool valid = estimator_.knows_gyros() && !estimator_.contradicted();
  fusion::VirtualRate rate;
  if (valid) {
    tell_estimator(t);
    rate = estimator_.update_alone(gyro, t, rate_dps);
    note_condition(t);
    if (known_effects_.is_doubted()) add_doubt(rate, t);
    if (has_cross_) add_cross_doubt(rate);
    valid = rate.usable;
  }
  tell_surroundings(t, rate.rate_dps, valid);
  enter_state();
  if (observer_ != nullptr) {
    std::array<double, 2> raw_dps{kNone, kNone};
    raw_dps[gyro] = rate_dps;
    observer_->on_rate(t - guard_.offset(), raw_dps, valid ? rate.rate_dps : kNone);
  }
  publish(rate, valid, t, age);
}

void AxisPipeline::tell_estimator(TimePoint t) {
  estimator_.hear(surroundings_, t);
  for (std::size_t gyro = 0; gyro < 2; ++gyro)
    estimator_.set_resolution(gyro, attendance_.step_dps(gyro));
}

// Until a virtual rate is valid, assume the rate that the calibration assumes.
void AxisPipeline::tell_surroundings(TimePoint t, double rate_dps, bool valid) {
  if (valid) {
    surroundings_.add_rate(t, rate_dps);
  } else if (!plan_.calibration.from_reference) {
    surroundings_.add_rate(t, plan_.calibration.rate_dps);
  }
}

// The known effects may be wrong, and the corrector cannot see it, because the gyros agree.
void AxisPipeline::add_doubt(fusion::VirtualRate& rate, TimePoint t) {
  if (estimator_.condition().stopped) known_effects_.settle(surroundings_, t);
  rate.sigma_dps =
      std::hypot(rate.sigma_dps,
                 known_effects_.doubt_dps(rate.rate_dps, estimator_.shares(), surroundings_, t));
}

void AxisPipeline::set_cross(double rate_dps, double variance_dps2) {
  has_cross_ = true;
  cross_dps_ = rate_dps;
  cross_variance_dps2_ = variance_dps2;
  estimator_.set_cross_variance(variance_dps2);
}

// If the unknown contribution of the other axes to gyro 2 is as large as the rate itself, the two
// need not agree.
bool AxisPipeline::is_parallel_enough(const fusion::AlignedPair& pair) const {
  if (!has_cross_ || cross_variance_dps2_ == 0.0) return true;
  const double rate_dps = std::max(std::abs(pair.rate_dps[0]), std::abs(pair.rate_dps[1]));
  return cross_variance_dps2_ * kCrossSigmas * kCrossSigmas <= rate_dps * rate_dps;
}

// A corrector of one axis can see neither the other unit's misalignment nor the Earth's rate.
void AxisPipeline::add_cross_doubt(fusion::VirtualRate& rate) const {
  const double share = estimator_.shares()[1];
  rate.sigma_dps =
      std::sqrt(rate.sigma_dps * rate.sigma_dps + share * share * cross_variance_dps2_ +
                earth_doubt_dps_ * earth_doubt_dps_);
}

// Passes on the corrector's findings about both gyros. A rate of one gyro alone yields no new ones.
void AxisPipeline::note_condition(TimePoint t) {
  attendance_.set_opinion(t, estimator_.condition());
  if (observer_ != nullptr) observer_->on_condition(t - guard_.offset(), estimator_.condition());
}

// --- states --------------------------------------------------------------------------------------

State AxisPipeline::present_state() const {
  if (attendance_.pairing() && estimator_.contradicted()) return State::kContradicted;
  if (!estimator_.calibrated())
    return attendance_.pairing() ? State::kCalibrating : State::kWaiting;
  if (attendance_.pairing()) return State::kRunning;
  if (!estimator_.begun()) return State::kWaiting;
  return attendance_.any_in_use() ? State::kDegraded : State::kLost;
}

void AxisPipeline::enter_state() {
  const State state = present_state();
  if (state == status_.state) return;
  status_.state = state;
  send_bias();
}

// The stamp of a frame that is not a sample has not been checked. Garbage far ahead would stop
// time-outs and VG_Bias until that time, so a second such frame must agree with it.
void AxisPipeline::let_time_pass(TimePoint stamp) {
  if (!guard_.can_be_time(stamp)) return;
  const TimePoint t = on_axis(stamp);
  if (t < deadline_) return;
  const bool far_ahead = reached_ != TimePoint{} && span(reached_, t) > kOverdueMax;
  const bool confirmed = t >= suspect_ && span(suspect_, t) <= kOverdueMax;
  suspect_ = far_ahead ? t : TimePoint{};
  if (!far_ahead || confirmed) do_what_is_due(t);
}

void AxisPipeline::do_what_is_due(TimePoint t) {
  reached_ = t;
  const Attendance::Silence silence = attendance_.look_for_silence(t);
  for (std::size_t gyro = 0; gyro < 2; ++gyro) {
    if (silence.fell_silent[gyro]) inputs_[gyro].fall_silent();
  }
  enter_state();
  const Duration interval = attendance_.pair_interval();
  if (sender_.miss_grid(t, interval)) send_bias();
  deadline_ = std::min(silence.next, sender_.grid_missed_at(interval));
}

void AxisPipeline::advance(TimePoint now, FrameSink& sink) {
  if (!guard_.can_be_time(now)) return;
  const TimePoint t = on_axis(now);
  if (t < deadline_) return;
  const Sender::Turn turn(sender_, sink, now);
  do_what_is_due(t);
}

// --- frames out ----------------------------------------------------------------------------------

// Sends VG_Rate, and VG_Bias if a point of its grid is reached.
void AxisPipeline::publish(const fusion::VirtualRate& rate, bool valid, TimePoint t, Duration age) {
  RateOutput output{.valid = valid,
                    .rate_dps = rate.rate_dps,
                    .sigma_dps = rate.sigma_dps,
                    .corrected_dps = rate.corrected_dps,
                    .state = status_.state,
                    .quality = estimator_.quality(attendance_.pairing()),
                    .health = health(),
                    .age = age,
                    .instant = t - guard_.offset()};
  output.valid = sender_.send_rate(output);
  if (output_observer_ != nullptr) output_observer_->on_output(output, present_drift().bias_dps);
  if (sender_.reach_grid(t + known_effects_.lag_most())) send_bias();
}

void AxisPipeline::send_bias() {
  const fusion::Drift drift = present_drift();
  const BiasMode mode = estimator_.bias_mode(attendance_.pairing(), attendance_.any_in_use());
  sender_.send_bias({drift.bias_dps, mode, health()},
                    {drift.slope_dps_s, drift.bias_sigma_dps, drift.slope_sigma_dps_s});
}

fusion::Drift AxisPipeline::present_drift() const {
  if (!estimator_.knows_gyros() || newest_ == kNever) return {{kNone, kNone}, kNone, kNone, kNone};
  fusion::Drift drift = estimator_.drift(newest_);
  for (std::size_t gyro = 0; gyro < 2; ++gyro) {
    if (!known_effects_.take_any(gyro)) continue;
    const double known_dps = known_effects_.zero_offset_dps(gyro, surroundings_, newest_);
    drift.bias_dps[gyro] += plan_.gyros[gyro].flipped ? -known_dps : known_dps;
  }
  return drift;
}

// Reading the biases costs more than a pair, and they change only with a window.
const std::array<double, 2>& AxisPipeline::bias_dps() {
  if (!estimator_.knows_gyros() || newest_ == kNever) return bias_dps_;
  const std::uint64_t windows = estimator_.windows();
  if (windows == bias_windows_ && windows > 0) return bias_dps_;
  bias_windows_ = windows;
  const fusion::Drift drift = estimator_.drift(newest_);
  bias_dps_ = drift.bias_dps;
  bias_sigma_dps_ = drift.bias_sigma_dps;
  for (double& bias_dps : bias_dps_)
    bias_dps = std::isfinite(bias_dps) ? bias_dps : 0.0;
  return bias_dps_;
}

std::uint8_t AxisPipeline::health() const {
  unsigned bits = attendance_.health_bits();
  if (estimator_.disagree(attendance_.pairing())) bits |= kGyrosDisagree;
  return static_cast<std::uint8_t>(bits);
}

TimePoint AxisPipeline::on_axis(TimePoint stamp) const {
  return whole_microseconds(stamp) + guard_.offset();
}

const Status& AxisPipeline::refreshed_status() {
  attendance_.tell(status_);
  estimator_.tell(status_);
  sender_.tell(status_);
  const fusion::Drift drift = present_drift();
  for (std::size_t gyro = 0; gyro < 2; ++gyro) {
    GyroStatus& own = status_.gyros[gyro];
    own.bias_dps = drift.bias_dps[gyro];
    own.temperature_c = inputs_[gyro].input().temperature_c();
    own.supply_v = inputs_[gyro].input().supply_v();
    own.counter_turns_at = inputs_[gyro].input().early_turn();
    own.waits_for = surroundings_.missing(gyro, known_effects_.needs(gyro));
    own.unpaired = aligner_.counts().unpaired[gyro];
  }
  status_.rates_too_far_apart = aligner_.chosen() && aligner_.too_far_apart();
  status_.bias_sigma_dps = drift.bias_sigma_dps;
  status_.disagree = estimator_.disagree(attendance_.pairing());
  return status_;
}

std::optional<SavedState> AxisPipeline::memory() const {
  std::array<std::optional<double>, 2> temperature_c;
  for (std::size_t gyro = 0; gyro < 2; ++gyro) {
    const double now_c = inputs_[gyro].input().temperature_c();
    if (std::isfinite(now_c)) temperature_c[gyro] = now_c;
  }
  return estimator_.memory(newest_, guard_.offset(), temperature_c);
}

Expected<void> AxisPipeline::resume(const SavedState& state) {
  assert(status_.gyros[0].frames + status_.gyros[1].frames == 0);
  return estimator_.offer(state);
}

void AxisPipeline::change_output(const OutputPlan& output) {
  // Parts of the pipeline refer to the rest of the plan, so only the output is replaced.
  plan_.output = output;
  sender_.change_plan(plan_.output);
}

}  // namespace vgyro::gateway

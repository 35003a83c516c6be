#include "gateway/pipeline.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <limits>
#include <utility>

#include "fusion/alignment.h"
#include "fusion/calibration.h"
#include "fusion/compensation.h"
#include "fusion/corrector.h"
#include "fusion/stamp_guard.h"
#include "gateway/gyro_health.h"
#include "gateway/intake.h"
#include "gateway/model_plan.h"
#include "gateway/output_frames.h"
#include "gateway/reference_calibration.h"
#include "gateway/router.h"
#include "gateway/surroundings.h"

namespace vgyro::gateway {

namespace {

constexpr double kNone = std::numeric_limits<double>::quiet_NaN();
constexpr std::size_t kNobody = 2;

// A gyro that is silent for this many of its usual intervals is missing, within these limits.
constexpr int kTimeOutIntervals = 10;
constexpr Duration kTimeOutMin = std::chrono::milliseconds(100);
constexpr Duration kTimeOutMax = std::chrono::seconds(1);
// But nobody is missed before he has failed to come twice.
constexpr int kTimeOutIntervalsMin = 3;

// VG_Bias stands on a grid of the bus's time. Samples drive it; the timer steps in only when none
// came for half a period more, so that a replay sends the same frames at the same places.
constexpr Duration kBiasPeriod = std::chrono::milliseconds(100);
constexpr Duration kBiasGrace = std::chrono::milliseconds(50);

// A frame that comes so long after something was due follows a silence of the whole bus, or carries
// a stamp of garbage.
constexpr Duration kOverdueMax = std::chrono::seconds(30);

TimePoint whole_microseconds(TimePoint t) {
  return TimePoint{Duration{to_ns(t) - to_ns(t) % 1000}};
}

TimePoint next_on_grid(TimePoint t) {
  const std::int64_t period = kBiasPeriod.count();
  return TimePoint{Duration{to_ns(t) / period * period + period}};
}

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

fusion::Compensation make_compensation(const Plan& plan, std::size_t gyro) {
  return fusion::Compensation(effects_of(plan, gyro));
}

}  // namespace

struct Pipeline::Impl {
  Impl(const Plan& the_plan, std::unique_ptr<fusion::Corrector> the_corrector);

  void receive(can::BusIndex bus, const can::Frame& frame, TimePoint stamp, FrameSink& sink);
  void advance(TimePoint now, FrameSink& sink);
  const Status& refreshed_status();

  void receive_gyro(std::size_t gyro, const can::Frame& frame, TimePoint stamp, FrameSink& sink);
  void receive_reference(const can::Frame& frame, TimePoint stamp, FrameSink& sink);
  void receive_surroundings(std::uint8_t roles, const can::Frame& frame, TimePoint stamp);
  [[nodiscard]] double take_back(std::size_t gyro, TimePoint t, double reading_dps);
  void take_sample(std::size_t gyro, TimePoint t, double rate_dps, TimePoint stamp,
                   FrameSink& sink);
  void take_pair(const fusion::AlignedPair& pair, TimePoint stamp, FrameSink& sink);
  void take_single(std::size_t gyro, TimePoint t, double rate_dps, Duration age, TimePoint stamp,
                   FrameSink& sink);
  void step_clock();
  void pass_over(std::size_t gyro, const GyroIntake::Result& taken, TimePoint stamp,
                 FrameSink& sink);
  void refuse(std::size_t gyro, Reject cause, TimePoint t, TimePoint stamp, FrameSink& sink);
  void set_aside(std::size_t gyro, TimePoint t, TimePoint stamp, FrameSink& sink);
  void note_condition(TimePoint t);
  void tell_corrector(TimePoint t);
  void calibrate(const fusion::AlignedPair& pair);
  void calibrate_with(const fusion::AlignedPair& pair, double true_rate_dps);
  [[nodiscard]] std::array<double, 2> max_bias() const;

  void take_up_memory(TimePoint t);
  void look_for_confirmation();
  [[nodiscard]] std::optional<SavedState> memory() const;

  void let_time_pass(TimePoint stamp, FrameSink& sink);
  void do_what_is_due(TimePoint t, TimePoint stamp, FrameSink& sink);
  void enter_state(TimePoint stamp, FrameSink& sink);
  [[nodiscard]] State present_state() const;
  [[nodiscard]] Duration usual_interval(std::size_t gyro) const;
  [[nodiscard]] Duration time_out(std::size_t gyro) const;
  [[nodiscard]] Duration bias_grace() const;
  [[nodiscard]] Duration lag_most() const;
  [[nodiscard]] bool single_is_wanted(std::size_t gyro, TimePoint t) const;

  void send_rate(const fusion::VirtualRate& rate, bool valid, TimePoint t, Duration age,
                 TimePoint stamp, FrameSink& sink);
  [[nodiscard]] fusion::Drift present_drift() const;
  void send_bias(TimePoint stamp, FrameSink& sink);
  void send_bias_when_due(TimePoint t, TimePoint stamp, FrameSink& sink);
  [[nodiscard]] Quality quality() const;
  [[nodiscard]] BiasMode bias_mode() const;
  [[nodiscard]] std::uint8_t health() const;
  void tell_surroundings(TimePoint t, double rate_dps, bool valid);
  [[nodiscard]] double seconds(TimePoint t) const { return to_seconds(t - origin); }

  Plan plan;
  Router router;
  std::array<GyroIntake, 2> inputs;
  std::array<GyroHealth, 2> health_of;
  Surroundings surroundings;
  std::array<fusion::Compensation, 2> compensations;
  std::array<std::uint8_t, 2> needs{};  ///< model::Need of the gyro's effects
  fusion::StampGuard guard;
  fusion::Aligner aligner;
  fusion::Calibrator calibrator;
  std::optional<ScalarIntake> reference_input;
  ReferenceCalibration reference;
  std::unique_ptr<fusion::Corrector> corrector;
  OutputEncoder encoder;
  RateObserver* observer = nullptr;
  Status status;
  fusion::Condition condition;  ///< as of the newest rate

  std::optional<SavedState> saved;  ///< to be taken up by the first pair

  bool calibrated = false;
  bool pairing = false;                   ///< pairs flow: both gyros are in use
  std::array<bool, 2> heard{};            ///< and may be used
  std::array<TimePoint, 2> last_heard{};  ///< newest frame, even of a gyro that is set aside
  TimePoint first_heard{};
  TimePoint origin{};                   ///< zero of the estimation's seconds: the first pair
  TimePoint newest = TimePoint::min();  ///< newest instant given to the output
  std::size_t alone = kNobody;          ///< gyro that speaks alone
  TimePoint next_bias{};
  TimePoint deadline{};  ///< nothing is due before; may lie too early, never too late
  TimePoint reached{};   ///< newest time that was believed
  TimePoint suspect{};   ///< stamp far ahead that nobody has confirmed yet
};

Pipeline::Impl::Impl(const Plan& the_plan, std::unique_ptr<fusion::Corrector> the_corrector)
    : plan(the_plan),
      router(plan),
      inputs{GyroIntake(0, GyroInput(plan.gyros[0]), Timed::kSickToo),
             GyroIntake(1, GyroInput(plan.gyros[1]), Timed::kSickToo)},
      health_of{GyroHealth(plan.gyros[0]), GyroHealth(plan.gyros[1])},
      surroundings(plan),
      compensations{make_compensation(plan, 0), make_compensation(plan, 1)},
      aligner({compensations[0].lag(), compensations[1].lag()}),
      calibrator(plan.corrector.order, plan.calibration.rest_s, plan.calibration.when_moving),
      corrector(std::move(the_corrector)),
      encoder(plan.output) {
  if (plan.reference) reference_input.emplace(reference_intake(*plan.reference));
  calibrated = !corrector->needs_calibration();
  status.rate_dps = kNone;
  status.sigma_dps = kNone;
  status.bias_sigma_dps = kNone;
  for (GyroStatus& gyro : status.gyros) {
    gyro.last_rate_dps = kNone;
    gyro.bias_dps = kNone;
    gyro.temperature_c = kNone;
  }
  for (std::size_t gyro = 0; gyro < 2; ++gyro) {
    for (const model::Effect& effect : effects_of(plan, gyro))
      needs[gyro] |= model::info(effect.kind).needs;
  }
}

// --- frames in -----------------------------------------------------------------------------------

void Pipeline::Impl::receive(can::BusIndex bus, const can::Frame& frame, TimePoint stamp,
                             FrameSink& sink) {
  const std::uint8_t roles = router.roles(bus, frame);
  if (roles == 0) {
    let_time_pass(stamp, sink);
    return;
  }
  if (guard.can_be_time(stamp)) surroundings.begin(whole_microseconds(stamp) + guard.offset());
  if ((roles & (kAccelerometer | kSpeed)) != 0) {
    receive_surroundings(roles, frame, stamp);
    let_time_pass(stamp, sink);
  }
  if ((roles & kReference) != 0) receive_reference(frame, stamp, sink);
  if ((roles & kGyro1) != 0) receive_gyro(0, frame, stamp, sink);
  if ((roles & kGyro2) != 0) receive_gyro(1, frame, stamp, sink);
}

void Pipeline::Impl::receive_gyro(std::size_t gyro, const can::Frame& frame, TimePoint stamp,
                                  FrameSink& sink) {
  GyroStatus& own = status.gyros[gyro];
  ++own.frames;
  const GyroIntake::Result taken = inputs[gyro].take(frame, whole_microseconds(stamp), guard);
  own.missing += taken.missing;
  if (taken.stamp.clock_step) step_clock();
  if (taken.reject) {
    pass_over(gyro, taken, stamp, sink);
    return;
  }
  const TimePoint t = taken.stamp.t;
  GyroHealth& health = health_of[gyro];
  const GyroHealth* other = heard[1 - gyro] ? &health_of[1 - gyro] : nullptr;
  const bool can_spare = other != nullptr && calibrated && status.pairs > 0;
  if (const auto cause = health.judge(t, taken.rate_dps, other, can_spare)) {
    refuse(gyro, *cause, t, stamp, sink);
    return;
  }
  const double rate_dps = take_back(gyro, t, taken.rate_dps);
  if (!aligner.push(gyro, t, rate_dps)) {
    ++own.rejected[static_cast<std::size_t>(Reject::kLate)];
    return;
  }
  ++own.samples;
  own.last_rate_dps = taken.rate_dps;
  take_sample(gyro, t, rate_dps, stamp, sink);
}

// A frame without a sample. One that is sick tells of its gyro where its stamp can be believed;
// what else is refused moves time at most, and a stamp that says nothing new does not.
void Pipeline::Impl::pass_over(std::size_t gyro, const GyroIntake::Result& taken, TimePoint stamp,
                               FrameSink& sink) {
  if (taken.stamp.believed()) {
    health_of[gyro].refuse(taken.stamp.t, *taken.reject);
    refuse(gyro, *taken.reject, taken.stamp.t, stamp, sink);
    return;
  }
  ++status.gyros[gyro].rejected[static_cast<std::size_t>(*taken.reject)];
  const bool stamp_alone = taken.reject == Reject::kStampJump;
  const bool repeated = taken.stamp.reject == Reject::kStampRepeated;
  if (!stamp_alone && !repeated) let_time_pass(stamp, sink);
}

// What waits for a partner is of the time before the step.
void Pipeline::Impl::step_clock() {
  ++status.clock_steps;
  aligner.clear();
}

// The reading less what the model knows of it.
double Pipeline::Impl::take_back(std::size_t gyro, TimePoint t, double reading_dps) {
  surroundings.reach(t);
  if ((needs[gyro] & model::kNeedsTemperature) != 0 ||
      plan.corrector.gyros[gyro].learns_temperature) {
    surroundings.add_temperature(gyro, t, inputs[gyro].input().temperature_c());
  }
  if (!compensations[gyro].takes_any()) return reading_dps;
  return compensations[gyro].correct(reading_dps, surroundings.at(gyro, t));
}

void Pipeline::Impl::receive_surroundings(std::uint8_t roles, const can::Frame& frame,
                                          TimePoint stamp) {
  const bool timely = guard.can_be_time(stamp);
  const TimePoint raw = whole_microseconds(stamp);
  if ((roles & kAccelerometer) != 0) {
    ++status.accelerometer_frames;
    const bool used = timely && surroundings.receive_acceleration(frame, raw, guard);
    if (!used) ++status.accelerometer_rejected;
  }
  if ((roles & kSpeed) != 0) {
    ++status.speed_frames;
    const bool used = timely && surroundings.receive_speed(frame, raw, guard);
    if (!used) ++status.speed_rejected;
  }
}

// A frame whose stamp can be believed and whose rate cannot be used.
void Pipeline::Impl::refuse(std::size_t gyro, Reject cause, TimePoint t, TimePoint stamp,
                            FrameSink& sink) {
  ++status.gyros[gyro].rejected[static_cast<std::size_t>(cause)];
  if (health_of[gyro].set_aside()) {
    last_heard[gyro] = std::max(last_heard[gyro], t);
    if (heard[gyro]) set_aside(gyro, t, stamp, sink);
  }
  if (t >= deadline) do_what_is_due(t, stamp, sink);
}

// The other one carries on without waiting for a time-out, and first with what has waited for this
// one. Beyond an interval it does not look back: VG_Age could not tell how old that is.
void Pipeline::Impl::set_aside(std::size_t gyro, TimePoint t, TimePoint stamp, FrameSink& sink) {
  heard[gyro] = false;
  pairing = false;
  enter_state(stamp, sink);
  const std::size_t other = 1 - gyro;
  if (!heard[other] || status.pairs == 0) return;
  TimePoint sample_t = std::max(newest, t - compensations[other].lag() - usual_interval(other));
  double rate_dps = 0.0;
  while (aligner.next_behind(other, sample_t, sample_t, rate_dps)) {
    take_single(other, sample_t, rate_dps, std::max(t - sample_t, Duration::zero()), stamp, sink);
  }
}

void Pipeline::Impl::receive_reference(const can::Frame& frame, TimePoint stamp, FrameSink& sink) {
  ++status.reference_frames;
  std::optional<ScalarIntake::Result> taken;
  if (guard.can_be_time(stamp)) {
    taken = reference_input->take(frame, whole_microseconds(stamp), guard);
  }
  if (!taken || taken->reject) {
    ++status.reference_rejected;
    let_time_pass(stamp, sink);
    return;
  }
  if (taken->stamp.clock_step) step_clock();
  const TimePoint t = taken->stamp.t;
  const double rate_dps = taken->value[0];
  reference.add_reference(t, rate_dps);
  if (!calibrated && plan.calibration.from_reference) surroundings.add_rate(t, rate_dps);
  while (!calibrated && plan.calibration.from_reference) {
    const auto ready = reference.next();
    if (!ready) break;
    calibrate_with(ready->pair, ready->true_rate_dps);
    if (calibrated) enter_state(stamp, sink);
  }
  let_time_pass(stamp, sink);
}

void Pipeline::Impl::take_sample(std::size_t gyro, TimePoint t, double rate_dps, TimePoint stamp,
                                 FrameSink& sink) {
  if (!heard[0] && !heard[1] && status.pairs == 0) first_heard = t;
  // Where the clock was set back in a silence, what was due then is due too late.
  if (!heard[gyro]) deadline = std::min(deadline, t);
  // First what is due, or a silence of both would be noticed of one alone.
  if (t >= deadline) do_what_is_due(t, stamp, sink);
  heard[gyro] = true;
  reached = t;
  last_heard[gyro] = std::max(last_heard[gyro], t);
  fusion::AlignedPair pair;
  while (aligner.pop(pair))
    take_pair(pair, stamp, sink);
  if (!pairing && single_is_wanted(gyro, t)) {
    const Duration lag = compensations[gyro].lag();
    take_single(gyro, t - lag, rate_dps, std::max(lag, Duration::zero()), stamp, sink);
  }
}

// --- estimation ----------------------------------------------------------------------------------

void Pipeline::Impl::take_pair(const fusion::AlignedPair& pair, TimePoint stamp, FrameSink& sink) {
  if (status.pairs == 0) {
    origin = pair.t;
    take_up_memory(pair.t);
  }
  ++status.pairs;
  if (!pairing) {
    pairing = true;
    alone = kNobody;
    enter_state(stamp, sink);
  }
  const bool was_calibrated = calibrated;
  tell_corrector(pair.t);
  if (!calibrated) calibrate(pair);
  if (calibrated && !was_calibrated) enter_state(stamp, sink);
  // While one gyro was missing the other spoke alone, perhaps for later instants than this.
  if (pair.t <= newest) return;
  newest = pair.t;
  fusion::VirtualRate rate;
  if (calibrated) rate = corrector->update({seconds(pair.t), pair.rate_dps, pair.noise_gain});
  tell_surroundings(pair.t, rate.rate_dps, calibrated);
  if (calibrated) note_condition(pair.t);
  if (status.restored == Restored::kTakenUp) look_for_confirmation();
  if (observer != nullptr) {
    observer->on_rate(pair.t - guard.offset(), pair.rate_dps, calibrated ? rate.rate_dps : kNone);
  }
  // A silence came before the choice of who paces: what waited for it is no rate of now.
  const Duration age = pair.complete - pair.t;
  // What is known to come late does.
  if (calibrated && age - lag_most() > time_out(aligner.pacing_gyro())) return;
  send_rate(rate, calibrated, pair.t, age, stamp, sink);
  send_bias_when_due(pair.t + lag_most(), stamp, sink);
}

// What the corrector weighs besides the rates.
void Pipeline::Impl::tell_corrector(TimePoint t) {
  corrector->set_wheels(surroundings.wheels(t));
  corrector->set_vibration(surroundings.vibration_g2());
  corrector->set_temperature({surroundings.temperature_c(0), surroundings.temperature_c(1)});
  for (std::size_t gyro = 0; gyro < 2; ++gyro)
    corrector->set_resolution(gyro, health_of[gyro].step_dps());
}

// The corrector's opinion of both; of one gyro alone it has none that is new.
void Pipeline::Impl::note_condition(TimePoint t) {
  condition = corrector->condition();
  for (std::size_t gyro = 0; gyro < 2; ++gyro)
    health_of[gyro].set_opinion(t, condition.noisy[gyro], condition.blind[gyro]);
  if (observer != nullptr) observer->on_condition(t - guard.offset(), condition);
}

void Pipeline::Impl::take_single(std::size_t gyro, TimePoint t, double rate_dps, Duration age,
                                 TimePoint stamp, FrameSink& sink) {
  if (t <= newest) return;
  newest = t;
  alone = gyro;
  // A gyro that was never compared with the other one is not believed, whatever the method.
  bool valid = calibrated && status.pairs > 0;
  fusion::VirtualRate rate;
  if (valid) {
    fusion::RatePair single{.t_s = seconds(t)};
    single.rate_dps[gyro] = rate_dps;
    tell_corrector(t);
    rate = corrector->update_alone(gyro, single);
    note_condition(t);
    valid = rate.usable;
  }
  tell_surroundings(t, rate.rate_dps, valid);
  enter_state(stamp, sink);
  if (observer != nullptr) {
    std::array<double, 2> raw_dps{kNone, kNone};
    raw_dps[gyro] = rate_dps;
    observer->on_rate(t - guard.offset(), raw_dps, valid ? rate.rate_dps : kNone);
  }
  send_rate(rate, valid, t, age, stamp, sink);
  send_bias_when_due(t + lag_most(), stamp, sink);
}

// Until the virtual rate can be believed the platform does what the calibration takes for granted.
void Pipeline::Impl::tell_surroundings(TimePoint t, double rate_dps, bool valid) {
  if (valid) {
    surroundings.add_rate(t, rate_dps);
  } else if (!plan.calibration.from_reference) {
    surroundings.add_rate(t, plan.calibration.rate_dps);
  }
}

// What the bus has reached when a rate dated back comes out.
Duration Pipeline::Impl::lag_most() const {
  return std::max({compensations[0].lag(), compensations[1].lag(), Duration::zero()});
}

void Pipeline::Impl::calibrate(const fusion::AlignedPair& pair) {
  if (!plan.calibration.from_reference) {
    calibrate_with(pair, plan.calibration.rate_dps);
    return;
  }
  reference.add_pair(pair);
  while (const auto ready = reference.next()) {
    calibrate_with(ready->pair, ready->true_rate_dps);
    if (calibrated) return;
  }
}

std::array<double, 2> Pipeline::Impl::max_bias() const {
  constexpr double kAny = std::numeric_limits<double>::infinity();
  return {plan.gyros[0].max_bias_dps.value_or(kAny), plan.gyros[1].max_bias_dps.value_or(kAny)};
}

void Pipeline::Impl::calibrate_with(const fusion::AlignedPair& pair, double true_rate_dps) {
  const bool used = calibrator.add(seconds(pair.t), pair.rate_dps, true_rate_dps);
  if (calibrator.restarts() != status.calibration_restarts) corrector->restart_calibration();
  status.calibrated_s = calibrator.covered_s();
  status.calibration_restarts = calibrator.restarts();
  if (used) {
    corrector->calibrate({seconds(pair.t), pair.rate_dps, pair.noise_gain}, true_rate_dps);
    return;
  }
  if (!plan.calibration.from_reference &&
      plan.calibration.when_moving == fusion::WhenMoving::kWait &&
      !calibrator.plausible(max_bias())) {
    calibrator.reject();
    corrector->restart_calibration();
    status.calibration_restarts = calibrator.restarts();
    status.calibrated_s = 0.0;
    return;
  }
  corrector->start(calibrator.result());
  calibrated = true;
  status.moved_in_calibration = calibrator.result().in_motion;
}

// --- across a restart ----------------------------------------------------------------------------

void Pipeline::Impl::take_up_memory(TimePoint t) {
  if (!saved) return;
  const TimePoint stamp = t - guard.offset();
  const bool age_is_known = stamp >= saved->rate_stamp;
  const double age_s = age_is_known ? to_seconds(stamp - saved->rate_stamp) : kUnknownAge_s;
  calibrated = corrector->resume(saved->drift, age_s, seconds(t));
  status.restored = calibrated ? Restored::kTakenUp : Restored::kRefused;
  status.restored_age_s = age_is_known ? age_s : kNone;
  status.restored_bias_sigma_dps = corrector->drift(seconds(t)).bias_sigma_dps;
}

// A stop measures each gyro against the known rate, as a calibration does; that is why none runs
// beside restored biases.
void Pipeline::Impl::look_for_confirmation() {
  if (corrector->condition().stops > 0) status.restored = Restored::kConfirmed;
}

std::optional<SavedState> Pipeline::Impl::memory() const {
  if (status.restored == Restored::kOffered) return saved;
  if (!calibrated || status.pairs == 0) return std::nullopt;
  // Motion learned as drift must not outlive the run.
  if (status.moved_in_calibration && corrector->condition().stops == 0) return std::nullopt;
  const std::optional<fusion::DriftMemory> drift = corrector->memory(seconds(newest));
  if (!drift) return std::nullopt;
  SavedState state;
  state.drift = *drift;
  state.rate_stamp = newest - guard.offset();
  for (std::size_t gyro = 0; gyro < 2; ++gyro) {
    state.devices[gyro] = device_of(plan.gyros[gyro]);
    const double temperature_c = inputs[gyro].input().temperature_c();
    if (std::isfinite(temperature_c)) state.temperature_c[gyro] = temperature_c;
  }
  state.rest_rate_dps = plan.calibration.rate_dps;
  return state;
}

// --- states --------------------------------------------------------------------------------------

State Pipeline::Impl::present_state() const {
  if (!calibrated) return pairing ? State::kCalibrating : State::kWaiting;
  if (pairing) return State::kRunning;
  if (status.pairs == 0) return State::kWaiting;
  return heard[0] || heard[1] ? State::kDegraded : State::kLost;
}

void Pipeline::Impl::enter_state(TimePoint stamp, FrameSink& sink) {
  const State state = present_state();
  if (state == status.state) return;
  status.state = state;
  send_bias(stamp, sink);
}

// Of the samples that made the choice; where the clock was set among them it says nothing.
Duration Pipeline::Impl::usual_interval(std::size_t gyro) const {
  return std::min<Duration>(aligner.interval(gyro), fusion::StampGuard::kSlowest);
}

// Samples of a slow gyro keep their right to drive VG_Bias.
Duration Pipeline::Impl::bias_grace() const {
  if (!aligner.chosen()) return kBiasGrace;
  return std::max<Duration>(kBiasGrace, 2 * usual_interval(aligner.pacing_gyro()));
}

Duration Pipeline::Impl::time_out(std::size_t gyro) const {
  const Duration interval = aligner.chosen() ? usual_interval(gyro) : guard.interval(gyro);
  const Duration most = std::max<Duration>(kTimeOutMax, kTimeOutIntervalsMin * interval);
  if (!aligner.chosen()) return most;
  return std::clamp<Duration>(kTimeOutIntervals * interval, kTimeOutMin, most);
}

// A gyro speaks alone only when the other one has really gone: not while pairs are about to start.
bool Pipeline::Impl::single_is_wanted(std::size_t gyro, TimePoint t) const {
  if (heard[1 - gyro]) return gyro == alone;  // the other one is back, but not paired yet
  return status.pairs > 0 || t - first_heard > kTimeOutMax;
}

// Nobody has judged the stamp of a frame that is not a sample. Garbage far ahead would stop
// time-outs and VG_Bias until then, so the next such frame must agree with it.
void Pipeline::Impl::let_time_pass(TimePoint stamp, FrameSink& sink) {
  if (!guard.can_be_time(stamp)) return;
  const TimePoint t = whole_microseconds(stamp) + guard.offset();
  if (t < deadline) return;
  const bool far_ahead = reached != TimePoint{} && span(reached, t) > kOverdueMax;
  const bool confirmed = t >= suspect && span(suspect, t) <= kOverdueMax;
  suspect = far_ahead ? t : TimePoint{};
  if (!far_ahead || confirmed) do_what_is_due(t, stamp, sink);
}

void Pipeline::Impl::do_what_is_due(TimePoint t, TimePoint stamp, FrameSink& sink) {
  reached = t;
  TimePoint next = TimePoint::max();
  for (std::size_t gyro = 0; gyro < 2; ++gyro) {
    if (!heard[gyro] && !health_of[gyro].set_aside()) continue;
    const TimePoint until = last_heard[gyro] + time_out(gyro);
    if (t >= until) {
      if (heard[gyro]) pairing = false;
      heard[gyro] = false;
      health_of[gyro].fall_silent(last_heard[gyro]);
      inputs[gyro].fall_silent();
    } else {
      next = std::min(next, until);
    }
  }
  enter_state(stamp, sink);
  if (t >= next_bias + bias_grace()) {
    send_bias(stamp, sink);
    next_bias = next_on_grid(t);
  }
  deadline = std::min(next, next_bias + bias_grace());
}

void Pipeline::Impl::advance(TimePoint now, FrameSink& sink) {
  if (!guard.can_be_time(now)) return;
  const TimePoint t = whole_microseconds(now) + guard.offset();
  if (t >= deadline) do_what_is_due(t, now, sink);
}

// --- frames out ----------------------------------------------------------------------------------

Quality Pipeline::Impl::quality() const {
  if (!pairing || condition.blind[0] || condition.blind[1]) return Quality::kOneGyro;
  if (condition.disagree) return Quality::kDisagree;
  if (condition.ambiguous) return Quality::kAmbiguous;
  if (status.restored == Restored::kTakenUp) return Quality::kRestored;
  return status.moved_in_calibration ? Quality::kCalibrationUncertain : Quality::kTwoGyros;
}

BiasMode Pipeline::Impl::bias_mode() const {
  if (!corrector->needs_calibration()) return BiasMode::kNone;
  if (!calibrated) return pairing ? BiasMode::kCalibrating : BiasMode::kNone;
  if (condition.ambiguous && (heard[0] || heard[1])) return BiasMode::kAmbiguous;
  if (condition.stopped && (heard[0] || heard[1])) return BiasMode::kStop;
  return pairing ? BiasMode::kTracking : BiasMode::kHold;
}

std::uint8_t Pipeline::Impl::health() const {
  const auto missing = [&](std::size_t gyro) {
    return !heard[gyro] && !health_of[gyro].set_aside();
  };
  unsigned bits = 0;
  if (missing(0)) bits |= kGyro1Missing;
  if (missing(1)) bits |= kGyro2Missing;
  if (health_of[0].suspect()) bits |= kGyro1Suspect;
  if (health_of[1].suspect()) bits |= kGyro2Suspect;
  if (pairing && condition.disagree) bits |= kGyrosDisagree;
  return static_cast<std::uint8_t>(bits);
}

void Pipeline::Impl::send_rate(const fusion::VirtualRate& rate, bool valid, TimePoint t,
                               Duration age, TimePoint stamp, FrameSink& sink) {
  const bool carried = valid && encoder.can_carry(rate.rate_dps);
  ++status.rates_out;
  if (carried) ++status.rates_out_valid;
  if (valid && !carried) ++status.rates_out_of_range;
  status.rate_dps = carried ? rate.rate_dps : kNone;
  status.sigma_dps = carried ? rate.sigma_dps : kNone;
  status.quality = carried ? quality() : Quality::kUnusable;
  sink.put(encoder.rate({.valid = carried,
                         .rate_dps = rate.rate_dps,
                         .sigma_dps = rate.sigma_dps,
                         .corrected_dps = rate.corrected_dps,
                         .state = status.state,
                         .quality = quality(),
                         .health = health(),
                         .age = age,
                         .instant = t - guard.offset()}),
           stamp);
}

fusion::Drift Pipeline::Impl::present_drift() const {
  const bool known = calibrated && status.pairs > 0 && newest != TimePoint::min();
  if (!known) return {{kNone, kNone}, kNone, kNone, kNone};
  fusion::Drift drift = corrector->drift(seconds(newest));
  for (std::size_t gyro = 0; gyro < 2; ++gyro) {
    if (!compensations[gyro].takes_any()) continue;
    drift.bias_dps[gyro] += compensations[gyro].zero_offset_dps(surroundings.at(gyro, newest));
  }
  return drift;
}

void Pipeline::Impl::send_bias(TimePoint stamp, FrameSink& sink) {
  ++status.biases_out;
  const fusion::Drift drift = present_drift();
  sink.put(encoder.bias({drift.bias_dps, bias_mode(), health()}), stamp);
  sink.put(encoder.model({drift.slope_dps_s, drift.bias_sigma_dps, drift.slope_sigma_dps_s}),
           stamp);
}

void Pipeline::Impl::send_bias_when_due(TimePoint t, TimePoint stamp, FrameSink& sink) {
  const bool clock_set_back = next_bias - t > kTimeOutMax;
  if (t < next_bias && !clock_set_back) return;
  send_bias(stamp, sink);
  next_bias = next_on_grid(t);
}

const Status& Pipeline::Impl::refreshed_status() {
  const fusion::Drift drift = present_drift();
  for (std::size_t gyro = 0; gyro < 2; ++gyro) {
    status.gyros[gyro].bias_dps = drift.bias_dps[gyro];
    status.gyros[gyro].heard = heard[gyro];
    status.gyros[gyro].fault = health_of[gyro].fault();
    status.gyros[gyro].faults = health_of[gyro].records();
    for (FaultRecord& record : status.gyros[gyro].faults)
      record.last -= guard.offset();
    status.gyros[gyro].temperature_c = inputs[gyro].input().temperature_c();
    status.gyros[gyro].waits_for = surroundings.missing(gyro, needs[gyro]);
    status.gyros[gyro].unpaired = aligner.counts().unpaired[gyro];
  }
  status.rates_too_far_apart = aligner.chosen() && aligner.too_far_apart();
  status.bias_sigma_dps = drift.bias_sigma_dps;
  status.disagree = pairing && condition.disagree;
  status.disagreements = condition.disagreements;
  status.ambiguous = condition.ambiguous;
  status.probability = condition.probability;
  status.stops = condition.stops;
  status.stops_refused = condition.stops_refused;
  status.stops_open = condition.stops_open;
  status.estimate_restarts = condition.restarts;
  status.windows = corrector->windows().completed;
  status.windows_skipped = corrector->windows().skipped;
  return status;
}

// --- the public face -----------------------------------------------------------------------------

Pipeline::Pipeline(const Plan& plan) : Pipeline(plan, make_corrector(plan)) {}
Pipeline::Pipeline(const Plan& plan, std::unique_ptr<fusion::Corrector> corrector)
    : impl_(std::make_unique<Impl>(plan, std::move(corrector))) {}
Pipeline::Pipeline(Pipeline&&) noexcept = default;
Pipeline& Pipeline::operator=(Pipeline&&) noexcept = default;
Pipeline::~Pipeline() = default;

void Pipeline::receive(can::BusIndex bus, const can::Frame& frame, TimePoint stamp,
                       FrameSink& out) {
  impl_->receive(bus, frame, stamp, out);
}

void Pipeline::advance(TimePoint now, FrameSink& out) {
  impl_->advance(now, out);
}

TimePoint Pipeline::next_deadline() const {
  // Time passes in whole microseconds: due a fraction earlier it would be due and not done.
  return std::chrono::ceil<std::chrono::microseconds>(impl_->deadline - impl_->guard.offset());
}

const Status& Pipeline::status() const {
  return impl_->refreshed_status();
}

std::optional<SavedState> Pipeline::memory() const {
  return impl_->memory();
}

Expected<void> Pipeline::resume(const SavedState& state) {
  assert(impl_->status.gyros[0].frames + impl_->status.gyros[1].frames == 0);
  if (impl_->plan.corrector.method != Method::kOptimal) {
    return fail({}, "is of no use to this method: only `optimal` takes up saved biases",
                "set `method = \"optimal\"` under [corrector] to use it");
  }
  if (Expected<void> same = check_devices(state, impl_->plan); !same) return same;
  impl_->saved = state;
  impl_->status.restored = Restored::kOffered;
  return {};
}

void Pipeline::count_on_from(const Pipeline& before) {
  impl_->encoder.count_on_from(before.impl_->encoder);
}

void Pipeline::take_over(Pipeline&& before) {
  assert(same_but_output(impl_->plan, before.impl_->plan));
  impl_->encoder.count_on_from(before.impl_->encoder);
  std::swap(impl_->encoder, before.impl_->encoder);
  // Parts of the pipeline refer to the rest of its plan.
  before.impl_->plan.output = impl_->plan.output;
  impl_ = std::move(before.impl_);
}

void Pipeline::observe(RateObserver* observer) {
  impl_->observer = observer;
}

}  // namespace vgyro::gateway

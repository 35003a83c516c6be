#include "gateway/pipeline.h"

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

// A frame that comes so long after something was due follows a silence of the whole bus, or carries
// a stamp of garbage.
constexpr Duration kOverdueMax = std::chrono::seconds(30);

TimePoint whole_microseconds(TimePoint t) {
  return TimePoint{Duration{to_ns(t) - to_ns(t) % 1000}};
}

}  // namespace

struct Pipeline::Impl {
  Impl(const Plan& the_plan, std::unique_ptr<fusion::Corrector> corrector);

  void receive(can::BusIndex bus, const can::Frame& frame, TimePoint stamp, FrameSink& sink);
  void advance(TimePoint now, FrameSink& sink);
  const Status& refreshed_status();
  [[nodiscard]] std::optional<SavedState> memory() const;

  /// Code of its own for each gyro, to which the places of all that belongs to it are constants,
  /// and in one piece: some twenty calls a frame would cost a fifth of it. What is rare says so.
  template <std::size_t gyro>
  [[gnu::flatten]] void receive_gyro(const can::Frame& frame, TimePoint stamp);
  [[gnu::noinline]] void receive_reference(const can::Frame& frame, TimePoint stamp);
  [[gnu::noinline]] void receive_surroundings(std::uint8_t roles, const can::Frame& frame,
                                              TimePoint stamp);
  template <std::size_t gyro>
  [[nodiscard]] double take_back(TimePoint t, double reading_dps);
  [[gnu::cold, gnu::noinline]] void step_clock();
  [[gnu::cold, gnu::noinline]] void pass_over(std::size_t gyro, const GyroIntake::Result& taken,
                                              TimePoint stamp);
  [[gnu::cold, gnu::noinline]] void refuse(std::size_t gyro, Reject cause, TimePoint t);
  void carry_on_without(std::size_t gyro, TimePoint t);

  void take_sample(std::size_t gyro, TimePoint t, double rate_dps);
  void take_pair(const fusion::AlignedPair& pair);
  [[gnu::noinline]] void take_single(std::size_t gyro, TimePoint t, double rate_dps, Duration age);
  void tell_estimator(TimePoint t);
  void tell_surroundings(TimePoint t, double rate_dps, bool valid);
  void note_condition(TimePoint t);
  [[gnu::cold, gnu::noinline]] void add_doubt(fusion::VirtualRate& rate, TimePoint t);

  [[nodiscard]] TimePoint on_axis(TimePoint stamp) const {
    return whole_microseconds(stamp) + guard.offset();
  }
  void let_time_pass(TimePoint stamp);
  [[gnu::cold, gnu::noinline]] void do_what_is_due(TimePoint t);
  void enter_state();
  [[nodiscard]] State present_state() const;

  void publish(const fusion::VirtualRate& rate, bool valid, TimePoint t, Duration age);
  [[gnu::cold, gnu::noinline]] void send_bias();
  [[nodiscard]] fusion::Drift present_drift() const;
  [[nodiscard]] std::uint8_t health() const;

  Plan plan;
  Router router;
  std::array<GyroIntake, 2> inputs;
  std::optional<ScalarIntake> reference_input;
  Surroundings surroundings;
  KnownEffects known_effects;
  fusion::StampGuard guard;
  fusion::Aligner aligner;
  Attendance attendance;
  Estimator estimator;
  Sender sender;
  RateObserver* observer = nullptr;
  OutputObserver* output_observer = nullptr;
  Status status;

  TimePoint newest = kNever;  ///< newest instant given to the output
  TimePoint deadline{};       ///< nothing is due before; may lie too early, never too late
  TimePoint reached{};        ///< newest time that was believed
  TimePoint suspect{};        ///< stamp far ahead that nobody has confirmed yet
};

Pipeline::Impl::Impl(const Plan& the_plan, std::unique_ptr<fusion::Corrector> corrector)
    : plan(the_plan),
      router(plan),
      inputs{GyroIntake(0, GyroInput(plan.gyros[0]), Timed::kSickToo),
             GyroIntake(1, GyroInput(plan.gyros[1]), Timed::kSickToo)},
      surroundings(plan),
      known_effects(plan),
      aligner({known_effects.lag(0), known_effects.lag(1)}),
      attendance(plan, aligner, guard),
      estimator(plan, std::move(corrector)),
      sender(plan.output) {
  if (plan.reference) reference_input.emplace(reference_intake(*plan.reference));
  for (GyroStatus& gyro : status.gyros)
    gyro.last_rate_dps = kNone;
}

// --- frames in -----------------------------------------------------------------------------------

void Pipeline::Impl::receive(can::BusIndex bus, const can::Frame& frame, TimePoint stamp,
                             FrameSink& sink) {
  const std::uint8_t roles = router.roles(bus, frame);
  // Most frames of a car's bus are nobody's, and nothing is due.
  if (roles == 0 && guard.can_be_time(stamp) && stamp + guard.offset() < deadline) return;
  const Sender::Turn turn(sender, sink, stamp);
  if (roles == 0) return let_time_pass(stamp);
  if (guard.can_be_time(stamp)) surroundings.begin(on_axis(stamp));
  if ((roles & (kAccelerometer | kSpeed)) != 0) {
    receive_surroundings(roles, frame, stamp);
    let_time_pass(stamp);
  }
  if ((roles & kReference) != 0) receive_reference(frame, stamp);
  if ((roles & kGyro1) != 0) receive_gyro<0>(frame, stamp);
  if ((roles & kGyro2) != 0) receive_gyro<1>(frame, stamp);
}

template <std::size_t gyro>
void Pipeline::Impl::receive_gyro(const can::Frame& frame, TimePoint stamp) {
  GyroStatus& own = status.gyros[gyro];
  ++own.frames;
  const GyroIntake::Result taken = inputs[gyro].take(frame, whole_microseconds(stamp), guard);
  own.missing += taken.missing;
  if (taken.stamp.clock_step) step_clock();
  if (taken.reject) {
    pass_over(gyro, taken, stamp);
    return;
  }
  const TimePoint t = taken.stamp.t;
  if (const auto cause = attendance.judge(gyro, t, taken.rate_dps, estimator.knows_gyros())) {
    refuse(gyro, *cause, t);
    return;
  }
  const double rate_dps = take_back<gyro>(t, taken.rate_dps);
  if (!aligner.push(gyro, t, rate_dps)) {
    ++own.rejected[static_cast<std::size_t>(Reject::kLate)];
    return;
  }
  ++own.samples;
  own.last_rate_dps = taken.rate_dps;
  take_sample(gyro, t, rate_dps);
}

// A frame without a sample. One that is sick tells of its gyro where its stamp can be believed;
// what else is refused moves time at most, and a stamp that says nothing new does not.
void Pipeline::Impl::pass_over(std::size_t gyro, const GyroIntake::Result& taken, TimePoint stamp) {
  if (taken.stamp.believed()) {
    attendance.judge_refused(gyro, taken.stamp.t, *taken.reject);
    refuse(gyro, *taken.reject, taken.stamp.t);
    return;
  }
  ++status.gyros[gyro].rejected[static_cast<std::size_t>(*taken.reject)];
  const bool stamp_alone = taken.reject == Reject::kStampJump;
  const bool repeated = taken.stamp.reject == Reject::kStampRepeated;
  if (!stamp_alone && !repeated) let_time_pass(stamp);
}

// What waits for a partner is of the time before the step.
void Pipeline::Impl::step_clock() {
  ++status.clock_steps;
  aligner.clear();
}

// The reading less what the model knows of it.
template <std::size_t gyro>
double Pipeline::Impl::take_back(TimePoint t, double reading_dps) {
  surroundings.reach(t);
  std::uint8_t needs = known_effects.needs(gyro);
  if (plan.corrector.gyros[gyro].learns_temperature) needs |= model::kNeedsTemperature;
  surroundings.hear_gyro(gyro, t, inputs[gyro].input(), needs);
  return known_effects.take_off(gyro, reading_dps, surroundings, t);
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
void Pipeline::Impl::refuse(std::size_t gyro, Reject cause, TimePoint t) {
  ++status.gyros[gyro].rejected[static_cast<std::size_t>(cause)];
  if (attendance.hear_refused(gyro, t)) carry_on_without(gyro, t);
  if (t >= deadline) do_what_is_due(t);
}

// Set aside: the other one carries on without waiting for a time-out, and first with what has
// waited for this one. Beyond an interval it does not look back: VG_Age could not tell how old that
// is.
void Pipeline::Impl::carry_on_without(std::size_t gyro, TimePoint t) {
  estimator.break_off_comparison();
  enter_state();
  const std::size_t other = 1 - gyro;
  if (!attendance.in_use(other) || !estimator.begun()) return;
  TimePoint sample_t =
      std::max(newest, t - known_effects.lag(other) - attendance.usual_interval(other));
  double rate_dps = 0.0;
  while (aligner.next_behind(other, sample_t, sample_t, rate_dps)) {
    take_single(other, sample_t, rate_dps, std::max(t - sample_t, Duration::zero()));
  }
}

void Pipeline::Impl::receive_reference(const can::Frame& frame, TimePoint stamp) {
  ++status.reference_frames;
  std::optional<ScalarIntake::Result> taken;
  if (guard.can_be_time(stamp)) {
    taken = reference_input->take(frame, whole_microseconds(stamp), guard);
  }
  if (!taken || taken->reject) {
    ++status.reference_rejected;
    let_time_pass(stamp);
    return;
  }
  if (taken->stamp.clock_step) step_clock();
  const TimePoint t = taken->stamp.t;
  const double rate_dps = taken->value[0];
  const bool was_calibrated = estimator.calibrated();
  if (!was_calibrated && plan.calibration.from_reference) surroundings.add_rate(t, rate_dps);
  estimator.add_reference(t, rate_dps);
  if (estimator.calibrated() && !was_calibrated) enter_state();
  let_time_pass(stamp);
}

void Pipeline::Impl::take_sample(std::size_t gyro, TimePoint t, double rate_dps) {
  if (!attendance.any_in_use() && !estimator.begun()) attendance.begin_waiting(t);
  // Where the clock was set back in a silence, what was due then is due too late.
  if (!attendance.in_use(gyro)) deadline = std::min(deadline, t);
  // First what is due, or a silence of both would be noticed of one alone.
  if (t >= deadline) do_what_is_due(t);
  attendance.hear(gyro, t);
  reached = t;
  fusion::AlignedPair pair;
  while (aligner.pop(pair))
    take_pair(pair);
  if (attendance.may_speak_alone(gyro, t, estimator.begun())) {
    const Duration lag = known_effects.lag(gyro);
    take_single(gyro, t - lag, rate_dps, std::max(lag, Duration::zero()));
  }
}

// --- rates ---------------------------------------------------------------------------------------

void Pipeline::Impl::take_pair(const fusion::AlignedPair& pair) {
  if (!estimator.begun()) estimator.begin(pair.t, pair.t - guard.offset());
  ++status.pairs;
  estimator.compare(pair);
  const bool contradicted = estimator.contradicted();
  const bool changed = contradicted != (status.state == State::kContradicted);
  // What the corrector thought of either gyro was of a pair that is none.
  if (changed && contradicted) attendance.set_opinion(pair.t, {});
  if (attendance.hear_pair() || changed) enter_state();
  tell_estimator(pair.t);
  if (!estimator.calibrated()) {
    estimator.calibrate(pair);
    if (known_effects.is_doubted()) known_effects.settle(surroundings, pair.t);
    if (estimator.calibrated()) enter_state();
  }
  // While one gyro was missing the other spoke alone, perhaps for later instants than this.
  if (pair.t <= newest) return;
  newest = pair.t;
  const bool valid = estimator.calibrated() && !contradicted;
  fusion::VirtualRate rate = valid ? estimator.update(pair) : fusion::VirtualRate{};
  if (valid) note_condition(pair.t);
  if (valid && known_effects.is_doubted()) add_doubt(rate, pair.t);
  tell_surroundings(pair.t, rate.rate_dps, valid);
  if (observer != nullptr) {
    observer->on_rate(pair.t - guard.offset(), pair.rate_dps, valid ? rate.rate_dps : kNone);
  }
  // A silence came before the choice of who paces: what waited for it is no rate of now.
  const Duration age = pair.complete - pair.t;
  // What is known to come late does.
  const Duration late = age - known_effects.lag_most();
  const bool too_late = estimator.calibrated() && late > Attendance::kTimeOutMin &&
                        late > attendance.time_out(aligner.pacing_gyro());
  if (!too_late) publish(rate, valid, pair.t, age);
}

void Pipeline::Impl::take_single(std::size_t gyro, TimePoint t, double rate_dps, Duration age) {
  if (t <= newest) return;
  newest = t;
  attendance.hear_alone(gyro);
  bool valid = estimator.knows_gyros() && !estimator.contradicted();
  fusion::VirtualRate rate;
  if (valid) {
    tell_estimator(t);
    rate = estimator.update_alone(gyro, t, rate_dps);
    note_condition(t);
    if (known_effects.is_doubted()) add_doubt(rate, t);
    valid = rate.usable;
  }
  tell_surroundings(t, rate.rate_dps, valid);
  enter_state();
  if (observer != nullptr) {
    std::array<double, 2> raw_dps{kNone, kNone};
    raw_dps[gyro] = rate_dps;
    observer->on_rate(t - guard.offset(), raw_dps, valid ? rate.rate_dps : kNone);
  }
  publish(rate, valid, t, age);
}

void Pipeline::Impl::tell_estimator(TimePoint t) {
  estimator.hear(surroundings, t);
  for (std::size_t gyro = 0; gyro < 2; ++gyro)
    estimator.set_resolution(gyro, attendance.step_dps(gyro));
}

// Until the virtual rate can be believed the platform does what the calibration takes for granted.
void Pipeline::Impl::tell_surroundings(TimePoint t, double rate_dps, bool valid) {
  if (valid) {
    surroundings.add_rate(t, rate_dps);
  } else if (!plan.calibration.from_reference) {
    surroundings.add_rate(t, plan.calibration.rate_dps);
  }
}

// What was taken off the readings may be wrong, and the corrector cannot see it: the gyros agree.
void Pipeline::Impl::add_doubt(fusion::VirtualRate& rate, TimePoint t) {
  if (estimator.condition().stopped) known_effects.settle(surroundings, t);
  rate.sigma_dps = std::hypot(
      rate.sigma_dps, known_effects.doubt_dps(rate.rate_dps, estimator.shares(), surroundings, t));
}

// The corrector's opinion of both; of one gyro alone it has none that is new.
void Pipeline::Impl::note_condition(TimePoint t) {
  attendance.set_opinion(t, estimator.condition());
  if (observer != nullptr) observer->on_condition(t - guard.offset(), estimator.condition());
}

// --- states --------------------------------------------------------------------------------------

State Pipeline::Impl::present_state() const {
  if (attendance.pairing() && estimator.contradicted()) return State::kContradicted;
  if (!estimator.calibrated()) return attendance.pairing() ? State::kCalibrating : State::kWaiting;
  if (attendance.pairing()) return State::kRunning;
  if (!estimator.begun()) return State::kWaiting;
  return attendance.any_in_use() ? State::kDegraded : State::kLost;
}

void Pipeline::Impl::enter_state() {
  const State state = present_state();
  if (state == status.state) return;
  status.state = state;
  send_bias();
}

// Nobody has judged the stamp of a frame that is not a sample. Garbage far ahead would stop
// time-outs and VG_Bias until then, so the next such frame must agree with it.
void Pipeline::Impl::let_time_pass(TimePoint stamp) {
  if (!guard.can_be_time(stamp)) return;
  const TimePoint t = on_axis(stamp);
  if (t < deadline) return;
  const bool far_ahead = reached != TimePoint{} && span(reached, t) > kOverdueMax;
  const bool confirmed = t >= suspect && span(suspect, t) <= kOverdueMax;
  suspect = far_ahead ? t : TimePoint{};
  if (!far_ahead || confirmed) do_what_is_due(t);
}

void Pipeline::Impl::do_what_is_due(TimePoint t) {
  reached = t;
  const Attendance::Silence silence = attendance.look_for_silence(t);
  for (std::size_t gyro = 0; gyro < 2; ++gyro) {
    if (silence.fell_silent[gyro]) inputs[gyro].fall_silent();
  }
  enter_state();
  const Duration interval = attendance.pair_interval();
  if (sender.miss_grid(t, interval)) send_bias();
  deadline = std::min(silence.next, sender.grid_missed_at(interval));
}

void Pipeline::Impl::advance(TimePoint now, FrameSink& sink) {
  if (!guard.can_be_time(now)) return;
  const TimePoint t = on_axis(now);
  if (t < deadline) return;
  const Sender::Turn turn(sender, sink, now);
  do_what_is_due(t);
}

// --- frames out ----------------------------------------------------------------------------------

// VG_Rate, and VG_Bias where its time has come with it.
void Pipeline::Impl::publish(const fusion::VirtualRate& rate, bool valid, TimePoint t,
                             Duration age) {
  RateOutput output{.valid = valid,
                    .rate_dps = rate.rate_dps,
                    .sigma_dps = rate.sigma_dps,
                    .corrected_dps = rate.corrected_dps,
                    .state = status.state,
                    .quality = estimator.quality(attendance.pairing()),
                    .health = health(),
                    .age = age,
                    .instant = t - guard.offset()};
  output.valid = sender.send_rate(output);
  if (output_observer != nullptr) output_observer->on_output(output, present_drift().bias_dps);
  if (sender.reach_grid(t + known_effects.lag_most())) send_bias();
}

void Pipeline::Impl::send_bias() {
  const fusion::Drift drift = present_drift();
  const BiasMode mode = estimator.bias_mode(attendance.pairing(), attendance.any_in_use());
  sender.send_bias({drift.bias_dps, mode, health()},
                   {drift.slope_dps_s, drift.bias_sigma_dps, drift.slope_sigma_dps_s});
}

fusion::Drift Pipeline::Impl::present_drift() const {
  if (!estimator.knows_gyros() || newest == kNever) return {{kNone, kNone}, kNone, kNone, kNone};
  fusion::Drift drift = estimator.drift(newest);
  for (std::size_t gyro = 0; gyro < 2; ++gyro) {
    if (!known_effects.take_any(gyro)) continue;
    drift.bias_dps[gyro] += known_effects.zero_offset_dps(gyro, surroundings, newest);
  }
  return drift;
}

std::uint8_t Pipeline::Impl::health() const {
  unsigned bits = attendance.health_bits();
  if (estimator.disagree(attendance.pairing())) bits |= kGyrosDisagree;
  return static_cast<std::uint8_t>(bits);
}

const Status& Pipeline::Impl::refreshed_status() {
  attendance.tell(status);
  estimator.tell(status);
  sender.tell(status);
  const fusion::Drift drift = present_drift();
  for (std::size_t gyro = 0; gyro < 2; ++gyro) {
    GyroStatus& own = status.gyros[gyro];
    own.bias_dps = drift.bias_dps[gyro];
    own.temperature_c = inputs[gyro].input().temperature_c();
    own.supply_v = inputs[gyro].input().supply_v();
    own.counter_turns_at = inputs[gyro].input().early_turn();
    own.waits_for = surroundings.missing(gyro, known_effects.needs(gyro));
    own.unpaired = aligner.counts().unpaired[gyro];
  }
  status.rates_too_far_apart = aligner.chosen() && aligner.too_far_apart();
  status.bias_sigma_dps = drift.bias_sigma_dps;
  status.disagree = estimator.disagree(attendance.pairing());
  return status;
}

std::optional<SavedState> Pipeline::Impl::memory() const {
  std::array<std::optional<double>, 2> temperature_c;
  for (std::size_t gyro = 0; gyro < 2; ++gyro) {
    const double now_c = inputs[gyro].input().temperature_c();
    if (std::isfinite(now_c)) temperature_c[gyro] = now_c;
  }
  return estimator.memory(newest, guard.offset(), temperature_c);
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

std::uint64_t Pipeline::spoken() const {
  return impl_->sender.spoken();
}

std::optional<SavedState> Pipeline::memory() const {
  return impl_->memory();
}

Expected<void> Pipeline::resume(const SavedState& state) {
  assert(impl_->status.gyros[0].frames + impl_->status.gyros[1].frames == 0);
  return impl_->estimator.offer(state);
}

void Pipeline::count_on_from(const Pipeline& before) {
  impl_->sender.count_on_from(before.impl_->sender);
}

void Pipeline::take_over(Pipeline&& before) {
  assert(same_but_output(impl_->plan, before.impl_->plan));
  // Parts of the pipeline refer to the rest of its plan.
  before.impl_->plan.output = impl_->plan.output;
  before.impl_->sender.change_plan(impl_->plan.output);
  impl_ = std::move(before.impl_);
}

void Pipeline::observe(RateObserver* observer) {
  impl_->observer = observer;
}

void Pipeline::observe_output(OutputObserver* observer) {
  impl_->output_observer = observer;
}

}  // namespace vgyro::gateway

#include "gateway/unit_pipeline.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <utility>

#include "base/angle.h"
#include "gateway/axes_plan.h"

namespace vgyro::gateway {

namespace {

// The evidence of one axis for a turn counts for no more than this with the others: a wrong finding
// must not last for ever.
constexpr double kLogTurningMost = 6.0;
// From this probability on, a steady turn about one axis is motion of the platform.
constexpr double kSurelyTurning = 0.9;
// Pairs of different axes that are further apart belong to different motion.
constexpr Duration kApartMost = LayoutSet::kApartMost;
constexpr std::array<std::uint8_t, 2> kGyroRoles{kGyro1, kGyro2};

double finite_or_0(double value) {
  return std::isfinite(value) ? value : 0.0;
}

}  // namespace

// --- a frame of all rates ------------------------------------------------------------------------

void SharedRates::begin(FrameSink& sink, TimePoint stamp) {
  sink_ = &sink;
  stamp_ = stamp;
}

void SharedRates::end() {
  flush();
  sink_ = nullptr;
}

// While one axis has a single gyro, its instants differ from those of the pairs.
void SharedRates::collect(std::size_t axis, const RateOutput& output) {
  const bool other_instant = std::any_of(
      rates_.begin(), rates_.end(),
      [&](const std::optional<RateOutput>& one) { return one && one->instant != output.instant; });
  if (other_instant || rates_[axis]) flush();
  rates_[axis] = output;
  any_ = true;
}

void SharedRates::flush() {
  if (!any_) return;
  std::array<const RateOutput*, kAxes> axes{};
  for (std::size_t axis = 0; axis < kAxes; ++axis)
    axes[axis] = rates_[axis] ? &*rates_[axis] : nullptr;
  sink_->put(encoder_.rates(axes), stamp_);
  rates_ = {};
  any_ = false;
}

// --- setting up ----------------------------------------------------------------------------------

/// While it lives, all axes send to one sink.
class UnitPipeline::Turn {
 public:
  Turn(UnitPipeline& units, FrameSink& sink, TimePoint stamp) : units_(units) {
    units.begin_output(sink, stamp);
    for (std::size_t place = 0; place < units.axes_.size(); ++place)
      turns_[place].emplace(units.axes_[place]->sender(), sink, stamp);
  }
  ~Turn() { units_.end_output(); }
  Turn(const Turn&) = delete;
  Turn& operator=(const Turn&) = delete;

 private:
  UnitPipeline& units_;
  std::array<std::optional<AxisPipeline::Turn>, kAxes> turns_;
};

UnitPipeline::UnitPipeline(const Plan& plan)
    : plan_(plan), router_(plan_), layouts_(plan_.output), heading_(plan_.calibration) {
  for (const Plan& pair : plan_.axes)
    axes_.push_back(std::make_unique<AxisPipeline>(pair, make_corrector(pair)));
  for (std::size_t gyro = 0; gyro < 2; ++gyro)
    units_[gyro] = unit_of(gyro);
  learns_misalignment_ = plan_.corrector.method == Method::kOptimal;
  if (plan_.output.rate_is_shared && plan_.output.vgyro_frames) shared_.emplace(plan_.output);
  share_output();
}

void UnitPipeline::share_output() {
  for (const auto& axis : axes_) {
    axis->sender().share_rates(shared_ ? &*shared_ : nullptr, axis->plan().axis);
    axis->sender().share_layouts(layouts_.empty() ? nullptr : &layouts_, axis->plan().axis);
  }
}

void UnitPipeline::begin_output(FrameSink& sink, TimePoint stamp) {
  sink_ = &sink;
  stamp_ = stamp;
  if (shared_) shared_->begin(sink, stamp);
}

void UnitPipeline::end_output() {
  if (shared_) shared_->end();
  layouts_.settle(stamp_, *sink_);
  sink_ = nullptr;
}

// All rates of one instant have been collected.
void UnitPipeline::settle_output() {
  if (shared_) shared_->flush();
  layouts_.settle(stamp_, *sink_);
}

UnitPipeline::Unit UnitPipeline::unit_of(std::size_t gyro) const {
  Unit unit;
  for (std::size_t place = 0; place < axes_.size(); ++place) {
    for (std::size_t other = 0; other < axes_.size(); ++other) {
      const GyroPlan& sensor = plan_.axes[other].gyros[gyro];
      const double share = plan_.gyros[gyro].mount.at(plan_.axes[place].axis, sensor.sensor_axis);
      unit.share[place][other] = sensor.flipped ? -share : share;
      unit.together[place][other] = sensor.match == plan_.axes[place].gyros[gyro].match;
      unit.turns = unit.turns || unit.share[place][other] != (place == other ? 1.0 : 0.0);
    }
  }
  return unit;
}

// --- frames in -----------------------------------------------------------------------------------

bool UnitPipeline::nothing_due(TimePoint stamp) const {
  return std::all_of(axes_.begin(), axes_.end(),
                     [&](const auto& axis) { return axis->nothing_due(stamp); });
}

void UnitPipeline::receive(can::BusIndex bus, const can::Frame& frame, TimePoint stamp,
                           FrameSink& sink) {
  const std::uint8_t all = router_.roles(bus, frame);
  if (all == 0 && nothing_due(stamp)) return;
  const Turn turn(*this, sink, stamp);
  std::array<std::uint8_t, kAxes> roles{};
  for (std::size_t place = 0; place < axes_.size(); ++place) {
    roles[place] = all == 0 ? std::uint8_t{0} : axes_[place]->roles(bus, frame);
    axes_[place]->receive_besides(roles[place], frame, stamp);
  }
  for (std::size_t gyro = 0; gyro < 2; ++gyro) {
    if ((all & kGyroRoles[gyro]) != 0) receive_unit(gyro, kGyroRoles[gyro], roles, frame, stamp);
  }
  share_restarts();
}

// First every axis decides whether its reading can be used. Then the readings are turned into the
// vehicle's axes and offered, and the pairs they complete are taken.
void UnitPipeline::receive_unit(std::size_t gyro, std::uint8_t role,
                                const std::array<std::uint8_t, kAxes>& roles,
                                const can::Frame& frame, TimePoint stamp) {
  Unit& unit = units_[gyro];
  std::array<AxisPipeline::Reading, kAxes> readings;
  std::array<bool, kAxes> heard{};
  for (std::size_t place = 0; place < axes_.size(); ++place) {
    if ((roles[place] & role) == 0) continue;
    heard[place] = axes_[place]->admit(gyro, frame, stamp, readings[place]);
    if (!heard[place]) continue;
    unit.reading_dps[place] = readings[place].rate_dps;
    unit.read_at[place] = stamp;
  }
  std::array<double, kAxes> rate_dps{};
  for (std::size_t place = 0; place < axes_.size(); ++place) {
    if (!heard[place]) continue;
    rate_dps[place] = readings[place].rate_dps;
    const Worth worth = unit.turns ? turn(gyro, place, stamp, rate_dps[place]) : Worth::kNew;
    if (worth != Worth::kNew)
      axes_[place]->go_without(gyro, readings[place].t, worth == Worth::kSick);
    heard[place] =
        worth == Worth::kNew && axes_[place]->offer(gyro, readings[place], rate_dps[place]);
  }
  for (std::size_t place = 0; place < axes_.size(); ++place) {
    if (heard[place]) axes_[place]->arrive(gyro, readings[place].t);
  }
  take_pairs();
  for (std::size_t place = 0; place < axes_.size(); ++place) {
    if (!heard[place] || axes_[place]->pairing()) continue;
    note_single(gyro, place, rate_dps[place]);
    axes_[place]->speak_alone(gyro, readings[place].t, rate_dps[place]);
    follow_heading(readings[place].t);
  }
}

UnitPipeline::Worth UnitPipeline::worth(std::size_t gyro, std::size_t place, std::size_t other,
                                        TimePoint stamp) const {
  const Unit& unit = units_[gyro];
  if (axes_[other]->set_aside(gyro)) return Worth::kSick;
  const Duration age = span(unit.read_at[other], stamp);
  if (unit.together[place][other]) return age == Duration::zero() ? Worth::kNew : Worth::kOld;
  const Duration interval = axes_[other]->interval(gyro);
  const Duration most = interval > Duration::zero() ? interval + interval / 2 : kApartMost;
  return age <= most && age >= -most ? Worth::kNew : Worth::kOld;
}

// If a sensor axis with a small share here has no new reading, the vehicle's known rate about it is
// used instead.
UnitPipeline::Worth UnitPipeline::turn(std::size_t gyro, std::size_t place, TimePoint stamp,
                                       double& rate_dps) const {
  const Unit& unit = units_[gyro];
  Worth all = Worth::kNew;
  rate_dps = 0.0;
  for (std::size_t other = 0; other < axes_.size(); ++other) {
    const double share = unit.share[place][other];
    const Worth one = share == 0.0 ? Worth::kNew : worth(gyro, place, other, stamp);
    if (one == Worth::kNew) {
      rate_dps += share * unit.reading_dps[other];
    } else if (std::abs(share) > kShareMissed) {
      all = std::max(all, one);
    } else {
      rate_dps += share * rate_dps_[plan_.axes[other].axis];
    }
  }
  return all;
}

// --- rates ---------------------------------------------------------------------------------------

// All axes of a unit have the same stamps, so the pairs of one instant come out together; an axis
// in a message of its own has stamps of its own.
void UnitPipeline::take_pairs() {
  while (true) {
    Pairs pairs;
    bool any = false;
    for (std::size_t place = 0; place < axes_.size(); ++place) {
      fusion::AlignedPair pair;
      if (!axes_[place]->pop(pair)) continue;
      pairs[place] = pair;
      any = true;
    }
    if (!any) return;
    take_round(pairs);
  }
}

void UnitPipeline::take_round(Pairs& pairs) {
  note_rates(pairs);
  if (learns_misalignment_) learn_misalignment(pairs);
  TimePoint t;
  for (std::size_t place = 0; place < axes_.size(); ++place) {
    if (!pairs[place]) continue;
    if (learns_misalignment_) {
      const std::size_t axis = plan_.axes[place].axis;
      pairs[place]->rate_dps[1] -= misalignment_.cross_dps(axis, rate_dps_);
      set_cross(place);
    }
    axes_[place]->take_pair(*pairs[place]);
    t = pairs[place]->t;
  }
  settle_output();
  share_calibrations(t);
  share_motion();
  follow_heading(t);
}

void UnitPipeline::set_cross(std::size_t place) {
  const std::size_t axis = plan_.axes[place].axis;
  axes_[place]->set_cross(misalignment_.cross_dps(axis, rate_dps_),
                          misalignment_.cross_variance(axis, rate_dps_));
}

// The rate of the platform at this instant. An error as large as a bias is harmless, since it is
// only multiplied by small angles.
void UnitPipeline::note_rates(const Pairs& pairs) {
  for (std::size_t place = 0; place < axes_.size(); ++place) {
    double& rate_dps = rate_dps_[plan_.axes[place].axis];
    if (!pairs[place]) {
      rate_dps = finite_or_0(axes_[place]->rate_dps());
      continue;
    }
    const std::array<double, 2>& bias_dps = axes_[place]->bias_dps();
    rate_dps =
        0.5 * (pairs[place]->rate_dps[0] - bias_dps[0] + pairs[place]->rate_dps[1] - bias_dps[1]);
  }
}

// One unit alone: uses its rate about this axis and the known rates about the others.
void UnitPipeline::note_single(std::size_t gyro, std::size_t place, double rate_dps) {
  if (!learns_misalignment_) return;
  for (std::size_t other = 0; other < axes_.size(); ++other) {
    if (other != place) rate_dps_[plan_.axes[other].axis] = finite_or_0(axes_[other]->rate_dps());
  }
  rate_dps_[plan_.axes[place].axis] = rate_dps - axes_[place]->bias_dps()[gyro];
  set_cross(place);
}

// If axes have messages of their own, their newest pairs are taken for one instant: the platform's
// motion within a millisecond is small against that within a cell. An axis with one gyro alone
// yields no evidence itself, but its known rate serves the others.
void UnitPipeline::learn_misalignment(const Pairs& pairs) {
  TimePoint oldest = TimePoint::max();
  TimePoint newest = TimePoint::min();
  for (std::size_t place = 0; place < axes_.size(); ++place) {
    if (pairs[place]) waiting_[place] = pairs[place];
    if (!waiting_[place] && axes_[place]->pairing()) return;
    if (!waiting_[place]) continue;
    oldest = std::min(oldest, waiting_[place]->t);
    newest = std::max(newest, waiting_[place]->t);
  }
  if (newest - oldest > kApartMost) {
    misalignment_.break_off();
    for (auto& pair : waiting_) {
      if (pair && newest - pair->t > kApartMost) pair.reset();
    }
    return;
  }
  fusion::AxisRates first{};
  fusion::AxisRates second{};
  fusion::Misalignment::Both both{};
  for (std::size_t place = 0; place < axes_.size(); ++place) {
    const std::size_t axis = plan_.axes[place].axis;
    both[axis] = waiting_[place].has_value();
    first[axis] = both[axis] ? waiting_[place]->rate_dps[0] : rate_dps_[axis];
    second[axis] = both[axis] ? waiting_[place]->rate_dps[1] : rate_dps_[axis];
  }
  waiting_ = {};
  begin(newest);
  misalignment_.add(to_seconds(newest - origin_), first, second, both);
}

void UnitPipeline::begin(TimePoint t) {
  if (begun_) return;
  begun_ = true;
  origin_ = t;
  if (!resumed_) return;
  heading_.age(age_s(t));
  if (saved_) (void)misalignment_.resume(*saved_, age_s(t));
}

// As with a single axis: if the clock is before the state's stamp, the age is unknown.
double UnitPipeline::age_s(TimePoint t) const {
  const TimePoint stamp = axes_[0]->stamp_of(t);
  if (stamp < saved_stamp_) return Estimator::kUnknownAge_s;
  return to_seconds(stamp - saved_stamp_);
}

// --- shared between axes -------------------------------------------------------------------------

// A stop must be a stop of all axes, and a turn about one axis is a turn of the platform.
void UnitPipeline::share_motion() {
  std::array<std::uint64_t, kAxes> editions{};
  for (std::size_t place = 0; place < axes_.size(); ++place)
    editions[place] = axes_[place]->estimator().condition_edition();
  // The conditions stay the same for some hundred pairs.
  if (editions == told_of_) return;
  told_of_ = editions;
  for (std::size_t place = 0; place < axes_.size(); ++place) {
    fusion::Elsewhere elsewhere;
    for (std::size_t other = 0; other < axes_.size(); ++other) {
      if (other == place || !axes_[other]->estimator().calibrated()) continue;
      const fusion::Condition& condition = axes_[other]->estimator().condition();
      elsewhere.moves = elsewhere.moves || condition.moves;
      if (!condition.steady) continue;
      const auto of = [&](fusion::Hypothesis hypothesis) {
        constexpr double kLeast = 1e-6;
        return std::max(condition.probability[static_cast<std::size_t>(hypothesis)], kLeast);
      };
      const double turning = of(fusion::Hypothesis::kTurning);
      elsewhere.moves = elsewhere.moves || turning > kSurelyTurning;
      elsewhere.log_turning = std::clamp(std::log(turning / of(fusion::Hypothesis::kStanding)),
                                         elsewhere.log_turning, kLogTurningMost);
    }
    if (elsewhere == told_[place]) continue;
    told_[place] = elsewhere;
    axes_[place]->estimator().set_elsewhere(elsewhere);
  }
}

// Rest that ends for one axis ends for all: axes that have rested long enough are calibrated, the
// others begin again. Motion that one calibration has accepted counts for all axes.
void UnitPipeline::share_calibrations(TimePoint t) {
  bool moved = false;
  std::optional<TimePoint> still_until;
  bool all_calibrated = true;
  for (const auto& axis : axes_) {
    moved = moved || axis->estimator().moved_in_calibration();
    if (!still_until) still_until = axis->estimator().calibration_cut_at();
    all_calibrated = all_calibrated && axis->estimator().calibrated();
  }
  if (all_calibrated) return;
  for (const auto& axis : axes_) {
    if (still_until && !cut_short_) axis->end_calibration(t, *still_until);
    if (moved) axis->estimator().note_motion_in_calibration();
  }
  cut_short_ = still_until.has_value();
}

void UnitPipeline::share_restarts() {
  std::array<bool, kAxes> restarted{};
  bool any = false;
  for (std::size_t place = 0; place < axes_.size(); ++place) {
    restarted[place] = axes_[place]->estimator().calibration_restarts() != restarts_[place];
    any = any || restarted[place];
  }
  if (!any) return;
  for (std::size_t place = 0; place < axes_.size(); ++place) {
    if (!restarted[place]) axes_[place]->estimator().restart_calibration();
    restarts_[place] = axes_[place]->estimator().calibration_restarts();
  }
}

// The Earth's rate about the vehicle's horizontal axes changes with its heading.
void UnitPipeline::follow_heading(TimePoint t) {
  if (!heading_.is_told()) return;
  begin(t);
  const bool rests = std::none_of(axes_.begin(), axes_.end(),
                                  [](const auto& axis) { return axis->estimator().calibrated(); });
  heading_.follow(t, turn_about_z(), rests);
  share_heading();
}

std::optional<Heading::Turn> UnitPipeline::turn_about_z() {
  AxisPipeline& axis = *axes_.back();
  const State state = axis.status().state;
  const bool speaks = state == State::kRunning || state == State::kDegraded;
  if (axis.plan().axis != 2 || !speaks || !std::isfinite(axis.rate_dps())) return std::nullopt;
  return Heading::Turn{.rate_dps = axis.rate_dps(),
                       .sigma_dps = finite_or_0(axis.sigma_dps()),
                       .bias_sigma_dps = finite_or_0(axis.bias_sigma_dps())};
}

// What a stop or a calibration teaches is as uncertain as the Earth's rate that is expected then.
void UnitPipeline::share_heading() {
  for (const auto& axis : axes_) {
    const std::size_t about = axis->plan().axis;
    if (about == 2) continue;
    Estimator& estimator = axis->estimator();
    const double rate_dps = heading_.earth_rate_dps(about);
    const double doubt_dps = heading_.earth_doubt_dps(about);
    estimator.set_stop_rate(rate_dps);
    if (!estimator.calibrated()) {
      axis->set_earth_doubt(std::hypot(doubt_dps, rate_dps - axis->plan().calibration.rate_dps));
    } else if (estimator.condition().stopped) {
      axis->set_earth_doubt(doubt_dps);
    }
  }
}

// --- time ----------------------------------------------------------------------------------------

void UnitPipeline::advance(TimePoint now, FrameSink& sink) {
  begin_output(sink, now);
  for (const auto& axis : axes_)
    axis->advance(now, sink);
  end_output();
}

TimePoint UnitPipeline::next_deadline() const {
  TimePoint next = TimePoint::max();
  for (const auto& axis : axes_)
    next = std::min(next, axis->next_deadline());
  return next;
}

std::uint64_t UnitPipeline::spoken() const {
  std::uint64_t sum = 0;
  for (const auto& axis : axes_)
    sum += axis->spoken();
  return sum;
}

// --- across a restart ----------------------------------------------------------------------------

std::optional<SavedState> UnitPipeline::memory() const {
  std::vector<SavedState> axes;
  for (const auto& axis : axes_) {
    auto state = axis->memory();
    if (!state) continue;
    state->axis = axis->plan().axis;
    state->earth_doubt_dps = axis->earth_doubt_dps();
    axes.push_back(std::move(*state));
  }
  if (axes.empty()) return std::nullopt;
  SavedState all = axes.front();
  all.axes = std::move(axes);
  if (learns_misalignment_) all.misalignment = begun_ || !saved_ ? misalignment_.memory() : *saved_;
  all.heading = heading_.memory();
  return all;
}

// An older state lacks the uncertainty of the heading at the time of learning.
double UnitPipeline::doubt_of(const SavedState& state, const Plan& pair) const {
  if (state.earth_doubt_dps) return std::max(*state.earth_doubt_dps, pair.calibration.doubt_dps);
  const bool turns = heading_.is_told() && pair.axis != 2;
  return turns ? heading_.north_dps() / std::numbers::sqrt2 : pair.calibration.doubt_dps;
}

Expected<void> UnitPipeline::resume(const SavedState& state) {
  if (auto same = check_devices(state, plan_); !same) return same;
  for (const SavedState& one : state.axes) {
    for (const auto& axis : axes_) {
      if (axis->plan().axis != one.axis) continue;
      if (auto taken = axis->resume(one); !taken) return taken;
      axis->set_earth_doubt(doubt_of(one, axis->plan()));
    }
  }
  resumed_ = true;
  heading_.resume(state.heading);
  saved_ = state.misalignment;
  saved_stamp_ = state.rate_stamp;
  return {};
}

void UnitPipeline::count_on_from(const UnitPipeline& before) {
  for (const auto& axis : axes_) {
    for (const auto& other : before.axes_) {
      if (other->plan().axis == axis->plan().axis) axis->count_on_from(*other);
    }
  }
  if (shared_ && before.shared_) shared_->count_on_from(*before.shared_);
  layouts_.count_on_from(before.layouts_);
}

void UnitPipeline::change_output(const Plan& plan) {
  plan_.output = plan.output;
  for (std::size_t place = 0; place < axes_.size(); ++place)
    axes_[place]->change_output(plan.axes[place].output);
  std::optional<SharedRates> shared;
  if (plan_.output.rate_is_shared && plan_.output.vgyro_frames) shared.emplace(plan_.output);
  if (shared && shared_) shared->count_on_from(*shared_);
  shared_ = shared;
  layouts_.change_plan(plan_.output);
  share_output();
}

// --- the whole platform --------------------------------------------------------------------------

namespace {

// The platform's state is that of its worst axis.
constexpr std::array kWorstFirst{State::kContradicted, State::kLost,     State::kWaiting,
                                 State::kCalibrating,  State::kDegraded, State::kRunning};

std::size_t rank_of(State state) {
  return static_cast<std::size_t>(std::find(kWorstFirst.begin(), kWorstFirst.end(), state) -
                                  kWorstFirst.begin());
}

void add_gyro(const GyroStatus& axis, GyroStatus& unit) {
  unit.heard = unit.heard && axis.heard;
  if (!unit.fault) unit.fault = axis.fault;
  for (std::size_t i = 0; i < kFaultCount; ++i) {
    unit.faults[i].times = std::max(unit.faults[i].times, axis.faults[i].times);
    unit.faults[i].last = std::max(unit.faults[i].last, axis.faults[i].last);
  }
  unit.samples = std::min(unit.samples, axis.samples);
  for (std::size_t i = 0; i < kRejectCount; ++i)
    unit.rejected[i] = std::max(unit.rejected[i], axis.rejected[i]);
  unit.waits_for |= axis.waits_for;
}

void add_axis(const Status& axis, Status& all) {
  for (std::size_t gyro = 0; gyro < 2; ++gyro)
    add_gyro(axis.gyros[gyro], all.gyros[gyro]);
  if (rank_of(axis.state) < rank_of(all.state)) all.state = axis.state;
  all.pairs = std::min(all.pairs, axis.pairs);
  all.rates_out += axis.rates_out;
  all.rates_out_valid += axis.rates_out_valid;
  all.rates_out_of_range += axis.rates_out_of_range;
  all.biases_out += axis.biases_out;
  all.quality = std::min(all.quality, axis.quality);
  all.bias_sigma_dps = std::max(all.bias_sigma_dps, axis.bias_sigma_dps);
  all.calibrated_s = std::min(all.calibrated_s, axis.calibrated_s);
  all.calibration_restarts = std::max(all.calibration_restarts, axis.calibration_restarts);
  all.moved_in_calibration = all.moved_in_calibration || axis.moved_in_calibration;
  all.disagree = all.disagree || axis.disagree;
  all.disagreements += axis.disagreements;
  all.contradictions += axis.contradictions;
  if (all.pair.contradiction == fusion::Contradiction::kNone) all.pair = axis.pair;
  all.ambiguous = all.ambiguous || axis.ambiguous;
  all.estimate_restarts += axis.estimate_restarts;
  all.normalized_innovation = std::fmax(all.normalized_innovation, axis.normalized_innovation);
  all.rates_too_far_apart = all.rates_too_far_apart || axis.rates_too_far_apart;
}

}  // namespace

const Status& UnitPipeline::refreshed_status() {
  // The last axis, about which a vehicle turns, provides the rate that stands for all.
  status_ = axes_.back()->refreshed_status();
  for (std::size_t place = 0; place + 1 < axes_.size(); ++place)
    add_axis(axes_[place]->refreshed_status(), status_);
  layouts_.tell(status_);
  status_.misalignment_segments = misalignment_.segments();
  for (std::size_t axis = 0; axis < kAxes; ++axis) {
    status_.misalignment_deg[axis] = misalignment_.angle_rad()[axis] / kRadPerDeg;
    status_.misalignment_sigma_deg[axis] = misalignment_.sigma_rad()[axis] / kRadPerDeg;
  }
  return status_;
}

}  // namespace vgyro::gateway

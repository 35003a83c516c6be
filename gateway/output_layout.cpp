#include "gateway/output_layout.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <limits>
#include <span>
#include <utility>

namespace vgyro::gateway {

namespace {

// A sensor as frequent as the wanted frames is a little early now and then: arbitration delays a
// frame by one or two others, some 0.1 to 2 ms.
constexpr Duration kEarlyMost = std::chrono::milliseconds(2);
constexpr Duration::rep kEarlyShare = 4;  // of the period, where that is shorter
// Late frames are made up for, but at no less than half a period's distance.
constexpr Duration::rep kCloseShare = 2;
constexpr double kRoundingSlack_steps = 1e-6;
// The pause between bunches of axes exceeds the pauses inside one by more than jitter does.
constexpr Duration::rep kLongerPause = 2;
constexpr double kNone = std::numeric_limits<double>::quiet_NaN();

std::span<std::uint8_t> payload_of(can::Frame& frame) {
  return {frame.data.data(), frame.length};
}

double in_unit_of(const OutputField& field, double value) {
  return (value - field.shift) / field.scale;
}

// False for NaN.
bool fits(const OutputField& field, double in_unit) {
  return in_unit >= field.minimum && in_unit <= field.maximum;
}

bool can_say(const LayoutRate& one, const RateOutput& output) {
  const double in_unit = in_unit_of(one.rate, output.rate_dps);
  if (!fits(one.rate, one.sign ? std::abs(in_unit) : in_unit)) return false;
  return !one.sigma || one.sigma->has_code ||
         fits(*one.sigma, in_unit_of(*one.sigma, output.sigma_dps));
}

can::Frame blank_frame(const OutputLayout& plan) {
  can::Frame frame;
  frame.id = plan.id;
  if (plan.extended) frame.flags |= can::kExtended;
  if (plan.fd) frame.flags |= can::kFd | can::kBitRateSwitch;
  frame.length = plan.bytes;
  frame.data = plan.blank;
  return frame;
}

}  // namespace

LayoutEncoder::LayoutEncoder(const OutputLayout& plan) : plan_(plan), frame_(blank_frame(plan)) {}

bool LayoutEncoder::sends_same_frame(const LayoutEncoder& other) const {
  return other.plan_.id == plan_.id && other.plan_.extended == plan_.extended;
}

void LayoutEncoder::go_on_from(const LayoutEncoder& before) {
  const std::uint32_t modulus = plan_.e2e.counter ? plan_.e2e.counter->modulus : 1;
  counter_ = before.counter_ % modulus;
  next_ = before.next_;
}

const can::Frame* LayoutEncoder::rate(const RateOutput& output, TimePoint stamp) {
  assert(plan_.rates.size() == 1);
  Rates only{};
  only[plan_.rates[0].axis] = &output;
  return rates(only, stamp);
}

const can::Frame* LayoutEncoder::rates(const Rates& rates, TimePoint stamp) {
  bool all_valid = true;
  bool all_in_range = true;
  std::array<bool, kAxes> valid{};
  for (const LayoutRate& one : plan_.rates) {
    const RateOutput* output = rates[one.axis];
    const bool wanted = output != nullptr && output->valid;
    valid[one.axis] = wanted && can_say(one, *output);
    all_valid = all_valid && valid[one.axis];
    all_in_range = all_in_range && valid[one.axis] == wanted;
  }
  if (!all_in_range) ++counts_.out_of_range;
  if (!all_valid && !plan_.can_say_invalid()) {
    ++counts_.withheld;
    return nullptr;
  }
  if (!is_due(stamp)) return nullptr;
  ++counts_.frames;
  if (all_valid) ++counts_.valid;
  for (const LayoutRate& one : plan_.rates)
    put_rate(one, rates[one.axis], valid[one.axis]);
  if (plan_.valid) put_flag(*plan_.valid, all_valid);
  protect();
  return &frame_;
}

// Each frame is due one period after the one before was due, so that the average is right whatever
// the interval of the rates; a rate that is slightly early is used instead of the next one.
bool LayoutEncoder::is_due(TimePoint stamp) {
  if (!plan_.every) return true;
  const Duration period = *plan_.every;
  const Duration early = next_ - stamp;
  // After a silence, or if the clock was set back, start anew.
  const bool begins = early <= -period || early > 2 * period;
  if (!begins && early > std::min(period / kEarlyShare, kEarlyMost)) return false;
  next_ = begins ? stamp + period : std::max(next_ + period, stamp + period / kCloseShare);
  return true;
}

void LayoutEncoder::put_rate(const LayoutRate& one, const RateOutput* output, bool valid) {
  const std::span<std::uint8_t> payload = payload_of(frame_);
  const OutputField& rate = one.rate;
  const double in_unit = valid ? in_unit_of(rate, output->rate_dps) : 0.0;
  if (valid) {
    rate.codec.encode(one.sign ? std::abs(in_unit) : in_unit, payload);
  } else {
    const bool beyond = output != nullptr && output->valid;
    rate.codec.encode_raw(beyond ? rate.beyond_raw : rate.none_raw, payload);
  }
  if (one.sign) {
    // A value rounded to zero has no sign.
    const bool negative = valid && in_unit < 0.0 && rate.codec.decode(payload).raw != 0;
    one.sign->encode_raw(negative ? 1 : 0, payload);
  }
  if (one.sigma) put_sigma(*one.sigma, valid ? output->sigma_dps : kNone, valid);
  if (one.valid) put_flag(*one.valid, valid);
}

void LayoutEncoder::put_flag(const OutputFlag& flag, bool valid) {
  flag.codec.encode_raw(valid ? flag.valid_raw : flag.invalid_raw, payload_of(frame_));
}

// Rounded up; rounded to zero it would claim a rate without error.
void LayoutEncoder::put_sigma(const OutputField& field, double sigma_dps, bool valid) {
  const std::span<std::uint8_t> payload = payload_of(frame_);
  const double in_unit = in_unit_of(field, sigma_dps);
  if (!valid || !fits(field, in_unit)) return field.codec.encode_raw(field.none_raw, payload);
  const double step = field.step / std::abs(field.scale);
  const double at_least = std::max(in_unit, step);
  field.codec.encode(at_least, payload);
  if (field.codec.decode(payload).value < at_least - kRoundingSlack_steps * step)
    field.codec.encode(at_least + step, payload);
}

void LayoutEncoder::protect() {
  const std::span<std::uint8_t> payload = payload_of(frame_);
  if (plan_.e2e.counter) {
    plan_.e2e.counter->codec.encode_raw(counter_, payload);
    counter_ = counter_ + 1 >= plan_.e2e.counter->modulus ? 0 : counter_ + 1;
  }
  if (plan_.e2e.crc) plan_.e2e.crc->protection.seal(payload);
}

// --- all layouts ---------------------------------------------------------------------------------

LayoutSet::LayoutSet(const OutputPlan& plan)
    : layouts_(plan.layouts.begin(), plan.layouts.end()),
      bus_(plan.bus),
      any_of_several_(
          std::any_of(plan.layouts.begin(), plan.layouts.end(),
                      [](const OutputLayout& layout) { return layout.rates.size() > 1; })) {
  assert(layouts_.size() <= kOutputLayoutsMost);
}

void LayoutSet::take(std::size_t axis, const RateOutput& output, TimePoint stamp, FrameSink& sink) {
  for (LayoutEncoder& layout : layouts_) {
    const std::vector<LayoutRate>& rates = layout.plan().rates;
    if (rates.size() == 1 && rates[0].axis == axis)
      put(layout, layout.rate(output, stamp), stamp, sink);
  }
  if (!any_of_several_) return;
  begin_round(output.instant);
  // The axes still missing have missed their turn.
  if (newest_[axis].fresh) send_all_axes(stamp, sink);
  newest_[axis] = {.output = output, .there = true, .fresh = true};
  newest_instant_ = output.instant;
}

// Axes in messages of their own come in bunches. A pause much longer than the one before the bunch
// being gathered begins another bunch.
void LayoutSet::begin_round(TimePoint instant) {
  const Duration pause = span(newest_instant_, instant);
  const bool gathering =
      std::any_of(newest_.begin(), newest_.end(), [](const Newest& one) { return one.fresh; });
  if (gathering && pause / kLongerPause <= pause_before_) return;
  for (Newest& one : newest_)
    one.fresh = false;
  pause_before_ = std::max(pause, Duration::zero());
}

void LayoutSet::settle(TimePoint stamp, FrameSink& sink) {
  if (!any_of_several_) return;
  const bool any_fresh =
      std::any_of(newest_.begin(), newest_.end(), [](const Newest& one) { return one.fresh; });
  const bool all_fresh = std::all_of(newest_.begin(), newest_.end(),
                                     [&](const Newest& one) { return one.fresh || !speaks(one); });
  if (any_fresh && all_fresh) send_all_axes(stamp, sink);
}

// After a clock was set back, rates may be left that lie in the future.
bool LayoutSet::speaks(const Newest& one) const {
  if (!one.there) return false;
  const Duration apart = span(one.output.instant, newest_instant_);
  return apart <= kApartMost && apart >= -kApartMost;
}

void LayoutSet::send_all_axes(TimePoint stamp, FrameSink& sink) {
  LayoutEncoder::Rates rates{};
  for (std::size_t axis = 0; axis < kAxes; ++axis) {
    rates[axis] = speaks(newest_[axis]) ? &newest_[axis].output : nullptr;
    newest_[axis].fresh = false;
  }
  for (LayoutEncoder& layout : layouts_) {
    if (layout.plan().rates.size() > 1) put(layout, layout.rates(rates, stamp), stamp, sink);
  }
}

void LayoutSet::put(const LayoutEncoder& layout, const can::Frame* frame, TimePoint stamp,
                    FrameSink& sink) const {
  if (frame == nullptr) return;
  if (layout.plan().bus == bus_) {
    sink.put(*frame, stamp);
  } else {
    sink.put_on(layout.plan().bus, *frame, stamp);
  }
}

// One identifier may be sent on several buses: the first continues from the first, and so on.
const LayoutEncoder* LayoutSet::predecessor(std::size_t index, const LayoutSet& before) const {
  const LayoutEncoder& layout = layouts_[index];
  const auto is_same = [&](const LayoutEncoder& other) { return layout.sends_same_frame(other); };
  auto left = std::count_if(layouts_.begin(), layouts_.begin() + static_cast<std::ptrdiff_t>(index),
                            is_same);
  for (const LayoutEncoder& other : before.layouts_) {
    if (is_same(other) && left-- == 0) return &other;
  }
  return nullptr;
}

void LayoutSet::count_on_from(const LayoutSet& before) {
  for (std::size_t i = 0; i < layouts_.size(); ++i) {
    if (const LayoutEncoder* other = predecessor(i, before)) layouts_[i].go_on_from(*other);
  }
}

void LayoutSet::change_plan(const OutputPlan& plan) {
  LayoutSet changed(plan);
  changed.count_on_from(*this);
  for (std::size_t i = 0; i < changed.layouts_.size(); ++i) {
    if (const LayoutEncoder* other = changed.predecessor(i, *this))
      changed.layouts_[i].take_books_of(*other);
  }
  changed.newest_ = newest_;
  changed.newest_instant_ = newest_instant_;
  changed.pause_before_ = pause_before_;
  *this = std::move(changed);
}

void LayoutSet::tell(Status& status) const {
  status.layouts_out = {};
  for (std::size_t i = 0; i < layouts_.size(); ++i)
    status.layouts_out[i] = layouts_[i].counts();
}

}  // namespace vgyro::gateway

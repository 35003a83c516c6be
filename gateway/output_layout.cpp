#include "gateway/output_layout.h"

#include <algorithm>
#include <cmath>
#include <span>

namespace vgyro::gateway {

namespace {

// Sensors that speak as often as frames are wanted are now and then a little early: arbitration on
// a bus delays a frame by one or two others, some 0.1 to 2 ms.
constexpr Duration kEarlyMost = std::chrono::milliseconds(2);
constexpr Duration::rep kEarlyShare = 4;  // of the period, where that is shorter
// Frames that came late are made up for, but not in heaps.
constexpr Duration::rep kCloseShare = 2;
constexpr double kRoundingSlack_steps = 1e-6;

std::span<std::uint8_t> payload_of(can::Frame& frame) {
  return {frame.data.data(), frame.length};
}

double in_unit_of(const OutputField& field, double value) {
  return (value - field.shift) / field.scale;
}

// False for NaN too.
bool fits(const OutputField& field, double in_unit) {
  return in_unit >= field.minimum && in_unit <= field.maximum;
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
  const bool in_range = can_say(output);
  const bool valid = output.valid && in_range;
  if (output.valid && !in_range) ++counts_.out_of_range;
  if (!valid && !plan_.can_say_invalid()) {
    ++counts_.withheld;
    return nullptr;
  }
  if (!is_due(stamp)) return nullptr;
  ++counts_.frames;
  if (valid) ++counts_.valid;
  put_rate(output, valid);
  protect();
  return &frame_;
}

bool LayoutEncoder::can_say(const RateOutput& output) const {
  const double in_unit = in_unit_of(plan_.rate, output.rate_dps);
  if (!fits(plan_.rate, plan_.sign ? std::abs(in_unit) : in_unit)) return false;
  return !plan_.sigma || plan_.sigma->has_code ||
         fits(*plan_.sigma, in_unit_of(*plan_.sigma, output.sigma_dps));
}

// Each frame a period after the last one was due, so that the average is right whatever the rates'
// own distance is; and a rate that is a little early need not wait for its successor.
bool LayoutEncoder::is_due(TimePoint stamp) {
  if (!plan_.every) return true;
  const Duration period = *plan_.every;
  const Duration early = next_ - stamp;
  // After a silence, or where the clock was set back, it begins anew.
  const bool begins = early <= -period || early > 2 * period;
  if (!begins && early > std::min(period / kEarlyShare, kEarlyMost)) return false;
  next_ = begins ? stamp + period : std::max(next_ + period, stamp + period / kCloseShare);
  return true;
}

void LayoutEncoder::put_rate(const RateOutput& output, bool valid) {
  const std::span<std::uint8_t> payload = payload_of(frame_);
  const OutputField& rate = plan_.rate;
  const double in_unit = in_unit_of(rate, output.rate_dps);
  if (valid) {
    rate.codec.encode(plan_.sign ? std::abs(in_unit) : in_unit, payload);
  } else {
    rate.codec.encode_raw(output.valid ? rate.beyond_raw : rate.none_raw, payload);
  }
  if (plan_.sign) {
    // What is rounded to zero has no sign.
    const bool negative = valid && in_unit < 0.0 && rate.codec.decode(payload).raw != 0;
    plan_.sign->encode_raw(negative ? 1 : 0, payload);
  }
  if (plan_.sigma) put_sigma(*plan_.sigma, output.sigma_dps, valid);
  if (plan_.valid) {
    plan_.valid->codec.encode_raw(valid ? plan_.valid->valid_raw : plan_.valid->invalid_raw,
                                  payload);
  }
}

// Rounded up: rounded to zero it would claim a rate without error.
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

}  // namespace vgyro::gateway

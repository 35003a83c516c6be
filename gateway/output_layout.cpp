#include "gateway/output_layout.h"

#include <algorithm>
#include <cmath>
#include <span>

namespace vgyro::gateway {

namespace {

std::span<std::uint8_t> payload_of(can::Frame& frame) {
  return {frame.data.data(), frame.length};
}

double in_unit_of(const OutputField& field, double value) {
  return (value - field.shift) / field.scale;
}

// False for NaN too.
bool can_say(const OutputField& field, double in_unit) {
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
  double in_unit = in_unit_of(plan_.rate, output.rate_dps);
  if (plan_.sign) in_unit = std::abs(in_unit);
  const bool in_range = can_say(plan_.rate, in_unit);
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

// On a grid of time, as VG_Bias is: of samples that are a little faster or slower than the frames
// that are wanted, each frame has the first at or after its point of the grid.
bool LayoutEncoder::is_due(TimePoint stamp) {
  if (!plan_.every) return true;
  const std::int64_t period = plan_.every->count();
  const bool clock_set_back = next_ - stamp > *plan_.every;
  if (stamp < next_ && !clock_set_back) return false;
  next_ = TimePoint{Duration{to_ns(stamp) / period * period + period}};
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
  if (plan_.sigma) {
    const double sigma = in_unit_of(*plan_.sigma, output.sigma_dps);
    if (valid && can_say(*plan_.sigma, sigma)) {
      // Rounded to zero it would claim a rate without error.
      const double step = plan_.sigma->step / std::abs(plan_.sigma->scale);
      plan_.sigma->codec.encode(std::max(sigma, step), payload);
    } else {
      plan_.sigma->codec.encode_raw(plan_.sigma->none_raw, payload);
    }
  }
  if (plan_.valid) {
    plan_.valid->codec.encode_raw(valid ? plan_.valid->valid_raw : plan_.valid->invalid_raw,
                                  payload);
  }
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

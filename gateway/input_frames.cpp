#include "gateway/input_frames.h"

#include <algorithm>
#include <array>
#include <cmath>

#include <fmt/core.h>

#include "gateway/gyro_input.h"

namespace vgyro::gateway {

namespace {

std::span<std::uint8_t> payload_of(can::Frame& frame) {
  return {frame.data.data(), frame.length};
}

double in_unit_of(const Quantity& quantity, double value) {
  return (value - quantity.shift) / quantity.scale;
}

}  // namespace

can::Frame empty_frame(const FrameMatch& match) {
  can::Frame frame;
  frame.id = match.id;
  if (match.extended) frame.flags |= can::kExtended;
  if (match.bytes > can::kClassicBytesMax) frame.flags |= can::kFd;
  frame.length = static_cast<std::uint8_t>(can::fd_padded_length(match.bytes));
  return frame;
}

// Tries the present bits, then the value compared with, its neighbours, and the ends of the
// signal's range.
bool put_valid(const ValidCondition& condition, std::span<std::uint8_t> payload) {
  const dbc::SignalCodec& codec = condition.codec;
  const auto fulfilled = [&] { return holds(condition, codec.decode(payload).value); };
  for (const double value : {condition.value, condition.value + 1.0, condition.value - 1.0,
                             codec.representable_max(), codec.representable_min()}) {
    if (fulfilled()) return true;
    codec.encode(value, payload);
  }
  return fulfilled();
}

void put_quantity(const Quantity& quantity, double value, can::Frame& frame) {
  quantity.presence.arrange(payload_of(frame));
  double there = in_unit_of(quantity, value);
  // Too large a value must not become a code that means "not available".
  if (!quantity.codes.empty())
    there = std::clamp(there, quantity.sendable_lowest(), quantity.sendable_highest());
  quantity.codec.encode(there, payload_of(frame));
}

void put_gyro(const GyroPlan& plan, double rate_dps, std::uint64_t count, can::Frame& frame) {
  const auto payload = payload_of(frame);
  if (plan.valid) put_valid(*plan.valid, payload);
  put_counter(plan.e2e, count, frame);
  if (!plan.sign) {
    put_quantity(plan.rate, rate_dps, frame);
    return;
  }
  const bool negative = in_unit_of(plan.rate, rate_dps) < in_unit_of(plan.rate, 0.0);
  put_quantity(plan.rate, negative ? -rate_dps : rate_dps, frame);
  plan.sign->encode_raw(negative ? 1 : 0, payload);
}

void put_counter(const E2ePlan& e2e, std::uint64_t count, can::Frame& frame) {
  if (e2e.counter) e2e.counter->codec.encode_raw(count % e2e.counter->modulus, payload_of(frame));
}

void seal(const E2ePlan& e2e, can::Frame& frame) {
  if (e2e.crc) e2e.crc->protection.seal(payload_of(frame));
}

bool carries(const GyroPlan& plan, const Quantity& beside, const can::Frame& frame) {
  const dbc::Presence& page = beside.presence;
  return page.always() || plan.rate.presence.always() || page.holds(frame.payload());
}

double carried_dps(const GyroPlan& plan) {
  const double low = plan.rate.sendable_lowest() * plan.rate.scale + plan.rate.shift;
  const double high = plan.rate.sendable_highest() * plan.rate.scale + plan.rate.shift;
  if (plan.sign) return std::max(std::abs(low), std::abs(high));
  return std::min(std::abs(low), std::abs(high));
}

Expected<void> check_valid(const GyroPlan& plan) {
  if (!plan.valid) return {};
  can::Frame frame = empty_frame(plan.match);
  if (put_valid(*plan.valid, payload_of(frame))) return {};
  return fail("gyro " + plan.name,
              fmt::format("no value of the signal fulfils valid = \"{}\"", plan.valid->text));
}

}  // namespace vgyro::gateway

#include "gateway/gyro_input.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace vgyro::gateway {

namespace {

std::size_t bytes_of(const GyroPlan& plan) {
  std::size_t bytes = plan.rate.codec.bytes_needed();
  if (plan.sign) bytes = std::max(bytes, plan.sign->bytes_needed());
  const bool same_page = plan.temperature && plan.temperature->presence.always();
  if (same_page) bytes = std::max(bytes, plan.temperature->codec.bytes_needed());
  if (plan.counter) bytes = std::max(bytes, plan.counter->codec.bytes_needed());
  if (plan.valid) bytes = std::max(bytes, plan.valid->codec.bytes_needed());
  return bytes;
}

bool holds(const Condition& condition, double value) {
  switch (condition.comparison) {
    case Comparison::kEqual:
      return value == condition.value;
    case Comparison::kNotEqual:
      return value != condition.value;
    case Comparison::kLess:
      return value < condition.value;
    case Comparison::kLessEqual:
      return value <= condition.value;
    case Comparison::kGreater:
      return value > condition.value;
    case Comparison::kGreaterEqual:
      return value >= condition.value;
  }
  return false;
}

}  // namespace

std::optional<Reject> decode_quantity(const Quantity& quantity, const can::Frame& frame,
                                      double& value) {
  if (!frame.is_data()) return Reject::kNotData;
  if (!quantity.presence.holds(frame.payload())) return Reject::kOtherPage;
  if (!quantity.codec.fits(frame.length)) return Reject::kTruncated;
  const double raw = quantity.codec.decode(frame.payload()).value;
  if (!std::isfinite(raw)) return Reject::kNotFinite;
  if (raw < quantity.minimum || raw > quantity.maximum) return Reject::kOutOfRange;
  value = raw * quantity.scale + quantity.shift;
  return std::nullopt;
}

GyroInput::GyroInput(const GyroPlan& plan)
    : plan_(plan),
      bytes_needed_(bytes_of(plan)),
      temperature_c_(std::numeric_limits<double>::quiet_NaN()) {}

bool GyroInput::count(std::span<const std::uint8_t> payload, std::uint32_t& missing) {
  const auto raw = static_cast<std::uint64_t>(plan_.counter->codec.decode(payload).raw);
  const auto now = static_cast<std::uint32_t>(raw % plan_.counter->modulus);
  const std::uint32_t step = (now + plan_.counter->modulus - counter_) % plan_.counter->modulus;
  const bool known = counter_known_;
  counter_ = now;
  counter_known_ = true;
  if (!known) return true;
  missing = step == 0 ? 0 : step - 1;
  return step != 0;
}

GyroInput::Result GyroInput::decode(const can::Frame& frame) {
  Result result;
  if (!frame.is_data()) {
    result.reject = Reject::kNotData;
    return result;
  }
  const auto payload = frame.payload();
  if (!plan_.rate.presence.holds(payload)) {
    result.reject = Reject::kOtherPage;
    return result;
  }
  if (frame.length < bytes_needed_) {
    result.reject = Reject::kTruncated;
    return result;
  }
  if (plan_.counter && !count(payload, result.missing)) {
    result.reject = Reject::kCounterRepeated;
    return result;
  }
  if (plan_.valid && !holds(*plan_.valid, plan_.valid->codec.decode(payload).value)) {
    result.reject = Reject::kFlaggedInvalid;
    return result;
  }
  result.reject = decode_quantity(plan_.rate, frame, result.rate_dps);
  if (result.reject) return result;
  if (plan_.sign && plan_.sign->decode(payload).raw != 0) result.rate_dps = -result.rate_dps;
  if (plan_.temperature) {
    double temperature_c = 0.0;
    if (!decode_quantity(*plan_.temperature, frame, temperature_c)) temperature_c_ = temperature_c;
  }
  return result;
}

}  // namespace vgyro::gateway

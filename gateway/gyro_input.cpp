#include "gateway/gyro_input.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace vgyro::gateway {

namespace {

std::size_t bytes_of(const GyroPlan& plan) {
  std::size_t bytes = plan.rate.codec.bytes_needed();
  if (plan.sign) bytes = std::max(bytes, plan.sign->bytes_needed());
  for (const std::optional<Quantity> GyroPlan::*beside : kBesides) {
    const std::optional<Quantity>& quantity = plan.*beside;
    const bool same_page = quantity && quantity->presence.always();
    if (same_page) bytes = std::max(bytes, quantity->codec.bytes_needed());
  }
  if (plan.e2e.counter) bytes = std::max(bytes, plan.e2e.counter->codec.bytes_needed());
  if (plan.valid) bytes = std::max(bytes, plan.valid->codec.bytes_needed());
  return bytes;
}

// Precondition: the frame carries the signal and is long enough for it.
inline std::optional<Reject> convert(const Quantity& quantity,
                                     std::span<const std::uint8_t> payload, double& value) {
  const dbc::Reading reading = quantity.codec.decode(payload);
  value = reading.value * quantity.scale + quantity.shift;
  if (reading.value >= quantity.minimum && reading.value <= quantity.maximum) return std::nullopt;
  if (quantity.codes_in_range && quantity.codes.contains(reading.raw)) {
    return Reject::kNoMeasurement;
  }
  return std::isfinite(reading.value) ? Reject::kOutOfRange : Reject::kNotFinite;
}

}  // namespace

bool holds(const ValidCondition& condition, double value) {
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

std::optional<Reject> decode_quantity(const Quantity& quantity, const can::Frame& frame,
                                      double& value) {
  if (!frame.is_data()) return Reject::kNotData;
  if (!quantity.presence.always() && !quantity.presence.holds(frame.payload())) {
    return Reject::kOtherPage;
  }
  if (!quantity.codec.fits(frame.length)) return Reject::kTruncated;
  return convert(quantity, frame.payload(), value);
}

GyroInput::GyroInput(const GyroPlan& plan)
    : plan_(plan),
      bytes_needed_(bytes_of(plan)),
      temperature_(plan.temperature),
      supply_voltage_(plan.supply_voltage),
      other_axes_{Beside(plan.rate_x), Beside(plan.rate_y), Beside(plan.rate_z)},
      has_other_axes_(plan.rate_x || plan.rate_y || plan.rate_z),
      e2e_(plan.e2e) {}

void Beside::keep(const can::Frame& frame) {
  const std::optional<Reject> reject = decode_quantity(*quantity_, frame, value_);
  if (reject && reject != Reject::kOtherPage) value_ = std::numeric_limits<double>::quiet_NaN();
}

void GyroInput::keep_besides(const can::Frame& frame) {
  if (temperature_.wanted()) temperature_.keep(frame);
  if (supply_voltage_.wanted()) supply_voltage_.keep(frame);
  if (!has_other_axes_) return;
  for (Beside& axis : other_axes_) {
    if (axis.wanted()) axis.keep(frame);
  }
}

void GyroInput::decode(const can::Frame& frame, Result& result) {
  result.reject = e2e_.verify(frame);
  if (result.reject) return;
  const auto payload = frame.payload();
  if (!plan_.rate.presence.always() && !plan_.rate.presence.holds(payload)) {
    keep_besides(frame);
    (void)e2e_.count(payload, result.missing, E2eCheck::Page::kOther);
    result.reject = Reject::kOtherPage;
    return;
  }
  if (frame.length < bytes_needed_) {
    result.reject = Reject::kTruncated;
    return;
  }
  result.reject = e2e_.count(payload, result.missing);
  if (result.reject) return;
  if (plan_.valid && !holds(*plan_.valid, plan_.valid->codec.decode(payload).value)) {
    result.reject = Reject::kFlaggedInvalid;
    return;
  }
  result.reject = convert(plan_.rate, payload, result.rate_dps);
  if (result.reject) return;
  if (plan_.sign && plan_.sign->decode(payload).raw != 0) result.rate_dps = -result.rate_dps;
  keep_besides(frame);
}

}  // namespace vgyro::gateway

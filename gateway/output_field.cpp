#include "gateway/output_field.h"

#include <algorithm>
#include <array>
#include <cmath>

#include <fmt/core.h>

namespace vgyro::gateway {

namespace {

// Beyond this, not every whole number is a double, and a step is none.
constexpr unsigned kBitsMost = 53;
// The ends of a range are written in decimals, which differ from the raw value by rounding.
constexpr double kRangeSlack_steps = 1e-6;

struct RawRange {
  std::int64_t low = 0;
  std::int64_t high = 0;
};

std::uint64_t bits_of(const dbc::Signal& signal, std::int64_t raw) {
  return static_cast<std::uint64_t>(raw) & (~std::uint64_t{0} >> (64U - signal.length_bits));
}

RawRange type_range(const dbc::SignalCodec& codec) {
  const std::int64_t low = codec.raw_min();
  return {low, low + static_cast<std::int64_t>(codec.raw_mask())};
}

// The raw values whose physical values lie inside the accepted range of the signal.
RawRange inside(const dbc::Signal& signal, const Quantity& quantity, RawRange range) {
  double low = (quantity.minimum - signal.offset) / signal.factor;
  double high = (quantity.maximum - signal.offset) / signal.factor;
  if (low > high) std::swap(low, high);
  low = std::ceil(low - kRangeSlack_steps);
  high = std::floor(high + kRangeSlack_steps);
  if (low > static_cast<double>(range.low)) range.low = static_cast<std::int64_t>(low);
  if (high < static_cast<double>(range.high)) range.high = static_cast<std::int64_t>(high);
  return range;
}

// Codes at the ends of the range are not values.
RawRange without_codes(const dbc::Signal& signal, dbc::CodeRules rules, RawRange range) {
  const dbc::Codes codes = dbc::codes_of(signal, rules);
  const auto is_code = [&](std::int64_t raw) {
    return codes.contains(raw) || dbc::labelled_no_value(signal, raw);
  };
  if (!codes.empty() && range.high >= static_cast<std::int64_t>(codes.first))
    range.high = static_cast<std::int64_t>(codes.first) - 1;
  while (range.low <= range.high && is_code(range.high))
    --range.high;
  while (range.low <= range.high && is_code(range.low))
    ++range.low;
  return range;
}

std::string hex(const dbc::Signal& signal, std::uint64_t raw) {
  return fmt::format("0x{:0{}X}", raw, (signal.length_bits + 3) / 4);
}

// The bit pattern that the configuration names as a code; removes it from the range of values.
Expected<std::uint64_t> code_in(const dbc::Signal& signal, const Quantity& quantity,
                                std::int64_t raw, RawRange& range) {
  const RawRange all = type_range(quantity.codec);
  // People also write the unsigned bit pattern of a negative number.
  const std::int64_t patterns = all.high - all.low + 1;
  const std::int64_t code = raw > all.high && raw < patterns ? raw - patterns : raw;
  if (code < all.low || code > all.high)
    return fail({}, fmt::format("{} has no raw value {:#x}", signal.name, raw));
  if (code > range.low && code < range.high) {
    return fail({},
                fmt::format("raw value {:#x} of {} is {:g} {}: it would be read as a measurement",
                            raw, signal.name, quantity.codec.value_of(code), quantity.unit),
                "a raw value at an end of the signal's range, or outside of it");
  }
  if (code == range.high) --range.high;
  if (code == range.low) ++range.low;
  return bits_of(signal, code);
}

// NMEA 2000 has a separate code for "out of range".
std::uint64_t beyond_of(const dbc::Signal& signal, dbc::CodeRules rules, std::uint64_t none_raw) {
  const dbc::Codes codes = dbc::codes_of(signal, rules);
  const bool has_own = rules == dbc::CodeRules::kNmea2000 && !codes.empty() &&
                       codes.last > codes.first && none_raw == codes.last;
  return has_own ? codes.last - 1 : none_raw;
}

// The value of a signal without codes while another signal marks it as not valid. NaN would poison
// a receiver that does not expect it.
std::uint64_t raw_of_zero(const OutputField& field) {
  std::array<std::uint8_t, can::kFdBytesMax> scratch{};
  field.codec.encode(-field.shift / field.scale, scratch);
  return static_cast<std::uint64_t>(field.codec.decode(scratch).raw);
}

OutputField float_field(const Quantity& quantity, OutputField field) {
  field.minimum = std::max(quantity.minimum, quantity.codec.representable_min());
  field.maximum = std::min(quantity.maximum, quantity.codec.representable_max());
  field.none_raw = field.beyond_raw = raw_of_zero(field);
  return field;
}

}  // namespace

Expected<OutputField> output_field(const dbc::Signal& signal, const Quantity& quantity,
                                   dbc::CodeRules rules, std::optional<std::int64_t> none_raw) {
  OutputField field{.name = signal.name,
                    .unit = quantity.unit,
                    .codec = quantity.codec,
                    .scale = quantity.scale,
                    .shift = quantity.shift,
                    .layout = quantity.layout,
                    .step = quantity.step};
  if (!signal.is_integer()) {
    if (none_raw) return fail({}, signal.name + " is a float, which has no codes");
    return float_field(quantity, std::move(field));
  }
  if (signal.length_bits > kBitsMost || signal.factor == 0.0) {
    return fail({},
                fmt::format("{} cannot be sent: {} bits, scale {:g}", signal.name,
                            signal.length_bits, signal.factor),
                fmt::format("at most {} bits, and a scale that is not 0", kBitsMost));
  }
  RawRange range =
      without_codes(signal, rules, inside(signal, quantity, type_range(quantity.codec)));
  if (none_raw) {
    const auto code = code_in(signal, quantity, *none_raw, range);
    if (!code) return tl::unexpected(code.error());
    field.none_raw = field.beyond_raw = *code;
    field.has_code = true;
    field.code = fmt::format("{}, as configured", hex(signal, *code));
  } else if (const auto code = not_available(signal, rules)) {
    field.none_raw = code->raw;
    field.beyond_raw = beyond_of(signal, rules, code->raw);
    field.has_code = true;
    field.code = code->text;
  } else {
    field.none_raw = field.beyond_raw = raw_of_zero(field);
  }
  if (range.low > range.high) return fail({}, signal.name + " can carry no value");
  field.minimum = quantity.codec.value_of(range.low);
  field.maximum = quantity.codec.value_of(range.high);
  if (field.minimum > field.maximum) std::swap(field.minimum, field.maximum);
  return field;
}

std::optional<RawValue> not_available(const dbc::Signal& signal, dbc::CodeRules rules) {
  const dbc::Codes codes = dbc::codes_of(signal, rules);
  if (!codes.empty()) return RawValue{codes.last, hex(signal, codes.last) + ", not available"};
  if (!signal.is_integer() || signal.length_bits == 0 || signal.length_bits > kBitsMost)
    return std::nullopt;
  // Of several labels take the largest: sensors count kinds of error downwards from "not
  // available".
  const dbc::ValueLabel* found = nullptr;
  for (const dbc::ValueLabel& label : signal.labels) {
    if (!dbc::labelled_no_value(signal, label.raw)) continue;
    if (found == nullptr || label.raw > found->raw) found = &label;
  }
  if (found != nullptr) {
    const std::uint64_t raw = bits_of(signal, found->raw);
    return RawValue{raw, fmt::format("{}, \"{}\"", hex(signal, raw), found->text)};
  }
  // J1939 reserves codes in states too: with two bits or more, all bits set is "not available".
  if (rules == dbc::CodeRules::kNone || signal.length_bits < 2) return std::nullopt;
  const std::uint64_t ones = bits_of(signal, -1);
  return RawValue{ones, hex(signal, ones) + ", not available"};
}

RawValue resting_value(const dbc::Signal& signal, dbc::CodeRules rules) {
  if (const auto none = not_available(signal, rules)) return *none;
  const auto start = signal.start_raw.value_or(0.0);
  const bool usable = signal.is_integer() && start == std::trunc(start) && std::abs(start) < 0x1p53;
  if (!usable || start == 0.0) return {0, "0"};
  const std::uint64_t raw = bits_of(signal, static_cast<std::int64_t>(start));
  return {raw, hex(signal, raw) + ", its start value"};
}

}  // namespace vgyro::gateway

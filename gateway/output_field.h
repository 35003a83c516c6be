#pragma once

// What a signal of a foreign message can carry: the range of its values, the bit patterns that mean
// "not available", and its value while unused.

#include <cstdint>
#include <optional>
#include <string>

#include "base/error.h"
#include "dbc/codes.h"
#include "dbc/database.h"
#include "gateway/plan.h"

namespace vgyro::gateway {

/// `quantity` belongs to the same signal; `none_raw` is the code from the configuration, if any.
/// Error, without a place, if that code is also a valid value, or if the signal can carry no value
/// at all.
Expected<OutputField> output_field(const dbc::Signal& signal, const Quantity& quantity,
                                   dbc::CodeRules rules, std::optional<std::int64_t> none_raw = {});

/// A bit pattern and its meaning in words.
struct RawValue {
  std::uint64_t raw = 0;
  std::string text;
};

/// The pattern for "not available", if the file labels a value so or the rules reserve one.
std::optional<RawValue> not_available(const dbc::Signal& signal, dbc::CodeRules rules);

/// The value of an unused signal: not available, or the file's start value, or 0.
RawValue resting_value(const dbc::Signal& signal, dbc::CodeRules rules);

}  // namespace vgyro::gateway

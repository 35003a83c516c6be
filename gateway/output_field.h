#pragma once

// A signal of a foreign message → what it can carry: the range of its values, which of its bit
// patterns mean "not available", and its value while unused.

#include <cstdint>
#include <optional>
#include <string>

#include "base/error.h"
#include "dbc/codes.h"
#include "dbc/database.h"
#include "gateway/plan.h"

namespace vgyro::gateway {

/// `quantity` is of the same signal; `none_raw` is the configuration's own code, where it gives
/// one. Error, without a place, when that code is a value like any other, or when the signal can
/// say no value at all.
Expected<OutputField> output_field(const dbc::Signal& signal, const Quantity& quantity,
                                   dbc::CodeRules rules, std::optional<std::int64_t> none_raw = {});

/// A bit pattern, and in words what it is.
struct RawValue {
  std::uint64_t raw = 0;
  std::string text;
};

/// "Not available", where the file labels a value so or the rules keep one.
std::optional<RawValue> not_available(const dbc::Signal& signal, dbc::CodeRules rules);

/// The value of an unused signal: not available, or the file's start value, or 0.
RawValue resting_value(const dbc::Signal& signal, dbc::CodeRules rules);

}  // namespace vgyro::gateway

#pragma once

// The key `valid` of a table of the configuration: "Status == 0", a comparison on one signal.

#include <optional>
#include <string_view>

#include "base/toml_reader.h"
#include "gateway/plan.h"
#include "gateway/signal_resolver.h"

namespace vgyro::gateway {

struct NamedCondition {
  const dbc::Signal* signal = nullptr;
  ValidCondition condition;
};

/// `main` is the signal that the message is read, or sent, for. Nothing if the key is absent, or
/// after an error.
std::optional<NamedCondition> read_condition(TomlReader& reader, SignalResolver& resolver,
                                             const dbc::Signal& main,
                                             std::string_view key = "valid");

}  // namespace vgyro::gateway

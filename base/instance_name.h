#pragma once

// The name of one of several gateways on a host: vgyrod@front.service is "front". It is part of a
// D-Bus name, of paths and of a metric's label, so it holds only characters that all of these
// allow.

#include <algorithm>
#include <cstddef>
#include <string>
#include <string_view>

#include "base/error.h"

namespace vgyro {

/// The D-Bus name; an instance appends its own name after a dot.
inline constexpr const char* kGatewayBusName = "org.vgyro.Gateway1";

inline std::string bus_name_of(std::string_view instance) {
  const std::string common = kGatewayBusName;
  return instance.empty() ? common : common + '.' + std::string(instance);
}

/// The systemd unit of an instance.
inline std::string unit_of(std::string_view instance) {
  return instance.empty() ? "vgyrod" : "vgyrod@" + std::string(instance);
}

/// The empty name is the gateway without a name.
inline Expected<void> check_instance_name(std::string_view name) {
  constexpr std::size_t kBytesMost = 32;  // a bus name may have 255, but people must read it
  const auto is_letter = [](char c) { return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z'); };
  const auto fits = [&](char c) { return is_letter(c) || (c >= '0' && c <= '9') || c == '_'; };
  const bool good = name.empty() || (name.size() <= kBytesMost && is_letter(name.front()) &&
                                     std::all_of(name.begin(), name.end(), fits));
  if (good) return {};
  return fail({}, "\"" + std::string(name) + "\" is not a name for an instance",
              "a letter, then letters, digits and _; at most 32 in all: vgyrod@front2");
}

}  // namespace vgyro

#pragma once

// Client of the running vgyrod on D-Bus. In cli/, only gateway_client.cpp uses libsystemd.

#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include <nlohmann/json.hpp>

#include "base/error.h"

struct sd_bus;

namespace vgyro::cli {

class GatewayClient {
 public:
  /// Connects to the system bus; error if there is none. `instance`: name of one of several
  /// gateways on the host.
  static Expected<GatewayClient> connect(std::string_view instance = {});

  /// Instance names of the gateways on the bus, sorted; "" is the one without a name, and comes
  /// first.
  Expected<std::vector<std::string>> instances();

  /// All properties of the gateway, with names in snake_case ("RateDps" → "rate_dps"); NaN is null.
  Expected<nlohmann::ordered_json> status();

  Expected<void> recalibrate() { return call("Recalibrate"); }
  Expected<void> save_state() { return call("SaveState"); }
  /// Has the recorded inputs written; returns their folder once they are on the disk.
  Expected<std::string> capture();

 private:
  struct Close {
    void operator()(sd_bus* bus) const;
  };
  GatewayClient(sd_bus* bus, std::string_view instance) : instance_(instance), bus_(bus) {}
  Expected<void> call(const char* method);

  std::string instance_;
  std::unique_ptr<sd_bus, Close> bus_;
};

}  // namespace vgyro::cli

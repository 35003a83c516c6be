#pragma once

// Talks to the running vgyrod over D-Bus; with gateway_client.cpp the only place here that knows
// libsystemd.

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
  /// To the system bus; an error when there is none. `instance`: of several gateways on the host.
  static Expected<GatewayClient> connect(std::string_view instance = {});

  /// The gateways that are on the bus, by the names of their instances, in their order; "" is the
  /// one without a name, and the first.
  Expected<std::vector<std::string>> instances();

  /// All that the gateway reports. Names as on D-Bus, but as in "rate_dps"; NaN is null.
  Expected<nlohmann::ordered_json> status();

  Expected<void> recalibrate() { return call("Recalibrate"); }
  Expected<void> save_state() { return call("SaveState"); }
  /// Has the recorded inputs written; returns the folder when they are on the disk.
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

#pragma once

// Talks to the running vgyrod over D-Bus; with gateway_client.cpp the only place here that knows
// libsystemd.

#include <memory>

#include <nlohmann/json.hpp>

#include "base/error.h"

struct sd_bus;

namespace vgyro::cli {

class GatewayClient {
 public:
  /// To the system bus; an error when there is none.
  static Expected<GatewayClient> connect();

  /// All that the gateway reports. Names as on D-Bus, but as in "rate_dps"; NaN is null.
  Expected<nlohmann::ordered_json> status();

  Expected<void> recalibrate() { return call("Recalibrate"); }
  Expected<void> save_state() { return call("SaveState"); }

 private:
  struct Close {
    void operator()(sd_bus* bus) const;
  };
  explicit GatewayClient(sd_bus* bus) : bus_(bus) {}
  Expected<void> call(const char* method);

  std::unique_ptr<sd_bus, Close> bus_;
};

}  // namespace vgyro::cli

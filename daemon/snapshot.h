#pragma once

// State and counters of the running gateway at one moment, for D-Bus and the metrics.

#include <array>
#include <cstdint>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "daemon/capture_status.h"
#include "daemon/reporter.h"
#include "gateway/plan.h"
#include "gateway/status.h"

namespace vgyro::daemon {

struct Snapshot {
  std::string instance;                 ///< name of one of several gateways on a host, or empty
  const gateway::Plan* plan = nullptr;  ///< valid until the next snapshot
  std::string fingerprint;              ///< of the configuration in use: gateway::fingerprint_of()
  gateway::Status status;
  std::vector<gateway::Status> axes;  ///< on a platform with several, in the order of Plan::axes
  std::array<double, 2> bias_sigma_dps{};     ///< of each gyro; NaN where it is not known
  std::array<double, 2> slope_dps_s{};        ///< of its bias; NaN where it is not known
  std::array<double, 2> slope_sigma_dps_s{};  ///< of the slope; NaN where it is not known
  Traffic traffic;
  double uptime_s = 0.0;
  double last_stop_age_s = std::numeric_limits<double>::quiet_NaN();  ///< NaN: no stop so far
  std::uint64_t log_lines_lost = 0;         ///< lost because nothing read them
  std::uint64_t service_messages_lost = 0;  ///< the service manager did not take them at once
  bool config_refused = false;              ///< by the last reload
  std::optional<CaptureStatus> capture;     ///< nothing: the inputs are not recorded
};

/// "ok", or what is wrong: gateway::Fault in words.
inline std::string health_text(const gateway::GyroStatus& gyro) {
  if (gyro.fault) return std::string(to_string(*gyro.fault));
  return gyro.heard ? "ok" : std::string(to_string(gateway::Fault::kSilent));
}

}  // namespace vgyro::daemon

#pragma once

// Logs what the gateway does, for people: changes of state, the first of each kind of trouble, a
// status line, a summary at the end. Each kind of message has a limit on how often it comes.
// Clock-free: second_passed() is its clock.

#include <array>
#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "can/transmit.h"
#include "daemon/bus_status.h"
#include "daemon/line_budget.h"
#include "daemon/log.h"
#include "gateway/plan.h"
#include "gateway/status.h"

namespace vgyro::daemon {

/// What went through the sockets since the start.
struct Traffic {
  std::vector<BusStatus> buses;
  can::TransmitCounts transmitted;
  std::uint64_t shadowed = 0;  ///< frames that shadow mode kept from the buses

  [[nodiscard]] std::uint64_t received() const;
  [[nodiscard]] std::uint64_t lost() const;
};

class Reporter {
 public:
  Reporter(std::array<std::string, 2> gyro_names, double rest_s, Log& log);

  /// Takes these counts as reported already.
  void start_from(const can::TransmitCounts& transmitted);
  /// Call when the buses were replaced: their counters begin at 0 again.
  void buses_are_new() {
    buses_.clear();
    last_received_ = 0;
  }

  /// Logs a change of state or of a gyro's health. Cheap when there is none.
  void check_state(const gateway::Status& status) {
    if (status.state != state_) state_changed(status);
    if (status.gyros[0].fault != faults_[0]) fault_changed(0, status);
    if (status.gyros[1].fault != faults_[1]) fault_changed(1, status);
    if (status.pair.contradiction != contradiction_) contradiction_changed(status);
    if (status.disagree != disagree_) disagreement_changed(status);
    if (status.ambiguous != ambiguous_) ambiguity_changed(status);
  }

  /// Reports what changed about one axis of a platform with several; each axis keeps its `place`
  /// from call to call.
  void check_axis(std::size_t place, char axis, const gateway::Status& status) {
    AxisTold& told = axes_[place];
    if (status.state != told.state) axis_state_changed(axis, status, told);
    for (std::size_t gyro = 0; gyro < 2; ++gyro) {
      if (status.gyros[gyro].fault != told.faults[gyro])
        axis_fault_changed(axis, gyro, status, told);
    }
  }

  /// To be called about once a second: logs new troubles and returns the status line.
  std::string second_passed(const gateway::Status& status, const Traffic& traffic);

  void summarize(const gateway::Status& status, const Traffic& traffic);

 private:
  static constexpr std::uint64_t kRepeatSeconds = 60;

  /// A counter of troubles, and how much of it has been reported.
  struct Told {
    std::uint64_t count = 0;
    std::uint64_t second = 0;
  };
  struct GyroTold {
    std::array<Told, gateway::kRejectCount> rejected;
    Told missing, unpaired;
    bool waiting = false;
    bool counter = false;
  };
  struct BusTold {
    std::array<Told, can::kErrorCauseCount> errors;
    Told lost;
    Told restamped;
    Told foreign;
  };

  /// What has been reported of one axis.
  struct AxisTold {
    gateway::State state = gateway::State::kWaiting;
    std::array<std::optional<gateway::Fault>, 2> faults;
  };

  void axis_state_changed(char axis, const gateway::Status& status, AxisTold& told);
  void axis_fault_changed(char axis, std::size_t gyro, const gateway::Status& status,
                          AxisTold& told);
  void state_changed(const gateway::Status& status);
  void fault_changed(std::size_t gyro, const gateway::Status& status);
  void contradiction_changed(const gateway::Status& status);
  void disagreement_changed(const gateway::Status& status);
  void ambiguity_changed(const gateway::Status& status);
  std::uint64_t news(Told& told, std::uint64_t count) const;
  void tell_gyro(const std::string& name, const gateway::GyroStatus& gyro, GyroTold& told);
  void tell_waiting(const std::string& name, const gateway::GyroStatus& gyro, GyroTold& told);
  void tell_pipeline(const gateway::Status& status);
  void tell_corrector(const gateway::Status& status);
  void tell_restored(const gateway::Status& status);
  void tell_sent(const can::TransmitCounts& sent);
  void tell_bus(const BusStatus& bus, BusTold& told);
  [[nodiscard]] std::string biases(const gateway::Status& status) const;

  std::array<std::string, 2> names_;
  double rest_s_;
  Log& log_;
  gateway::Restored restored_ = gateway::Restored::kNothing;
  gateway::State state_ = gateway::State::kWaiting;
  LineBudget state_lines_;
  std::array<std::optional<gateway::Fault>, 2> faults_;
  fusion::Contradiction contradiction_ = fusion::Contradiction::kNone;
  bool disagree_ = false;
  bool ambiguous_ = false;
  LineBudget health_lines_;
  std::uint64_t second_ = 0;
  std::array<GyroTold, 2> gyros_;
  std::array<AxisTold, gateway::kAxes> axes_;
  Told clock_steps_, rates_out_of_range_, layouts_out_of_range_, reference_rejected_,
      accelerometer_rejected_, speed_rejected_, windows_skipped_, restarts_, estimate_restarts_;
  Told stale_, overflow_, failed_;
  std::map<std::string, BusTold> buses_;
  bool told_of_motion_ = false;
  bool told_of_stretches_ = false;
  bool told_of_far_rates_ = false;
  std::uint64_t last_received_ = 0;
  std::uint64_t last_sent_ = 0;
};

}  // namespace vgyro::daemon

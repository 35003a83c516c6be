#pragma once

// The gateway on the system bus: the name org.vgyro.Gateway1 (org.vgyro.Gateway1.NAME for one of
// several gateways) with the interface org.vgyro.Gateway1 at /org/vgyro/Gateway1. It has properties
// to read and watch, and methods that the policy file allows to root alone. The gateway runs
// without D-Bus too: Control tries to connect every few seconds, and never waits for an answer.

#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <systemd/sd-bus.h>

#include "base/error.h"
#include "daemon/log.h"
#include "daemon/snapshot.h"

namespace vgyro::daemon {

class Control {
 public:
  struct Gateway {
    std::function<const Snapshot&()> snapshot;
    std::function<void()> recalibrate;
    std::function<Expected<void>()> save_state;
    /// Has the recorded inputs written; `answer` receives the folder, or the error.
    std::function<Expected<void>(std::function<void(const Expected<std::string>&)> answer)> capture;
  };

  /// Serves the bus under the name `bus_name`, in the event loop `events`, which must outlive this.
  Control(sd_event* events, Gateway gateway, std::string bus_name, Log& log);
  Control(const Control&) = delete;
  Control& operator=(const Control&) = delete;
  ~Control();

  /// To be called about once a second: connects if there is no bus, and emits changes, which are
  /// sent no more often than that.
  void second_passed();

 private:
  static constexpr int kRetrySeconds = 5;
  // Limits the daemon's memory while the bus takes no messages.
  static constexpr std::uint64_t kQueuedMost = 64;

  void connect();
  void disconnect(int error);
  void tell_changes();

  static int on_get(sd_bus* bus, const char* path, const char* interface, const char* property,
                    sd_bus_message* reply, void* self, sd_bus_error* error);
  static int on_recalibrate(sd_bus_message* call, void* self, sd_bus_error* error);
  static int on_save_state(sd_bus_message* call, void* self, sd_bus_error* error);
  static int on_capture(sd_bus_message* call, void* self, sd_bus_error* error);
  static int on_name(sd_bus_message* reply, void* self, sd_bus_error* error);
  static const sd_bus_vtable kInterface[];

  sd_event* events_;
  Gateway gateway_;
  std::string bus_name_;
  Log& log_;
  sd_bus* bus_ = nullptr;
  int wait_ = 0;  ///< seconds to the next attempt
  bool told_of_failure_ = false;
  bool has_name_ = false;
};

}  // namespace vgyro::daemon

#pragma once

// The gateway on D-Bus: org.vgyro.Gateway1, or org.vgyro.Gateway1.NAME of one of several, with the
// interface org.vgyro.Gateway1 at /org/vgyro/Gateway1 of the system bus: properties to read and
// watch, and methods that the policy file gives to root alone. The gateway runs without a bus too:
// it is tried again every few seconds, and nothing here waits for an answer.

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
    /// Has the recorded inputs written; the answer is the folder, or why there is none.
    std::function<Expected<void>(std::function<void(const Expected<std::string>&)> answer)> capture;
  };

  /// Serves its bus within `events`, which must outlive it, under the name `bus_name`.
  Control(sd_event* events, Gateway gateway, std::string bus_name, Log& log);
  Control(const Control&) = delete;
  Control& operator=(const Control&) = delete;
  ~Control();

  /// To be called about once a second: looks for a bus where there is none, and reports changes,
  /// at most this often.
  void second_passed();

 private:
  static constexpr int kRetrySeconds = 5;
  // A bus that takes nothing must not make the daemon grow.
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

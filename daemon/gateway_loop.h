#pragma once

// Drives the pipeline live: gives it the frames of all buses in the order of their stamps, and the
// time when no frame comes, and puts its output frames into the transmit queues. sd-event serves
// the slow work (signals, the status of each second); frames bypass it, straight from epoll.
// Nothing on the frame path allocates.

#include <memory>
#include <optional>
#include <span>
#include <string>
#include <sys/epoll.h>
#include <systemd/sd-event.h>
#include <vector>

#include "base/error.h"
#include "can/transmit.h"
#include "daemon/bus.h"
#include "daemon/capture.h"
#include "daemon/control.h"
#include "daemon/deadline_timer.h"
#include "daemon/host_time.h"
#include "daemon/log.h"
#include "daemon/metrics.h"
#include "daemon/outlets.h"
#include "daemon/plan_loader.h"
#include "daemon/reporter.h"
#include "daemon/service.h"
#include "daemon/snapshot.h"
#include "daemon/state_keeper.h"
#include "daemon/stop_age.h"
#include "gateway/config.h"
#include "gateway/inheritance.h"
#include "gateway/pipeline.h"
#include "gateway/plan.h"

namespace vgyro::daemon {

/// What the loop serves besides the rates; null: not wanted.
struct Companions {
  StateKeeper* keeper = nullptr;  ///< keeps the biases across a restart
  MetricsFile* metrics = nullptr;
  Capture* capture = nullptr;
};

class GatewayLoop final : private gateway::FrameSink {
 public:
  /// `load` reads the configuration again, in a thread of its own. `instance` is the name of one of
  /// several gateways, or empty.
  GatewayLoop(LoadedConfig config, LoadPlan load, std::string instance, Companions companions,
              Log& log);
  GatewayLoop(const GatewayLoop&) = delete;
  GatewayLoop& operator=(const GatewayLoop&) = delete;
  ~GatewayLoop() override;

  /// Binds the sockets, takes up the saved state and catches signals; an error says what the user
  /// can do. A missing interface is no error: the loop waits for it.
  Expected<void> start();

  /// Runs until SIGTERM or SIGINT. SIGHUP reads the configuration again, SIGUSR1 toggles debug
  /// messages.
  Expected<void> run();

 private:
  using EventPointer = std::unique_ptr<sd_event, decltype(&sd_event_unref)>;

  /// Everything made from one configuration; replaced as a whole.
  struct Setup {
    Setup(gateway::Plan the_plan, TurnClock& clock, Log& log);
    gateway::Plan plan;
    std::unique_ptr<Reporter> reporter;
    gateway::Pipeline pipeline;
    std::vector<Bus> buses;
    Outlets outlets;
  };

  void put(const can::Frame& frame, TimePoint stamp) override;
  void put_on(can::BusIndex bus, const can::Frame& frame, TimePoint stamp) override;

  void take_up_state();
  Expected<void> start_events();
  static Expected<void> open_buses(Setup& setup);
  static Expected<void> check_output(const Setup& setup);
  static Expected<void> check_fd(const Bus& output, const std::string& wanted);
  void tell_of_shadow(const gateway::OutputPlan& output);
  Expected<void> poll_buses();
  bool poll_bus(std::size_t index);
  [[nodiscard]] bool poll_readable(int fd, std::uint32_t tag) const;
  Expected<void> serve_events(bool armed);
  Expected<void> turn(std::span<const epoll_event> ready);
  TimePoint pipeline_now();
  void look_at_time();
  void set_alarm();
  bool is_timely(TimePoint stamp);
  void hand_on_arrivals();
  Bus* earliest(Arrival& arrival);
  void flush();
  void poll_writable(std::size_t bus);
  void look_at_status();
  void second_passed();
  void reopen_dead_buses();
  void look_whether_output_fits();
  void begin_reload();
  Expected<void> take_reloaded();
  Expected<void> do_what_was_asked();
  void recalibrate();
  std::optional<gateway::SavedState> memory();
  Expected<void> save_state();
  Expected<void> ask_for_capture(Capture::Answer answer);
  /// `keep`: the new pipeline continues with what was learned, if the gyros are the same.
  Expected<void> replace_setup(gateway::Plan plan, bool keep);
  Expected<void> try_to_replace_setup(gateway::Plan plan, bool keep);
  std::string hand_over(Setup& next);
  std::string begin_anew(Setup& next);
  const Snapshot& snapshot();
  [[nodiscard]] Traffic traffic() const;
  [[nodiscard]] bool all_drained() const;
  [[nodiscard]] std::string status_line();
  [[nodiscard]] std::string full_status_line();

  static int on_stop(sd_event_source* source, const struct signalfd_siginfo* info, void* self);
  static int on_hangup(sd_event_source* source, const struct signalfd_siginfo* info, void* self);
  static int on_debug(sd_event_source* source, const struct signalfd_siginfo* info, void* self);
  static int on_second(sd_event_source* source, std::uint64_t usec, void* self);
  static int on_watchdog(sd_event_source* source, std::uint64_t usec, void* self);

  PlanLoader loader_;
  StateKeeper* keeper_;
  gateway::Inheritance inheritance_;  ///< what an earlier setup had learned
  MetricsFile* metrics_;
  Capture* capture_;
  Log& log_;
  Notifier notifier_;
  TurnClock clock_;
  std::unique_ptr<Setup> setup_;
  EventPointer events_{nullptr, &sd_event_unref};
  std::optional<Control> control_;
  Snapshot snapshot_;
  StopAge stop_age_;
  int epoll_fd_ = -1;
  DeadlineTimer timer_;
  Alarm alarm_;
  bool rang_ = true;          ///< the timer went off in this turn
  TimePoint newest_stamp_;    ///< of the frame handed on last
  bool has_spoken_ = false;   ///< a frame went out in this turn
  std::uint64_t spoken_ = 0;  ///< Pipeline::spoken() at the end of the last turn
  bool stopping_ = false;
  bool reload_wanted_ = false;
  bool recalibration_wanted_ = false;
  bool reload_refused_ = false;
  bool told_of_shortage_ = false;
  bool output_fits_ = true;  ///< result of the last check_output()
  std::uint64_t watchdog_half_usec_ = 0;
  LifeSign life_;
  std::uint64_t samples_ = 0;  ///< of both gyros, at the last look_at_status()
  Patience patience_;
  ForwardTime forward_;
  TimePoint started_;  ///< on the steady clock
  TimePoint snapshot_at_;
};

}  // namespace vgyro::daemon

#pragma once

// The live driver of the pipeline: frames of all buses in the order of their stamps, time when no
// frame comes, output frames to the transmit queue. sd-event serves what is slow (signals, the
// status of each second); frames go past it, straight from epoll. Nothing on the frame path
// allocates.

#include <memory>
#include <span>
#include <string>
#include <sys/epoll.h>
#include <systemd/sd-event.h>
#include <vector>

#include "base/error.h"
#include "can/transmit.h"
#include "daemon/bus.h"
#include "daemon/log.h"
#include "daemon/reporter.h"
#include "daemon/state_keeper.h"
#include "gateway/pipeline.h"
#include "gateway/plan.h"

namespace vgyro::daemon {

class GatewayLoop final : private gateway::FrameSink {
 public:
  /// `keeper` is null where nothing is kept across a restart.
  GatewayLoop(const gateway::Plan& plan, StateKeeper* keeper, Log& log);
  GatewayLoop(const GatewayLoop&) = delete;
  GatewayLoop& operator=(const GatewayLoop&) = delete;
  ~GatewayLoop() override;

  /// Takes up what was kept, binds all sockets and catches SIGTERM and SIGINT; an error says what
  /// the user can do.
  Expected<void> start();

  /// Until SIGTERM or SIGINT.
  Expected<void> run();

 private:
  using EventPointer = std::unique_ptr<sd_event, decltype(&sd_event_unref)>;

  void put(const can::Frame& frame, TimePoint stamp) override;

  void take_up_state();
  Expected<void> start_events();
  Expected<void> check_output() const;
  bool poll_bus(std::size_t index);
  Expected<void> serve_events(bool armed);
  Expected<void> cycle(std::span<const epoll_event> ready);
  void hand_on_arrivals();
  Bus* earliest(Arrival& arrival);
  void flush();
  void poll_writable(bool wanted);
  void second_passed();
  void reopen_dead_buses();
  [[nodiscard]] int timeout_ms() const;
  [[nodiscard]] Traffic traffic() const;
  [[nodiscard]] bool all_drained() const;

  static int on_signal(sd_event_source* source, const struct signalfd_siginfo* info, void* self);
  static int on_second(sd_event_source* source, std::uint64_t usec, void* self);

  const gateway::Plan& plan_;
  StateKeeper* keeper_;
  Log& log_;
  Reporter reporter_;
  gateway::Pipeline pipeline_;
  can::TransmitQueue queue_;
  std::vector<Bus> buses_;
  EventPointer events_{nullptr, &sd_event_unref};
  int epoll_fd_ = -1;
  bool polls_writable_ = false;
  bool has_spoken_ = false;  ///< in this cycle; no state changes without an output frame
  bool stopping_ = false;
  TimePoint now_;  ///< the host's clock when the present cycle began
};

}  // namespace vgyro::daemon

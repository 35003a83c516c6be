#pragma once

// One interface as the loop sees it: its socket while there is one, the frames read from it and not
// yet handed on, and what is known of the link. A link that is down or gone is never fatal.

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "base/error.h"
#include "base/time.h"
#include "can/sender.h"
#include "can/socket.h"
#include "can/stamp_clock.h"
#include "daemon/log.h"

namespace vgyro::daemon {

struct Arrival {
  const can::Frame* frame = nullptr;
  TimePoint stamp;  ///< on the host's clock
};

class Bus final : public can::Sender {
 public:
  /// Without filters the bus is only written to.
  Bus(std::string name, std::vector<can::Filter> filters, Log& log);

  /// Binds a new socket, filters included.
  Expected<void> open();

  /// Poll reported something: read again when peek() runs dry, but not without end.
  void begin_reading(TimePoint now) {
    reads_left_ = kReadsPerCycle;
    now_ = now;
  }

  /// The oldest frame not yet taken; its frame is null when there is none for now.
  Arrival peek();
  void take() { ++next_; }

  /// Nothing is left in the kernel as far as is known.
  [[nodiscard]] bool drained() const { return !more_; }

  can::SendResult send(const can::Frame& frame) override {
    return socket_ ? socket_->send(frame) : can::SendResult::kLinkDown;
  }

  /// Looks whether a link that was down is up again.
  void check_link();

  [[nodiscard]] const std::string& name() const { return name_; }
  [[nodiscard]] bool is_open() const { return socket_.has_value(); }
  /// Only while open.
  [[nodiscard]] const can::Socket& socket() const { return *socket_; }
  [[nodiscard]] std::uint64_t received() const { return received_; }
  [[nodiscard]] std::uint64_t lost() const {
    return lost_before_ + (socket_ ? socket_->drops() : 0);
  }

 private:
  // 1024 frames: more than a second of a busy bus, so the other buses do not starve.
  static constexpr int kReadsPerCycle = 16;

  bool refill();
  void close_dead(const std::string& why);

  std::string name_;
  std::vector<can::Filter> filters_;
  Log& log_;
  std::optional<can::Socket> socket_;
  can::StampClock clock_;
  can::Batch batch_;
  std::size_t next_ = 0;
  TimePoint next_stamp_;
  std::size_t stamped_ = 0;  ///< frames of the batch whose stamp has been worked out
  TimePoint now_;            ///< stands in where the kernel gave no stamp
  int reads_left_ = 0;
  bool more_ = false;
  bool down_ = false;
  std::uint64_t received_ = 0;
  std::uint64_t lost_before_ = 0;  ///< by sockets that are gone
};

}  // namespace vgyro::daemon

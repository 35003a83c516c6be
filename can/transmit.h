#pragma once

// Handles frames that the kernel does not take at once: keeps them in order, tries again, and drops
// them rather than send them late, since an old rate in a burst is worse than none. Bounded;
// allocates only when constructed; reads no clock: time is an argument.

#include <cstdint>
#include <optional>
#include <vector>

#include "base/time.h"
#include "can/frame.h"
#include "can/transmitter.h"

namespace vgyro::can {

struct TransmitLimits {
  std::size_t capacity = 256;
  Duration first_retry = std::chrono::milliseconds(1);
  Duration last_retry = std::chrono::milliseconds(32);  ///< the wait doubles up to this
};

struct TransmitCounts {
  std::uint64_t sent = 0;
  std::uint64_t dropped_stale = 0;     ///< not sent before their time ran out
  std::uint64_t dropped_overflow = 0;  ///< the oldest frame of a full queue
  std::uint64_t dropped_failed = 0;    ///< the kernel refused them for good
  std::uint64_t retries = 0;           ///< attempts after a refusal for want of space
};

class TransmitQueue {
 public:
  explicit TransmitQueue(const TransmitLimits& limits = {});

  /// Sends at once if the queue is empty and no wait is pending, which is nearly always the case;
  /// needs no time. False if the frame was not sent: then push() it.
  bool send_at_once(const Frame& frame, Transmitter& transmitter);

  /// Appends a frame to the queue. It is dropped if it is not sent by `send_by`.
  void push(const Frame& frame, TimePoint send_by);

  /// Sends what can be sent now, oldest first; the first refusal ends the attempt.
  void drain(TimePoint now, Transmitter& transmitter);

  /// Call when poll() reports that the socket takes frames again.
  void on_writable() { awaits_writable_ = false; }

  /// Poll for writing, and call on_writable(), while this is true.
  [[nodiscard]] bool wants_writable() const { return awaits_writable_ && size_ > 0; }

  /// When drain() must be called again; nothing while the queue is empty.
  [[nodiscard]] std::optional<TimePoint> next_deadline() const;

  [[nodiscard]] std::size_t size() const { return size_; }
  /// The last attempt found the interface down.
  [[nodiscard]] bool link_down() const { return link_down_; }
  [[nodiscard]] const TransmitCounts& counts() const { return counts_; }

 private:
  struct Waiting {
    Frame frame;
    TimePoint send_by;
  };

  void pop();
  void drop_stale(TimePoint now);
  [[nodiscard]] bool may_try(TimePoint now) const;
  bool send_oldest(TimePoint now, Transmitter& transmitter);
  void back_off(TimePoint now);

  TransmitLimits limits_;
  std::vector<Waiting> ring_;
  std::size_t head_ = 0;
  std::size_t size_ = 0;
  bool awaits_writable_ = false;
  bool link_down_ = false;
  Duration wait_{};  ///< present back-off; 0 while the kernel takes frames
  TimePoint retry_at_;
  TransmitCounts counts_;
};

}  // namespace vgyro::can

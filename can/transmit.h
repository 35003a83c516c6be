#pragma once

// What to do with frames that the kernel does not take at once: keep them in order, try again, and
// rather drop them than send them late, since an old rate in a burst is worse than none. Bounded;
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
  Duration last_retry = std::chrono::milliseconds(32);  ///< the waits double up to here
};

struct TransmitCounts {
  std::uint64_t sent = 0;
  std::uint64_t dropped_stale = 0;     ///< not sent before their time ran out
  std::uint64_t dropped_overflow = 0;  ///< oldest of a full queue
  std::uint64_t dropped_failed = 0;    ///< the kernel refused them for good
  std::uint64_t retries = 0;           ///< attempts after a refusal for want of space
};

class TransmitQueue {
 public:
  explicit TransmitQueue(const TransmitLimits& limits = {});

  /// Sends at once, where nothing waits and nothing holds back, which is nearly always; needs no
  /// time. False when it has not gone out: push() it.
  bool send_at_once(const Frame& frame, Transmitter& transmitter);

  /// Last in the order of sending. Dropped when not sent by `send_by`.
  void push(const Frame& frame, TimePoint send_by);

  /// Sends what can be sent now, oldest first; the first refusal ends the attempt.
  void drain(TimePoint now, Transmitter& transmitter);

  /// Poll says that the socket takes frames again.
  void on_writable() { awaits_writable_ = false; }

  /// Poll for writing, and call on_writable(), while this is true.
  [[nodiscard]] bool wants_writable() const { return awaits_writable_ && size_ > 0; }

  /// When drain() has to be called again; nothing while empty.
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

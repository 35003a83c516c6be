#pragma once

// Detects other senders of our identifiers: a second gateway on the bus, or the vehicle itself.
// Receivers would take its frames for ours. The sockets do not receive this process's own frames;
// frames of a socket closed since (at a reload, or in an earlier run) may still return.
// Clock-free: the caller says when a second has passed.

#include <algorithm>
#include <cstdint>
#include <utility>
#include <vector>

#include "can/frame.h"
#include "gateway/plan.h"

namespace vgyro::daemon {

class IdentifierWatch {
 public:
  /// The bus counts as contested this long after the last foreign frame. That is longer than the
  /// sample interval of the slowest gyros, at which another gateway would send.
  static constexpr int kContestedSeconds = 10;
  /// Within this time, a frame handed to a controller is sent and looped back, or given up.
  static constexpr int kEchoSeconds = 2;

  /// For a bus that the gateway does not send to.
  IdentifierWatch() = default;
  explicit IdentifierWatch(std::vector<gateway::FrameId> ids) : ids_(std::move(ids)) {}

  /// Call when a socket was opened: echoes of an earlier one may still come.
  void opened() { echoes_left_ = kEchoSeconds; }

  /// Whether the frame has one of our identifiers, and thus is no input. `local`: sent by this
  /// host.
  bool takes(const can::Frame& frame, bool local) {
    if (frame.has(can::kRemote) || frame.has(can::kError)) return false;
    const gateway::FrameId id{frame.id, frame.has(can::kExtended)};
    if (std::find(ids_.begin(), ids_.end(), id) == ids_.end()) return false;
    if (local && echoes_left_ > 0) return true;
    ++count_;
    contested_left_ = kContestedSeconds;
    return true;
  }

  void second_passed() {
    echoes_left_ = std::max(0, echoes_left_ - 1);
    contested_left_ = std::max(0, contested_left_ - 1);
  }

  /// Frames from other senders, so far.
  [[nodiscard]] std::uint64_t count() const { return count_; }
  [[nodiscard]] bool is_contested() const { return contested_left_ > 0; }

 private:
  std::vector<gateway::FrameId> ids_;
  int echoes_left_ = 0;
  int contested_left_ = 0;
  std::uint64_t count_ = 0;
};

}  // namespace vgyro::daemon

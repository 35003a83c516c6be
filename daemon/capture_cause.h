#pragma once

// The causes of a capture, and their detection: CaptureTriggers compares each status with the
// counters of the one before, and keeps nothing else.

#include <array>
#include <cstdint>
#include <optional>
#include <string_view>

#include "gateway/status.h"

namespace vgyro::daemon {

enum class CaptureCause : std::uint8_t { kContradicted, kDisagree, kStopsRefused, kAsked };
inline constexpr std::size_t kCaptureCauses = 4;

/// "contradicted", "disagree", "stops_refused", "asked": part of a folder's name.
std::string_view to_string(CaptureCause cause);
std::optional<CaptureCause> capture_cause_from(std::string_view name);

class CaptureTriggers {
 public:
  using Causes = std::array<bool, kCaptureCauses>;

  /// The causes that began since the last call. A counter that restarts at 0, as after a reload, is
  /// no cause.
  Causes look(const gateway::Status& status);

 private:
  std::uint64_t contradictions_ = 0;
  std::uint64_t disagreements_ = 0;
  std::uint64_t fruitless_ = 0;  ///< steady stretches that taught little
};

}  // namespace vgyro::daemon

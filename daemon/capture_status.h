#pragma once

// State and counters of the captures at one moment, for D-Bus and the metrics.

#include <array>
#include <cstdint>
#include <string>

#include "daemon/capture_cause.h"
#include "daemon/capture_ring.h"

namespace vgyro::daemon {

struct CaptureStatus {
  std::string directory;
  CaptureRing::Counts ring;
  std::array<std::uint64_t, kCaptureCauses> written{};  ///< by cause, since the start
  std::uint64_t failed = 0;                             ///< captures that could not be written
  std::uint64_t held_back = 0;  ///< causes that came too soon after one of their kind
  bool is_writing = false;
  std::string last;  ///< folder of the newest capture since the start; empty: none

  [[nodiscard]] std::uint64_t written_in_all() const {
    std::uint64_t sum = 0;
    for (const std::uint64_t count : written)
      sum += count;
    return sum;
  }
};

}  // namespace vgyro::daemon

#pragma once

// Frames → a block of a recording: candump text, packed as one xz stream. Concatenated streams are
// one .xz file, so a recording is joined from blocks without packing them again.

#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "base/time.h"
#include "can/frame.h"

namespace vgyro::daemon {

/// One frame as the loop saw it.
struct CapturedFrame {
  TimePoint stamp;
  can::BusIndex bus = 0;
  can::Frame frame;
};

/// The configuration under which frames were captured.
struct CaptureSource {
  std::vector<std::string> buses;  ///< BusIndex → interface name
  std::string fingerprint;
};

struct PackedBlock {
  std::string xz;
  std::uint64_t frames = 0;
  std::uint64_t dropped_before = 0;  ///< frames lost between the block before and this one
  TimePoint first;                   ///< the least stamp
  TimePoint last;                    ///< the greatest stamp
  std::int64_t began_s = 0;          ///< on the ring's count of seconds
  std::int64_t sealed_s = 0;
  std::shared_ptr<const CaptureSource> source;
};

/// Fills in only `xz`, `frames`, `first`, `last` and `source`. Returns nothing if memory is short.
/// Precondition: `frames` is not empty.
std::optional<PackedBlock> pack(std::span<const CapturedFrame> frames,
                                std::shared_ptr<const CaptureSource> source);

}  // namespace vgyro::daemon

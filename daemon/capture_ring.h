#pragma once

// The last minutes of frames, in memory. The loop puts frames into blocks of fixed size, which are
// made at the start; a thread packs each full block (capture_packing.h) and keeps it, within limits
// of time and of bytes. put() neither waits nor allocates: where the thread has fallen behind and
// no block is free, frames are dropped and counted. Knows nothing of files, causes or
// configurations. Clock-free: second_passed() is its clock. All calls come from one thread, the
// loop's.

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <memory>
#include <vector>

#include "base/time.h"
#include "can/frame.h"
#include "daemon/capture_packing.h"
#include "daemon/loose_thread.h"

namespace vgyro::daemon {

class CaptureRing {
 public:
  /// Four seconds of two gyros at 500 Hz: enough text for xz to find what repeats.
  static constexpr std::size_t kBlockFrames = 4096;
  /// One is being filled, one packed; the others are the time that the thread may be late by.
  static constexpr std::size_t kBlocks = 4;
  /// A block that is not full by then is packed all the same.
  static constexpr std::int64_t kBlockSeconds = 10;

  struct Limits {
    std::int64_t seconds = 0;  ///< between the first frame of the oldest block and the newest one
    std::size_t bytes = 0;     ///< of all packed blocks
  };

  struct Counts {
    std::uint64_t frames = 0;   ///< held in packed blocks
    std::uint64_t bytes = 0;    ///< of these blocks
    std::uint64_t dropped = 0;  ///< frames since the start: no block was free, or no memory
    double seconds = 0.0;       ///< from the first frame of the packed blocks to the last one
  };

  using Blocks = std::vector<std::shared_ptr<const PackedBlock>>;

  /// Starts the thread; throws std::system_error where there is none to be had.
  explicit CaptureRing(Limits limits);
  CaptureRing(const CaptureRing&) = delete;
  CaptureRing& operator=(const CaptureRing&) = delete;
  ~CaptureRing();

  /// What the bus numbers of the frames mean from now on. Call before the first put().
  void use(std::shared_ptr<const CaptureSource> source);

  /// Everything that was put so far is gone, packed or not.
  void forget();

  void put(can::BusIndex bus, const can::Frame& frame, TimePoint stamp) {
    if (open_ == nullptr && !open_block()) {
      ++dropped_;
      return;
    }
    CapturedFrame& place = open_->frames[open_->count];
    place.stamp = stamp;
    place.bus = bus;
    place.frame = frame;
    if (++open_->count == kBlockFrames) seal();
  }

  /// To be called about once a second.
  void second_passed();

  /// Hands what was put so far to the thread. The number is for is_packed().
  std::uint32_t seal();
  /// Is what was put before that seal() among blocks()?
  [[nodiscard]] bool is_packed(std::uint32_t sealed) const;
  /// Waits for it, but no longer than that. For the end of the process only.
  bool wait_until_packed(std::uint32_t sealed, std::chrono::milliseconds patience) const;

  /// The packed blocks, oldest first.
  [[nodiscard]] Blocks blocks() const;
  [[nodiscard]] Counts counts() const;

 private:
  struct Block {
    std::vector<CapturedFrame> frames = std::vector<CapturedFrame>(kBlockFrames);
    std::size_t count = 0;
    std::uint64_t dropped_before = 0;
    std::int64_t began_s = 0;
    std::int64_t sealed_s = 0;
    std::uint32_t generation = 0;
    std::shared_ptr<const CaptureSource> source;
  };
  struct Shared;

  bool open_block();

  std::shared_ptr<Shared> shared_;
  std::shared_ptr<const CaptureSource> source_;
  Block* open_ = nullptr;             ///< that is being filled
  std::uint64_t dropped_ = 0;         ///< since the last block that was opened
  std::uint64_t dropped_before_ = 0;  ///< that
  std::uint32_t generation_ = 0;      ///< changed by forget()
  std::uint32_t sealed_ = 0;          ///< blocks so far
  std::int64_t second_ = 0;
  LooseThread thread_;
};

}  // namespace vgyro::daemon

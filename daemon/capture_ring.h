#pragma once

// Keeps the frames of the last minutes in memory. The loop fills blocks of fixed size, allocated at
// the start; a thread packs each full block (capture_packing.h) and keeps it, within limits of time
// and bytes. put() neither waits nor allocates: if the thread has fallen behind and no block is
// free, frames are dropped and counted. Independent of files, causes and configurations.
// Clock-free: second_passed() is its clock. All calls come from the loop's thread.

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
  /// One is being filled and one packed; the others let the thread fall behind without loss.
  static constexpr std::size_t kBlocks = 4;
  /// After this time a block is packed even if it is not full.
  static constexpr std::int64_t kBlockSeconds = 10;

  struct Limits {
    std::int64_t seconds = 0;  ///< from the start of the oldest block to the end of the newest
    std::size_t bytes = 0;     ///< of all packed blocks
  };

  struct Counts {
    std::uint64_t frames = 0;   ///< held in packed blocks
    std::uint64_t bytes = 0;    ///< size of these blocks
    std::uint64_t dropped = 0;  ///< frames since the start for lack of a free block or memory
    double seconds = 0.0;       ///< from the first frame of the packed blocks to the last one
  };

  using Blocks = std::vector<std::shared_ptr<const PackedBlock>>;

  /// Starts the thread; throws std::system_error if that fails.
  explicit CaptureRing(Limits limits);
  CaptureRing(const CaptureRing&) = delete;
  CaptureRing& operator=(const CaptureRing&) = delete;
  ~CaptureRing();

  /// Sets the configuration that the bus numbers of further frames refer to. Call before the first
  /// put().
  void use(std::shared_ptr<const CaptureSource> source);

  /// Drops all frames put so far, packed or not.
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

  /// Hands the frames put so far to the thread. Returns a number for is_packed().
  std::uint32_t seal();
  /// Whether the thread has packed the frames that were put before that seal().
  [[nodiscard]] bool is_packed(std::uint32_t sealed) const;
  /// Waits for is_packed(), at most `patience`. For the end of the process only.
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
  Block* open_ = nullptr;             ///< being filled; null: none
  std::uint64_t dropped_ = 0;         ///< frames since a block was last opened
  std::uint64_t dropped_before_ = 0;  ///< frames until then
  std::uint32_t generation_ = 0;      ///< changed by forget()
  std::uint32_t sealed_ = 0;          ///< blocks sealed so far
  std::int64_t second_ = 0;
  LooseThread thread_;
};

}  // namespace vgyro::daemon

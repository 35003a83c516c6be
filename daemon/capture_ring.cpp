#include "daemon/capture_ring.h"

#include <algorithm>
#include <array>
#include <atomic>
#include <deque>
#include <mutex>
#include <new>
#include <thread>
#include <utility>

namespace vgyro::daemon {
namespace {

// Wait at the end of the process; packing a block takes milliseconds.
constexpr std::chrono::milliseconds kLastPatience{1000};
constexpr std::chrono::milliseconds kLookEvery{2};

}  // namespace

/// State shared by the loop and the thread, which may outlive the ring. Block n is blocks[n %
/// kBlocks]. It belongs to the loop from `packed` + kBlocks > n until `sealed` > n, then to the
/// thread until `packed` > n. Both counters wrap around.
struct CaptureRing::Shared {
  explicit Shared(Limits the_limits) : limits(the_limits) {}

  // Sequentially consistent with the thread's check whether to sleep; otherwise it could miss this
  // block.
  void announce(std::uint32_t blocks_sealed) {
    sealed.store(blocks_sealed, std::memory_order_seq_cst);
    sealed.notify_one();
  }
  void pack_what_comes();
  void pack_block(Block& block);
  void keep(PackedBlock packed, std::uint32_t of_generation);
  void drop_oldest();

  const Limits limits;
  std::array<Block, kBlocks> blocks;
  std::atomic<std::uint32_t> sealed{0};
  std::atomic<std::uint32_t> packed{0};
  std::atomic<bool> stopping{false};

  mutable std::mutex mutex;  ///< guards what follows
  std::uint32_t generation = 0;
  std::deque<std::shared_ptr<const PackedBlock>> held;
  std::size_t bytes = 0;
  std::uint64_t frames = 0;
  std::uint64_t unpacked = 0;         ///< frames dropped for lack of memory, so far
  std::uint64_t unpacked_before = 0;  ///< frames missing since the newest block of `held`
};

void CaptureRing::Shared::pack_what_comes() {
  for (std::uint32_t next = 0;; ++next) {
    sealed.wait(next, std::memory_order_acquire);
    if (stopping.load(std::memory_order_acquire)) return;
    pack_block(blocks[next % kBlocks]);
    packed.store(next + 1, std::memory_order_release);
  }
}

void CaptureRing::Shared::pack_block(Block& block) {
  std::optional<PackedBlock> result = pack({block.frames.data(), block.count}, block.source);
  if (result) {
    result->dropped_before = block.dropped_before;
    result->began_s = block.began_s;
    result->sealed_s = block.sealed_s;
    try {
      keep(std::move(*result), block.generation);
      return;
    } catch (const std::bad_alloc&) {  // counted below
    }
  }
  const std::scoped_lock lock(mutex);
  unpacked += block.count;
  unpacked_before += block.count + block.dropped_before;
}

void CaptureRing::Shared::keep(PackedBlock packed_block, std::uint32_t of_generation) {
  auto shared_block = std::make_shared<PackedBlock>(std::move(packed_block));
  const std::scoped_lock lock(mutex);
  if (of_generation != generation) return;
  held.push_back(shared_block);
  shared_block->dropped_before += std::exchange(unpacked_before, 0);
  bytes += shared_block->xz.size();
  frames += shared_block->frames;
  const std::int64_t oldest_s = shared_block->sealed_s - limits.seconds;
  while (!held.empty() && (bytes > limits.bytes || held.front()->began_s < oldest_s))
    drop_oldest();
}

void CaptureRing::Shared::drop_oldest() {
  bytes -= held.front()->xz.size();
  frames -= held.front()->frames;
  held.pop_front();
}

CaptureRing::CaptureRing(Limits limits) : shared_(std::make_shared<Shared>(limits)) {
  thread_.start([shared = shared_] { shared->pack_what_comes(); });
}

// The thread ends at the next block, so an empty one is announced.
CaptureRing::~CaptureRing() {
  shared_->stopping.store(true, std::memory_order_release);
  shared_->announce(sealed_ + 1);
  thread_.finish(kLastPatience);
}

void CaptureRing::use(std::shared_ptr<const CaptureSource> source) {
  seal();
  source_ = std::move(source);
}

void CaptureRing::forget() {
  open_ = nullptr;
  const std::scoped_lock lock(shared_->mutex);
  shared_->generation = ++generation_;
  while (!shared_->held.empty())
    shared_->drop_oldest();
}

bool CaptureRing::open_block() {
  if (sealed_ - shared_->packed.load(std::memory_order_acquire) == kBlocks) return false;
  Block& block = shared_->blocks[sealed_ % kBlocks];
  block.count = 0;
  dropped_before_ += dropped_;
  block.dropped_before = std::exchange(dropped_, 0);
  block.began_s = second_;
  open_ = &block;
  return true;
}

std::uint32_t CaptureRing::seal() {
  if (open_ == nullptr || open_->count == 0) return sealed_;
  open_->sealed_s = second_;
  open_->source = source_;
  open_->generation = generation_;
  open_ = nullptr;
  shared_->announce(++sealed_);
  return sealed_;
}

void CaptureRing::second_passed() {
  ++second_;
  if (open_ != nullptr && second_ - open_->began_s >= kBlockSeconds) seal();
}

// The counters wrap around, so they are compared by their distance.
bool CaptureRing::is_packed(std::uint32_t sealed) const {
  const std::uint32_t ahead = shared_->packed.load(std::memory_order_acquire) - sealed;
  return ahead < (1U << 31U);
}

bool CaptureRing::wait_until_packed(std::uint32_t sealed,
                                    std::chrono::milliseconds patience) const {
  for (auto waited = kLookEvery; !is_packed(sealed); waited += kLookEvery) {
    if (waited > patience) return false;
    std::this_thread::sleep_for(kLookEvery);
  }
  return true;
}

CaptureRing::Blocks CaptureRing::blocks() const {
  const std::scoped_lock lock(shared_->mutex);
  return {shared_->held.begin(), shared_->held.end()};
}

CaptureRing::Counts CaptureRing::counts() const {
  const std::scoped_lock lock(shared_->mutex);
  Counts counts;
  counts.frames = shared_->frames;
  counts.bytes = shared_->bytes;
  counts.dropped = dropped_before_ + dropped_ + shared_->unpacked;
  if (!shared_->held.empty()) {
    counts.seconds =
        std::max(0.0, to_seconds(span(shared_->held.front()->first, shared_->held.back()->last)));
  }
  return counts;
}

}  // namespace vgyro::daemon

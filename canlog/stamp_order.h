#pragma once

// Records that were written stream by stream, as each one's buffer was emptied: some tenths of a
// second of one bus, then of another. They come out by stamp; each stream keeps its own order.
// Memory is bounded.

#include <memory>
#include <vector>

#include "canlog/record.h"

namespace vgyro::canlog {

class StampOrder {
 public:
  /// As many are held at most: two buses at full load leave fewer in eight seconds.
  static constexpr std::size_t kHeldMax = 131'072;

  /// `late_max_ns`: how much later than its place by stamp a record may come.
  explicit StampOrder(std::int64_t late_max_ns) : late_max_ns_(late_max_ns) {}

  struct Held {
    LogRecord record;
    std::unique_ptr<XlFrame> xl;  ///< of an XL frame
    std::uint64_t number = 0;     ///< in the order of the log
  };

  /// Streams count from 0 on.
  void push(const LogRecord& record, const XlFrame* xl, std::size_t stream);
  /// Nothing more comes.
  void close() { closed_ = true; }
  [[nodiscard]] bool is_empty() const { return held_ == 0; }
  /// What is first will stay first.
  [[nodiscard]] bool is_ready() const;
  /// The first; only where it is not empty.
  Held pop();

 private:
  /// A ring that grows.
  class Queue {
   public:
    [[nodiscard]] bool is_empty() const { return count_ == 0; }
    [[nodiscard]] const Held& front() const { return ring_[first_]; }
    void push(Held held);
    Held pop();

   private:
    std::vector<Held> ring_;
    std::size_t first_ = 0;
    std::size_t count_ = 0;
  };

  [[nodiscard]] std::size_t first() const;

  std::int64_t late_max_ns_;
  std::vector<Queue> streams_;
  std::size_t held_ = 0;
  std::uint64_t pushed_ = 0;
  std::int64_t last_ns_ = 0;  ///< of the record pushed last
  bool closed_ = false;
};

}  // namespace vgyro::canlog

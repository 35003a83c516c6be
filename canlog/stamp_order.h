#pragma once

// Sorts records by stamp that were written stream by stream, as each buffer was emptied: some
// tenths of a second of one bus, then of another. Each stream keeps its own order. Memory is
// bounded.

#include <memory>
#include <vector>

#include "canlog/record.h"

namespace vgyro::canlog {

class StampOrder {
 public:
  /// Limit of records held: two buses at full load have fewer in eight seconds.
  static constexpr std::size_t kHeldMax = 131'072;

  /// `late_max_ns`: how much later than its place by stamp a record may be.
  explicit StampOrder(std::int64_t late_max_ns) : late_max_ns_(late_max_ns) {}

  struct Held {
    LogRecord record;
    std::unique_ptr<XlFrame> xl;  ///< for an XL frame
    std::uint64_t number = 0;     ///< place in the log
  };

  /// `stream` counts from 0.
  void push(const LogRecord& record, const XlFrame* xl, std::size_t stream);
  /// No more records come.
  void close() { closed_ = true; }
  [[nodiscard]] bool is_empty() const { return held_ == 0; }
  /// No later record can come before the first one.
  [[nodiscard]] bool is_ready() const;
  /// Returns the first record. Precondition: not empty.
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
  std::int64_t last_ns_ = 0;  ///< stamp of the record pushed last
  bool closed_ = false;
};

}  // namespace vgyro::canlog

#pragma once

// Records of several buses that were captured side by side, and written as each bus's buffer was
// emptied: some tenths of a second of one bus, then of another. They come out by stamp; each bus
// keeps its own order. Memory is bounded.

#include <array>
#include <memory>
#include <vector>

#include "canlog/record.h"

namespace vgyro::canlog {

class StampOrder {
 public:
  /// How much later than its place by stamp a record may come.
  static constexpr std::int64_t kLateMax_ns = 1'000'000'000;
  /// As many are held at most: two buses at full load leave fewer in that time.
  static constexpr std::size_t kHeldMax = 32'768;

  struct Held {
    LogRecord record;
    std::unique_ptr<XlFrame> xl;  ///< of an XL frame
    std::uint64_t number = 0;     ///< in the order of the log
  };

  void push(const LogRecord& record, const XlFrame& xl);
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

  std::array<Queue, InterfaceTable::kMax> buses_;
  std::size_t held_ = 0;
  std::uint64_t pushed_ = 0;
  std::int64_t last_ns_ = 0;  ///< of the record pushed last
  bool closed_ = false;
};

}  // namespace vgyro::canlog

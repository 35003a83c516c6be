#pragma once

// How many lines of one kind may go to the log: some at once, the others are counted and reported
// once a minute. Clock-free: the caller says when a second has passed.

#include <cstdint>

namespace vgyro::daemon {

class LineBudget {
 public:
  static constexpr int kPeriodSeconds = 60;
  static constexpr int kLinesMost = 10;

  /// May a line be written now? If not, it counts as held back.
  [[nodiscard]] bool take() {
    if (left_ == 0) ++held_;
    return left_ > 0 && left_-- > 0;
  }

  /// Lines held back in the minute that ended with this second; 0 at any other second.
  [[nodiscard]] std::uint64_t second_passed() {
    if (++second_ % kPeriodSeconds != 0) return 0;
    left_ = kLinesMost;
    const std::uint64_t held = held_;
    held_ = 0;
    return held;
  }

 private:
  int left_ = kLinesMost;
  std::uint64_t held_ = 0;
  std::uint64_t second_ = 0;
};

}  // namespace vgyro::daemon

#pragma once

// Variance of a quantity over the last second, which measures vibration. Bounded: with more than
// kCapacity values a second the window is shorter. Nothing is allocated.

#include <array>
#include <cstddef>

#include "base/time.h"

namespace vgyro::fusion {

class MovingVariance {
 public:
  static constexpr Duration kWindow = std::chrono::seconds(1);
  static constexpr std::size_t kCapacity = 2048;

  /// A value at or before the last one's time is ignored; one more than kWindow before it restarts
  /// the window. Precondition: finite.
  void add(TimePoint t, double value);

  /// 0 with fewer than two values in the window.
  [[nodiscard]] double variance() const;
  [[nodiscard]] std::size_t count() const { return size_; }

 private:
  struct Value {
    TimePoint t;
    double deviation = 0.0;  ///< from pivot_
  };
  void drop_oldest();
  void sum_anew();

  std::array<Value, kCapacity> values_;
  std::size_t head_ = 0;
  std::size_t size_ = 0;
  std::size_t until_anew_ = kCapacity;
  double pivot_ = 0.0;
  double sum_ = 0.0;
  double square_sum_ = 0.0;
};

}  // namespace vgyro::fusion

#include "fusion/moving_variance.h"

#include <algorithm>

namespace vgyro::fusion {

void MovingVariance::drop_oldest() {
  const double oldest = values_[head_].deviation;
  sum_ -= oldest;
  square_sum_ -= oldest * oldest;
  head_ = (head_ + 1) % kCapacity;
  --size_;
}

// Running sums accumulate rounding errors, so they are recomputed now and then, about a pivot near
// the values.
void MovingVariance::sum_anew() {
  const double shift = size_ == 0 ? 0.0 : sum_ / static_cast<double>(size_);
  pivot_ += shift;
  sum_ = 0.0;
  square_sum_ = 0.0;
  for (std::size_t i = 0; i < size_; ++i) {
    double& deviation = values_[(head_ + i) % kCapacity].deviation;
    deviation -= shift;
    sum_ += deviation;
    square_sum_ += deviation * deviation;
  }
  until_anew_ = kCapacity;
}

void MovingVariance::add(TimePoint t, double value) {
  if (size_ > 0) {
    const TimePoint newest = values_[(head_ + size_ - 1) % kCapacity].t;
    // The clock was set back: the stored values belong to another time.
    if (newest - t > kWindow) {
      size_ = 0;
    } else if (t <= newest) {
      return;
    }
  }
  while (size_ > 0 && values_[head_].t <= t - kWindow)
    drop_oldest();
  if (size_ == kCapacity) drop_oldest();
  if (size_ == 0) {
    pivot_ = value;
    sum_ = 0.0;
    square_sum_ = 0.0;
  }
  const double deviation = value - pivot_;
  values_[(head_ + size_) % kCapacity] = {t, deviation};
  ++size_;
  sum_ += deviation;
  square_sum_ += deviation * deviation;
  if (--until_anew_ == 0) sum_anew();
}

double MovingVariance::variance() const {
  if (size_ < 2) return 0.0;
  const auto count = static_cast<double>(size_);
  const double mean = sum_ / count;
  return std::max(0.0, square_sum_ / count - mean * mean);
}

}  // namespace vgyro::fusion

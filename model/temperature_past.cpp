#include "model/temperature_past.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <limits>

namespace vgyro::model {

// Followers with little play are dragged to the straight line temperature ∓ play; those with more
// stay. The two parts meet at the new bend.
void TemperaturePast::add(double temperature_c) {
  assert(std::isfinite(temperature_c));
  if (count_ == 0) {
    bends_[0] = {0.0, temperature_c};
    count_ = 1;
    return;
  }
  const double before_c = bends_[0].followed_c;
  if (temperature_c == before_c) return;
  const double up = temperature_c > before_c ? 1.0 : -1.0;
  const auto dragged_k = [&](const Bend& bend) {
    return up * (temperature_c - bend.followed_c) - bend.play_k;
  };
  std::size_t stays = 1;
  while (stays < count_ && dragged_k(bends_[stays]) > 0.0)
    ++stays;
  const Bend& last = bends_[stays - 1];
  double meets_k = last.play_k + dragged_k(last);
  if (stays < count_) {
    const Bend& next = bends_[stays];
    const double share = dragged_k(last) / (dragged_k(last) - dragged_k(next));
    meets_k = last.play_k + share * (next.play_k - last.play_k);
  }
  std::array<Bend, kBendsMax + 1> bends;
  bends[0] = {0.0, temperature_c};
  bends[1] = {meets_k, temperature_c - up * meets_k};
  std::copy(bends_.begin() + static_cast<std::ptrdiff_t>(stays),
            bends_.begin() + static_cast<std::ptrdiff_t>(count_), bends.begin() + 2);
  count_ = 2 + count_ - stays;
  if (count_ > kBendsMax) {
    const std::size_t least = least_of(bends);
    std::copy(bends.begin() + static_cast<std::ptrdiff_t>(least) + 1, bends.end(),
              bends.begin() + static_cast<std::ptrdiff_t>(least));
    --count_;
  }
  std::copy_n(bends.begin(), count_, bends_.begin());
}

// The least important bend: the straight line between its neighbours hardly differs.
std::size_t TemperaturePast::least_of(const std::array<Bend, kBendsMax + 1>& bends) {
  std::size_t least = 1;
  double least_c = std::numeric_limits<double>::max();
  for (std::size_t i = 1; i + 1 < bends.size(); ++i) {
    const Bend& a = bends[i - 1];
    const Bend& b = bends[i + 1];
    const double share = (bends[i].play_k - a.play_k) / (b.play_k - a.play_k);
    const double straight_c = a.followed_c + share * (b.followed_c - a.followed_c);
    const double missed_c = std::abs(bends[i].followed_c - straight_c);
    if (missed_c >= least_c) continue;
    least_c = missed_c;
    least = i;
  }
  return least;
}

double TemperaturePast::followed_c(double play_k, double now_c) const {
  assert(count_ > 0 && play_k >= 0.0);
  std::size_t after = 1;
  while (after < count_ && bends_[after].play_k < play_k)
    ++after;
  double followed_c = bends_[after - 1].followed_c;
  if (after < count_) {
    const Bend& a = bends_[after - 1];
    const Bend& b = bends_[after];
    const double share = (play_k - a.play_k) / (b.play_k - a.play_k);
    followed_c = a.followed_c + share * (b.followed_c - a.followed_c);
  }
  return std::clamp(followed_c, now_c - play_k, now_c + play_k);
}

}  // namespace vgyro::model

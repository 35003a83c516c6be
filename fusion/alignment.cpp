#include "fusion/alignment.h"

#include <algorithm>
#include <cassert>

namespace vgyro::fusion {

namespace {

// Rates that differ by less than this are the same nominal rate; phase then decides who paces.
constexpr double kSameRate = 1.1;

double line_at(TimePoint t, TimePoint t0, double y0, TimePoint t1, double y1) {
  if (t == t1) return y1;
  const double share =
      static_cast<double>((t - t0).count()) / static_cast<double>((t1 - t0).count());
  return y0 + share * (y1 - y0);
}

}  // namespace

void Aligner::Ring::insert(const Sample& sample) {
  assert(size_ < kCapacity);
  std::size_t at = size_++;
  for (; at > 0 && (*this)[at - 1].t > sample.t; --at) {
    samples_[(head_ + at) & (kCapacity - 1)] = (*this)[at - 1];
  }
  samples_[(head_ + at) & (kCapacity - 1)] = sample;
}

bool Aligner::Ring::contains(TimePoint t) const {
  for (std::size_t i = size_; i > 0 && (*this)[i - 1].t >= t; --i) {
    if ((*this)[i - 1].t == t) return true;
  }
  return false;
}

bool Aligner::push(std::size_t gyro, TimePoint t, double rate_dps) {
  Ring& ring = rings_[gyro];
  if (any_used_[gyro] && t <= used_until_[gyro]) return false;
  if (!ring.empty() && t <= ring.back().t && ring.contains(t)) return false;
  if (ring.size() == kCapacity) {
    // Of the gyro that does not pace, old samples are only kept in case the other one is late.
    if (!chosen_ || gyro == pace_) ++counts_.unpaired[gyro];
    used_until_[gyro] = ring[0].t;
    any_used_[gyro] = true;
    ring.pop_front();
    if (t <= used_until_[gyro]) return false;
  }
  ring.insert({t, rate_dps});
  if (!chosen_) choose_pace();
  return true;
}

// How long pairs would wait for the other gyro if `pace` set the instants, on average.
Duration Aligner::mean_wait(std::size_t pace) const {
  const Ring& own = rings_[pace];
  const Ring& other = rings_[1 - pace];
  Duration sum{0};
  Duration::rep waited = 0;
  std::size_t next = 0;
  for (std::size_t i = 0; i < own.size(); ++i) {
    while (next < other.size() && other[next].t < own[i].t)
      ++next;
    if (next == 0 || next == other.size()) continue;
    sum += other[next].t - own[i].t;
    ++waited;
  }
  return waited == 0 ? Duration::max() : sum / waited;
}

void Aligner::choose_pace() {
  const bool enough = std::min(rings_[0].size(), rings_[1].size()) >= kSamplesToChoose ||
                      (std::max(rings_[0].size(), rings_[1].size()) == kCapacity - 1 &&
                       std::min(rings_[0].size(), rings_[1].size()) >= 2);
  if (!enough) return;
  for (std::size_t gyro = 0; gyro < 2; ++gyro) {
    const Ring& ring = rings_[gyro];
    interval_[gyro] = (ring.back().t - ring[0].t) / static_cast<Duration::rep>(ring.size() - 1);
    gap_[gyro] = from_seconds(to_seconds(interval_[gyro]) * kGapIntervals);
  }
  const double ratio = to_seconds(interval_[0]) / to_seconds(interval_[1]);
  if (ratio > kSameRate) {
    pace_ = 0;
  } else if (ratio < 1.0 / kSameRate) {
    pace_ = 1;
  } else {
    pace_ = mean_wait(0) <= mean_wait(1) ? 0 : 1;
  }
  const bool averages = std::max(ratio, 1.0 / ratio) >= kAverageRatio;
  half_window_ = averages ? interval_[pace_] / 2 : Duration::zero();
  burst_until_ = std::max(rings_[0].back().t, rings_[1].back().t);
  chosen_ = true;
}

bool Aligner::pop(AlignedPair& pair) {
  if (!chosen_) return false;
  Ring& own = rings_[pace_];
  Ring& other = rings_[1 - pace_];
  while (!own.empty()) {
    pair.t = own[0].t;
    // Samples of the other gyro that no later pair can need.
    const TimePoint needed = pair.t - half_window_;
    std::size_t stale = 0;
    while (stale + 1 < other.size() && other[stale + 1].t <= needed)
      ++stale;
    if (stale > 0) {
      used_until_[1 - pace_] = other[stale - 1].t;
      any_used_[1 - pace_] = true;
      other.pop_front(stale);
    }
    bool wait = false;
    const bool paired = half_window_ == Duration::zero() ? interpolate(other, pair, 1 - pace_, wait)
                                                         : average(other, pair, 1 - pace_, wait);
    if (wait) return false;
    pair.rate_dps[pace_] = own[0].rate_dps;
    used_until_[pace_] = pair.t;
    any_used_[pace_] = true;
    own.pop_front();
    if (paired) {
      pair.complete = std::max(pair.complete, std::max(pair.t, burst_until_));
      if (own.empty()) burst_until_ = TimePoint{};
      return true;
    }
    ++counts_.unpaired[pace_];
  }
  burst_until_ = TimePoint{};
  return false;
}

bool Aligner::interpolate(const Ring& other, AlignedPair& pair, std::size_t other_index,
                          bool& wait) {
  wait = other.empty() || other.back().t < pair.t;
  if (wait || other[0].t > pair.t) return false;
  // pop() has left the last sample at or before the pair in front.
  const Sample& before = other[0];
  if (before.t == pair.t) {
    pair.rate_dps[other_index] = before.rate_dps;
    pair.complete = pair.t;
    return true;
  }
  const Sample& after = other[1];
  if (after.t - before.t > gap_[other_index]) return false;
  pair.rate_dps[other_index] = line_at(pair.t, before.t, before.rate_dps, after.t, after.rate_dps);
  pair.complete = after.t;
  used_until_[other_index] = before.t;
  any_used_[other_index] = true;
  return true;
}

bool Aligner::average(const Ring& other, AlignedPair& pair, std::size_t other_index, bool& wait) {
  const TimePoint from = pair.t - half_window_;
  const TimePoint to = pair.t + half_window_;
  wait = other.empty() || other.back().t < to;
  if (wait || other[0].t > from) return false;
  double area = 0.0;
  for (std::size_t i = 0; i + 1 < other.size() && other[i].t < to; ++i) {
    const Sample& a = other[i];
    const Sample& b = other[i + 1];
    if (b.t - a.t > gap_[other_index]) return false;
    const TimePoint left = std::max(a.t, from);
    const TimePoint right = std::min(b.t, to);
    if (right <= left) continue;
    const double y_left = line_at(left, a.t, a.rate_dps, b.t, b.rate_dps);
    const double y_right = line_at(right, a.t, a.rate_dps, b.t, b.rate_dps);
    area += 0.5 * (y_left + y_right) * to_seconds(right - left);
    pair.complete = b.t;
    used_until_[other_index] = std::max(used_until_[other_index], a.t);
  }
  any_used_[other_index] = true;
  pair.rate_dps[other_index] = area / to_seconds(to - from);
  return true;
}

void Aligner::clear() {
  for (Ring& ring : rings_)
    ring.clear();
  any_used_ = {};
  burst_until_ = TimePoint{};
}

}  // namespace vgyro::fusion

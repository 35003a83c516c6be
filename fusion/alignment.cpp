#include "fusion/alignment.h"

#include <algorithm>
#include <cassert>

namespace vgyro::fusion {

namespace {

// Rates that differ by less than this factor are the same nominal rate; then the phase decides
// which gyro paces.
constexpr double kSameRate = 1.1;

double line_at(TimePoint t, TimePoint t0, double y0, TimePoint t1, double y1) {
  if (t == t1) return y1;
  const double share =
      static_cast<double>((t - t0).count()) / static_cast<double>((t1 - t0).count());
  return y0 + share * (y1 - y0);
}

bool alike(Duration a, Duration b) {
  const double ratio = to_seconds(a) / to_seconds(b);
  return ratio < Aligner::kOtherPace && ratio > 1.0 / Aligner::kOtherPace;
}

}  // namespace

void Aligner::Ring::insert(const RateSample& sample) {
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

std::size_t Aligner::Ring::count_until(TimePoint until) const {
  std::size_t count = size_;
  while (count > 0 && (*this)[count - 1].t > until)
    --count;
  return count;
}

Duration Aligner::Ring::usual_interval(TimePoint until) const {
  const std::size_t end = count_until(until);
  const std::size_t begin = end - std::min(end, kSamplesJudged);
  const auto mean = [&](Duration longest) {
    Duration sum{0};
    Duration::rep count = 0;
    for (std::size_t i = begin + 1; i < end; ++i) {
      const Duration interval = (*this)[i].t - (*this)[i - 1].t;
      if (interval > longest) continue;
      sum += interval;
      ++count;
    }
    return sum / std::max<Duration::rep>(count, 1);
  };
  // A gap among the first samples is no interval.
  return mean(from_seconds(to_seconds(mean(Duration::max())) * kGapIntervals));
}

bool Aligner::push(std::size_t gyro, TimePoint t, double rate_dps) {
  Ring& ring = rings_[gyro];
  t -= lag_[gyro];
  if (any_used_[gyro] && t <= used_until_[gyro]) return false;
  const bool in_order = ring.is_behind_all(t);
  if (!in_order && ring.contains(t)) return false;
  if (ring.size() == kCapacity) {
    // Old samples of the gyro that does not pace are only kept in case the other one is late.
    if (!chosen_ || gyro == pace_) ++counts_.unpaired[gyro];
    used_until_[gyro] = ring[0].t;
    any_used_[gyro] = true;
    ring.pop_front();
    if (t <= used_until_[gyro]) return false;
  }
  if (in_order) {
    ring.append(t, rate_dps);
  } else {
    ring.insert({t, rate_dps});
  }
  if (!chosen_) {
    choose_pace();
  } else {
    review(gyro, t);
  }
  return true;
}

// A review uses one stream alone, so that it does not depend on how the two interleave.
void Aligner::close_review(std::size_t gyro, TimePoint t) {
  Review& review = reviews_[gyro];
  // The longest interval may be a hole, and is left out.
  const Duration pace = (review.sum - review.longest) / (review.intervals - 1);
  const bool other_pace = !alike(pace, interval_[gyro]);
  const bool again =
      other_pace && review.odd_pace > Duration::zero() && alike(pace, review.odd_pace);
  review = {.begun = true, .newest = t, .odd_pace = other_pace ? pace : Duration::zero()};
  if (again) choose_again(gyro, pace, t);
}

// The buffered samples came at the old pace, or before the new one was found; they are dropped.
void Aligner::choose_again(std::size_t gyro, Duration interval, TimePoint behind) {
  reviewed_[gyro] = interval;
  reviews_ = {};
  chosen_ = false;
  for (std::size_t each = 0; each < 2; ++each) {
    const std::size_t gone = rings_[each].count_until(behind);
    if (each == pace_) counts_.unpaired[each] += gone;
    rings_[each].pop_front(gone);
    used_until_[each] = any_used_[each] ? std::max(used_until_[each], behind) : behind;
    any_used_[each] = true;
  }
}

// How long pairs would wait for the other gyro if `pace` set the instants, on average.
Duration Aligner::mean_wait(std::size_t pace, TimePoint until) const {
  const Ring& own = rings_[pace];
  const Ring& other = rings_[1 - pace];
  Duration sum{0};
  Duration::rep waited = 0;
  std::size_t next = 0;
  const std::size_t end = own.count_until(until);
  for (std::size_t i = end - std::min(end, kSamplesJudged); i < end; ++i) {
    while (next < other.size() && other[next].t < own[i].t)
      ++next;
    if (next == 0 || next == other.size()) continue;
    if (other[next].t - other[next - 1].t > gap_[1 - pace]) continue;
    const Duration wait = other[next].t + lag_[1 - pace] - (own[i].t + lag_[pace]);
    sum += std::max(wait, Duration::zero());
    ++waited;
  }
  return waited == 0 ? Duration::max() : sum / waited;
}

// Uses the samples up to one instant that both gyros have reached: the choice does not depend on
// which of two buses the kernel served first.
void Aligner::choose_pace() {
  if (std::min(rings_[0].size(), rings_[1].size()) < kSamplesToChoose) return;
  const TimePoint until =
      std::max(rings_[0][kSamplesToChoose - 1].t, rings_[1][kSamplesToChoose - 1].t);
  if (std::min(rings_[0].back().t, rings_[1].back().t) < until) return;
  for (std::size_t gyro = 0; gyro < 2; ++gyro) {
    const Ring& ring = rings_[gyro];
    const Duration usual = ring.usual_interval(until);
    interval_[gyro] =
        std::min(reviewed_[gyro] > Duration::zero() ? reviewed_[gyro] : usual, kIntervalMax);
    gap_[gyro] = from_seconds(to_seconds(interval_[gyro]) * kGapIntervals);
    const std::size_t last = ring.count_until(until) - 1;
    const TimePoint reached = ring[ring[last].t == until ? last : last + 1].t;
    burst_until_ = std::max(burst_until_, reached + lag_[gyro]);
  }
  const double ratio = to_seconds(interval_[0]) / to_seconds(interval_[1]);
  if (ratio > kSameRate) {
    pace_ = 0;
  } else if (ratio < 1.0 / kSameRate) {
    pace_ = 1;
  } else {
    pace_ = mean_wait(0, until) <= mean_wait(1, until) ? 0 : 1;
  }
  const bool averages = std::max(ratio, 1.0 / ratio) >= kAverageRatio;
  half_window_ = averages ? interval_[pace_] / 2 : Duration::zero();
  // The buffer holds samples from the previous pair to half a window after this one, and those that
  // come earlier by their lag.
  const double kept_s =
      2.0 * to_seconds(interval_[pace_]) + std::max(to_seconds(lag_[pace_] - lag_[1 - pace_]), 0.0);
  too_far_apart_ = kept_s > static_cast<double>(kCapacity) * to_seconds(interval_[1 - pace_]);
  chosen_ = true;
  ever_chosen_ = true;
}

// Drops samples that no pair at or after `needed` can use; the last one before it is still a
// neighbour.
void Aligner::drop_before(TimePoint needed, std::size_t gyro) {
  Ring& ring = rings_[gyro];
  std::size_t stale = 0;
  while (stale + 1 < ring.size() && ring[stale + 1].t <= needed)
    ++stale;
  if (stale == 0) return;
  used_until_[gyro] = ring[stale - 1].t;
  any_used_[gyro] = true;
  ring.pop_front(stale);
}

bool Aligner::pop_next(AlignedPair& pair) {
  Ring& own = rings_[pace_];
  const Ring& other = rings_[1 - pace_];
  while (!own.empty()) {
    pair.t = own[0].t;
    // While a pair waits, nothing is dropped: an earlier sample may still arrive late.
    if (other.empty() || other.back().t < pair.t + half_window_) return false;
    drop_before(pair.t - half_window_, 1 - pace_);
    const bool paired = half_window_ == Duration::zero() ? interpolate(other, pair, 1 - pace_)
                                                         : average(other, pair, 1 - pace_);
    pair.rate_dps[pace_] = own[0].rate_dps;
    pair.noise_gain[pace_] = 1.0;
    used_until_[pace_] = pair.t;
    any_used_[pace_] = true;
    own.pop_front();
    if (paired) {
      pair.complete =
          std::max(std::max(pair.complete + lag_[1 - pace_], pair.t + lag_[pace_]), burst_until_);
      return true;
    }
    ++counts_.unpaired[pace_];
  }
  return false;
}

bool Aligner::interpolate(const Ring& other, AlignedPair& pair, std::size_t other_index) {
  if (other[0].t > pair.t) return false;
  // pop_next() has left the last sample at or before the pair at index 0.
  const RateSample& before = other[0];
  if (before.t == pair.t) {
    pair.rate_dps[other_index] = before.rate_dps;
    pair.noise_gain[other_index] = 1.0;
    pair.complete = pair.t;
    return true;
  }
  const RateSample& after = other[1];
  if (after.t - before.t > gap_[other_index]) return false;
  pair.rate_dps[other_index] = line_at(pair.t, before.t, before.rate_dps, after.t, after.rate_dps);
  const double share = to_seconds(pair.t - before.t) / to_seconds(after.t - before.t);
  pair.noise_gain[other_index] = (1.0 - share) * (1.0 - share) + share * share;
  pair.complete = after.t;
  used_until_[other_index] = before.t;
  any_used_[other_index] = true;
  return true;
}

bool Aligner::average(const Ring& other, AlignedPair& pair, std::size_t other_index) {
  const TimePoint from = pair.t - half_window_;
  const TimePoint to = pair.t + half_window_;
  if (other[0].t > from) return false;
  double area = 0.0;
  for (std::size_t i = 0; i + 1 < other.size() && other[i].t < to; ++i) {
    const RateSample& a = other[i];
    const RateSample& b = other[i + 1];
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
  pair.noise_gain[other_index] = to_seconds(interval_[other_index]) / to_seconds(to - from);
  return true;
}

bool Aligner::next_behind(std::size_t gyro, TimePoint t, TimePoint& sample_t,
                          double& rate_dps) const {
  const Ring& ring = rings_[gyro];
  std::size_t first = ring.size();
  while (first > 0 && ring[first - 1].t > t)
    --first;
  if (first == ring.size()) return false;
  sample_t = ring[first].t;
  rate_dps = ring[first].rate_dps;
  return true;
}

void Aligner::clear() {
  for (Ring& ring : rings_)
    ring.clear();
  any_used_ = {};
  reviews_ = {};
}

}  // namespace vgyro::fusion

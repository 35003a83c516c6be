#include "gap/rest.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <utility>

#include "analysis/rest.h"

namespace vgyro::gap {

namespace {

// Between samples that are further apart than this many intervals nothing is known.
constexpr double kHole = 2.5;

// A stop is judged by pieces of about this length, and a drift moves less within one than its noise
// lets see; of a shorter stop than the second the mean is too noisy to be taken off.
constexpr double kPiece_s = 10.0;
constexpr double kStopMin_s = 3.0;

// What a gyro reads too much, in the middle of a piece of a stop.
struct Offset {
  double t_s = 0.0;
  double rate_dps = 0.0;
};

// Of the samples from `from` to `end`, all of one stop.
void add_offsets(std::span<const double> t_s, std::span<const double> rate_dps, std::size_t from,
                 std::size_t end, std::vector<Offset>& offsets) {
  const double length_s = t_s[end - 1] - t_s[from];
  if (length_s < kStopMin_s) return;
  const auto pieces = static_cast<std::size_t>(std::ceil(length_s / kPiece_s));
  for (std::size_t piece = 0; piece < pieces; ++piece) {
    const std::size_t first = from + (end - from) * piece / pieces;
    const std::size_t last = from + (end - from) * (piece + 1) / pieces;
    if (first == last) continue;
    Offset sum;
    for (std::size_t i = first; i < last; ++i) {
      sum.t_s += t_s[i];
      sum.rate_dps += rate_dps[i];
    }
    const auto count = static_cast<double>(last - first);
    offsets.push_back({sum.t_s / count, sum.rate_dps / count});
  }
}

std::vector<Offset> offsets_at_rest(const RestingSeconds& rest, std::span<const double> t_s,
                                    std::span<const double> rate_dps) {
  std::vector<Offset> offsets;
  std::size_t from = 0;
  for (std::size_t i = 0; i <= t_s.size(); ++i) {
    if (i < t_s.size() && rest.deep_at(t_s[i])) continue;
    if (i > from) add_offsets(t_s, rate_dps, from, i, offsets);
    from = i + 1;
  }
  return offsets;
}

// Offers pairs of rates at the instants of the slower gyro, the faster one's straight between its
// samples. What is masked counts too, because a dead band rests on 0; but no spike.
class Pairs {
 public:
  Pairs(const Recording& recording, const std::array<Transport, 2>& transports)
      : recording_(recording),
        transports_(transports),
        pace_(transports[0].interval_s >= transports[1].interval_s ? 0 : 1) {}

  void offer(analysis::RestFinder& finder) {
    const std::size_t other = 1 - pace_;
    const double reach_s = kHole * transports_[other].interval_s;
    const std::vector<double>& t_s = transports_[pace_].t_s;
    const std::vector<double>& other_s = transports_[other].t_s;
    std::size_t before = 0;
    std::size_t after = 0;  // the first usable one at or behind the instant
    for (std::size_t i = 0; i < t_s.size(); ++i) {
      if (is_spike(pace_, i)) continue;
      while (after < other_s.size() && (other_s[after] < t_s[i] || is_spike(other, after))) {
        if (!is_spike(other, after)) before = after;
        ++after;
      }
      if (after == other_s.size()) break;
      const double span_s = other_s[after] - other_s[before];
      if (other_s[before] > t_s[i] || span_s > reach_s) continue;
      const double share = span_s > 0.0 ? (t_s[i] - other_s[before]) / span_s : 0.0;
      std::array<double, 2> rate_dps{};
      rate_dps[pace_] = rate(pace_, i);
      rate_dps[other] = rate(other, before) + share * (rate(other, after) - rate(other, before));
      finder.add(t_s[i], rate_dps);
    }
  }

 private:
  [[nodiscard]] double rate(std::size_t gyro, std::size_t i) const {
    return recording_.gyros[gyro].rate_dps[i];
  }
  [[nodiscard]] bool is_spike(std::size_t gyro, std::size_t i) const {
    return transports_[gyro].masked[i] == kSpike;
  }

  const Recording& recording_;
  const std::array<Transport, 2>& transports_;
  std::size_t pace_;  ///< the slower gyro
};

}  // namespace

RestingSeconds::RestingSeconds(std::vector<std::uint8_t> rests) : rests_(std::move(rests)) {
  for (const std::uint8_t rest : rests_)
    count_ += rest;
}

bool RestingSeconds::at(double t_s) const {
  const auto cell = static_cast<std::size_t>(std::max(0.0, t_s));
  return cell < rests_.size() && rests_[cell] != 0;
}

bool RestingSeconds::deep_at(double t_s) const {
  return at(t_s - kEdge_s) && at(t_s) && at(t_s + kEdge_s);
}

void take_off_drift_at_rest(const RestingSeconds& rest, std::span<const double> t_s,
                            double rest_dps, std::vector<double>& rate_dps) {
  const std::vector<Offset> offsets = offsets_at_rest(rest, t_s, rate_dps);
  if (offsets.empty()) return;
  std::size_t next = 0;  // the first offset behind the instant
  for (std::size_t i = 0; i < t_s.size(); ++i) {
    while (next < offsets.size() && offsets[next].t_s <= t_s[i])
      ++next;
    const Offset& after = offsets[std::min(next, offsets.size() - 1)];
    const Offset& before = offsets[next > 0 ? next - 1 : 0];
    const double span_s = after.t_s - before.t_s;
    const double share = span_s > 0.0 ? (t_s[i] - before.t_s) / span_s : 0.0;
    rate_dps[i] -= before.rate_dps + share * (after.rate_dps - before.rate_dps) - rest_dps;
  }
}

RestingSeconds find_rest(const Recording& recording, const std::array<Transport, 2>& transports) {
  analysis::RestFinder finder(
      {.interval_s = std::max(transports[0].interval_s, transports[1].interval_s),
       .step_dps = {transports[0].lattice_dps, transports[1].lattice_dps},
       .rate_dps = recording.rest_rate_dps,
       .by_each_alone = true});
  Pairs(recording, transports).offer(finder);
  std::vector<std::uint8_t> resting(static_cast<std::size_t>(recording.seconds) + 1, 0);
  for (const analysis::RestPart& part : finder.find()) {
    const auto from = static_cast<std::size_t>(std::max(0.0, part.stretch.from_s));
    const auto to = static_cast<std::size_t>(std::max(0.0, part.stretch.to_s));
    for (std::size_t second = from; second < std::min(to, resting.size()); ++second)
      resting[second] = 1;
  }
  return RestingSeconds(resting);
}

}  // namespace vgyro::gap

#include "gap/rest.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <optional>
#include <span>
#include <utility>

#include "gap/median.h"

namespace vgyro::gap {

namespace {

// A second with fewer samples tells neither mean nor scatter.
constexpr double kSamplesMin = 5.0;
// The beginning, where a recording does not say how long it rests.
constexpr double kStart_s = 5.0;
// Whatever reads further from the beginning turns, however steadily: a gyro at its limit is
// steadier than any at rest.
constexpr double kNear_dps = 2.0;
// Of these seconds a tenth must be one at least.
constexpr std::size_t kNearSecondsMin = 10;
// The share of the seconds near the beginning that is surely at rest: its widest scatter is the
// gyro's at rest.
constexpr std::size_t kQuietOneIn = 10;
// A second scatters at rest up to this times the quiet ones: they are the tenth with the least.
constexpr double kSteady = 3.0;
// A bias drifts by less in a recording; added to it is what noise moves the mean of a second.
constexpr double kDrift_dps = 0.15;
constexpr double kMeanSigmas = 3.0;
// Shorter rests are turning points of a motion.
constexpr std::size_t kRestMin_s = 4;

// One gyro's reading in a second.
struct Second {
  double count = 0.0;
  double mean_dps = 0.0;
  double deviation_dps = 0.0;

  [[nodiscard]] bool tells() const { return count >= kSamplesMin; }
};

std::vector<Second> seconds_of(const GyroSeries& series, const Transport& transport,
                               std::size_t cells) {
  std::vector<double> squares(cells, 0.0);
  std::vector<Second> seconds(cells);
  // What is masked too: a dead band rests on 0.
  for (std::size_t i = 0; i < transport.t_s.size(); ++i) {
    const auto cell =
        std::min(cells - 1, static_cast<std::size_t>(std::max(0.0, transport.t_s[i])));
    const double rate_dps = series.rate_dps[i];
    seconds[cell].mean_dps += rate_dps;
    squares[cell] += rate_dps * rate_dps;
    seconds[cell].count += 1.0;
  }
  for (std::size_t cell = 0; cell < cells; ++cell) {
    Second& second = seconds[cell];
    if (!second.tells()) continue;
    second.mean_dps /= second.count;
    const double variance = squares[cell] / second.count - second.mean_dps * second.mean_dps;
    second.deviation_dps = std::sqrt(std::max(0.0, variance));
  }
  return seconds;
}

// What a gyro is like at rest.
struct Quiet {
  double mean_dps = 0.0;
  double deviation_dps = 0.0;
};

// Nothing when too few seconds are near what it reads in the beginning.
std::optional<Quiet> quiet_of(const std::vector<Second>& seconds, double rest_s, double step_dps) {
  std::vector<double> first;
  for (std::size_t cell = 0; cell < seconds.size(); ++cell) {
    if (static_cast<double>(cell) < std::max(kStart_s, rest_s) && seconds[cell].tells())
      first.push_back(seconds[cell].mean_dps);
  }
  if (first.empty()) return {};
  const double start_dps = median_of(first);
  std::vector<double> deviations;
  for (const Second& second : seconds) {
    if (second.tells() && std::abs(second.mean_dps - start_dps) < kNear_dps)
      deviations.push_back(second.deviation_dps);
  }
  if (deviations.size() < kNearSecondsMin) return {};
  std::sort(deviations.begin(), deviations.end());
  // Within rounding every second is as steady as another.
  return Quiet{start_dps, std::max(deviations[deviations.size() / kQuietOneIn], step_dps)};
}

bool rests(const Second& second, const Quiet& quiet) {
  return second.tells() && second.deviation_dps <= kSteady * quiet.deviation_dps &&
         std::abs(second.mean_dps - quiet.mean_dps) <=
             kDrift_dps + kMeanSigmas * quiet.deviation_dps;
}

// Without single seconds, and without the first and last of each rest, which may hold the end of a
// motion; before the recording begins and after it ends there is none.
std::vector<std::uint8_t> inner(const std::vector<std::uint8_t>& rests) {
  const std::size_t cells = rests.size();
  std::vector<std::uint8_t> kept(cells, 0);
  for (std::size_t from = 0; from < cells;) {
    std::size_t to = from;
    while (to < cells && rests[to] != 0)
      ++to;
    if (to - from >= kRestMin_s) {
      const std::size_t first = from == 0 ? 0 : from + 1;
      const std::size_t last = to == cells ? to : to - 1;
      for (std::size_t cell = first; cell < last; ++cell)
        kept[cell] = 1;
    }
    from = std::max(to, from + 1);
  }
  return kept;
}

}  // namespace

RestingSeconds::RestingSeconds(std::vector<std::uint8_t> rests) : rests_(std::move(rests)) {
  for (const std::uint8_t rest : rests_)
    count_ += rest;
}

bool RestingSeconds::at(double t_s) const {
  const auto cell = static_cast<std::size_t>(std::max(0.0, t_s));
  return cell < rests_.size() && rests_[cell] != 0;
}

RestingSeconds find_rest(const Recording& recording, const std::array<Transport, 2>& transports) {
  const auto cells = static_cast<std::size_t>(recording.seconds) + 1;
  std::vector<std::uint8_t> resting(cells, 1);
  for (std::size_t gyro = 0; gyro < 2; ++gyro) {
    const GyroSeries& series = recording.gyros[gyro];
    const std::vector<Second> seconds = seconds_of(series, transports[gyro], cells);
    const std::optional<Quiet> quiet = quiet_of(seconds, recording.rest_s, series.step_dps);
    if (!quiet) return {};
    for (std::size_t cell = 0; cell < cells; ++cell) {
      if (!rests(seconds[cell], *quiet)) resting[cell] = 0;
    }
  }
  return RestingSeconds(inner(resting));
}

}  // namespace vgyro::gap

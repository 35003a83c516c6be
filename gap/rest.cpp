#include "gap/rest.h"

#include <algorithm>
#include <cmath>
#include <span>

#include "gap/median.h"
namespace vgyro::gap {
constexpr double kRestNear_dps = 2.0;
constexpr double kRestBelow_dps = 0.15;
constexpr double kRestSteady = 3.0;
// Seconds in which both gyros are as steady as in their steadiest seconds and read what they read
// in the beginning.
Rest find_rest(const Recording& recording_, const std::array<Transport, 2>& transports_) {
  std::vector<std::uint8_t> resting_;
  double rest_s_ = 0.0;
  const auto cells = static_cast<std::size_t>(recording_.seconds) + 1;
  resting_.assign(cells, 1);
  for (std::size_t gyro = 0; gyro < 2; ++gyro) {
    // What is masked too: a dead band rests on 0.
    const std::span<const double> t_s = transports_[gyro].t_s;
    const std::span<const double> rate = recording_.gyros[gyro].rate_dps;
    std::vector<double> sum(cells, 0.0), squares(cells, 0.0), count(cells, 0.0);
    for (std::size_t i = 0; i < t_s.size(); ++i) {
      const std::size_t cell = std::min(cells - 1, static_cast<std::size_t>(std::max(0.0, t_s[i])));
      sum[cell] += rate[i], squares[cell] += rate[i] * rate[i], count[cell] += 1.0;
    }
    std::vector<double> first;
    std::vector<double> deviation(cells, 1e300);
    for (std::size_t cell = 0; cell < cells; ++cell) {
      if (count[cell] < 5.0) continue;
      const double mean = sum[cell] / count[cell];
      deviation[cell] = std::sqrt(std::max(0.0, squares[cell] / count[cell] - mean * mean));
      if (static_cast<double>(cell) < std::max(5.0, recording_.rest_s)) first.push_back(mean);
    }
    // A gyro at its limit is steadier than any at rest.
    std::vector<double> deviations;
    const double start = first.empty() ? 0.0 : median_of(first);
    for (std::size_t cell = 0; cell < cells; ++cell) {
      if (count[cell] >= 5.0 && std::abs(sum[cell] / count[cell] - start) < kRestNear_dps)
        deviations.push_back(deviation[cell]);
    }
    if (deviations.size() < 10 || first.empty()) {
      resting_.assign(cells, 0);
      return {};
    }
    std::sort(deviations.begin(), deviations.end());
    const double quiet =
        std::max(deviations[deviations.size() / 10], recording_.gyros[gyro].step_dps);
    for (std::size_t cell = 0; cell < cells; ++cell) {
      if (count[cell] < 5.0 || deviation[cell] > kRestSteady * quiet ||
          std::abs(sum[cell] / count[cell] - start) > kRestBelow_dps + 3.0 * quiet) {
        resting_[cell] = 0;
      }
    }
  }
  // Single seconds are turning points of a motion.
  std::vector<std::uint8_t> kept(cells, 0);
  for (std::size_t from = 0; from < cells;) {
    std::size_t to = from;
    while (to < cells && resting_[to] != 0)
      ++to;
    if (to - from >= 4) {
      // Its first and last second may hold the end of a motion.
      const std::size_t first = from == 0 ? 0 : from + 1;
      const std::size_t last = to == cells ? to : to - 1;
      for (std::size_t cell = first; cell < last; ++cell)
        kept[cell] = 1, rest_s_ += 1.0;
    }
    from = std::max(to, from + 1);
  }
  return {kept, rest_s_};
}

}  // namespace vgyro::gap

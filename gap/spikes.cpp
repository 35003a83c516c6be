#include "gap/spikes.h"

#include <algorithm>
#include <cmath>

#include <fmt/core.h>

#include "gap/curve.h"
#include "gap/median.h"
namespace vgyro::gap {
using model::Effect;
using model::Kind;
constexpr double kSpikeSigmas = 6.5;
constexpr std::size_t kSpikesMin = 3;
// One sample that stands out from its four neighbours, seen against the reference or the other
// gyro.
std::vector<Finding> find_spikes(const Recording& recording_, std::array<Transport, 2>& transports_,
                                 const std::vector<Effect>& effects) {
  std::vector<Finding> findings_;
  std::array<std::vector<double>, 2> out;
  std::array<std::vector<double>, 2> scale;
  for (std::size_t gyro = 0; gyro < 2; ++gyro) {
    const GyroSeries& series = recording_.gyros[gyro];
    const std::vector<double>& t_s = transports_[gyro].t_s;
    const std::size_t n = series.t_s.size();
    const SampledCurve truth =
        recording_.has_reference
            ? SampledCurve(recording_.reference_dps.t_s, recording_.reference_dps.value)
            : SampledCurve(transports_[1 - gyro].t_s, recording_.gyros[1 - gyro].rate_dps);
    const auto covered = [&](double at_s) { return at_s > truth.from_s() && at_s < truth.to_s(); };
    std::vector<double> error(n);
    for (std::size_t i = 0; i < n; ++i)
      error[i] = series.rate_dps[i] - truth.at(t_s[i]).value;
    out[gyro].assign(n, 0.0);
    scale[gyro].assign(n, 0.0);
    const std::vector<std::uint8_t>& masked = transports_[gyro].masked;
    for (std::size_t i = 2; i + 2 < n; ++i) {
      if (masked[i - 2] + masked[i - 1] + masked[i] + masked[i + 1] + masked[i + 2] > 0) continue;
      if (!covered(t_s[i - 2]) || !covered(t_s[i + 2])) continue;
      std::array<double, 4> near{error[i - 2], error[i - 1], error[i + 1], error[i + 2]};
      std::sort(near.begin(), near.end());
      out[gyro][i] = error[i] - 0.5 * (near[1] + near[2]);
    }
    const std::size_t reach =
        static_cast<std::size_t>(std::clamp(0.75 / transports_[gyro].interval_s, 20.0, 1000.0));
    // Scatter of each short stretch; a sample is judged by the widest of three, because noise may
    // rise with the rate.
    std::vector<double> sigmas;
    std::vector<double> window;
    for (std::size_t from = 0; from < n; from += reach) {
      window.clear();
      for (std::size_t i = from; i < std::min(n, from + reach); ++i) {
        if (out[gyro][i] != 0.0) window.push_back(std::abs(out[gyro][i]));
      }
      sigmas.push_back(window.size() < 10 ? 0.0 : 1.4826 * median_of(window));
    }
    for (std::size_t i = 0; i < n; ++i) {
      const std::size_t cell = i / reach;
      double widest = sigmas[cell];
      if (cell > 0) widest = std::max(widest, sigmas[cell - 1]);
      if (cell + 1 < sigmas.size()) widest = std::max(widest, sigmas[cell + 1]);
      // Nowhere near enough good neighbours: nothing stands out.
      scale[gyro][i] = sigmas[cell] > 0.0 ? widest : 0.0;
    }
  }
  for (std::size_t gyro = 0; gyro < 2; ++gyro) {
    const GyroSeries& series = recording_.gyros[gyro];
    Transport& transport = transports_[gyro];
    std::vector<double> sizes;
    Curve marks{"deviation from the neighbours", {}, {}, {}, true};
    double last_s = -1.0;
    for (std::size_t i = 2; i + 2 < series.t_s.size(); ++i) {
      if (transport.masked[i] != 0 || scale[gyro][i] <= 0.0) continue;
      const double size = std::abs(out[gyro][i]);
      if (size < std::max(kSpikeSigmas * scale[gyro][i], 2.5 * transport.lattice_dps)) continue;
      if (size < std::abs(out[gyro][i - 1]) || size < std::abs(out[gyro][i + 1])) continue;
      if (!recording_.has_reference) {
        // Whose it is: interpolation spreads the other's.
        const std::vector<double>& t_s = transports_[1 - gyro].t_s;
        const auto near = std::lower_bound(t_s.begin(), t_s.end(), transport.t_s[i]) - t_s.begin();
        bool others = false;
        for (std::ptrdiff_t j = near - 2; j <= near + 1; ++j) {
          if (j < 2 || j + 2 >= static_cast<std::ptrdiff_t>(t_s.size())) continue;
          others = others || std::abs(out[1 - gyro][static_cast<std::size_t>(j)]) > size ||
                   transports_[1 - gyro].masked[static_cast<std::size_t>(j)] != 0;
        }
        if (others) continue;
      }
      transport.masked[i] = 1;
      sizes.push_back(size);
      marks.x.push_back(series.t_s[i]);
      marks.y.push_back(out[gyro][i]);
      last_s = series.t_s[i];
    }
    bool known = false;
    for (const Effect& effect : effects)
      known = known || (effect.gyro == gyro && effect.kind == Kind::kSpikes);
    if (known || sizes.size() < kSpikesMin) continue;
    const double count = static_cast<double>(sizes.size());
    const double typical = median_of(sizes);
    double noise = 0.0;
    for (const double sigma : scale[gyro])
      noise += sigma;
    noise /= static_cast<double>(scale[gyro].size());
    Finding finding;
    finding.effect = Effect{gyro, Kind::kSpikes, {count / recording_.seconds, typical}, 0};
    finding.sigma = {std::sqrt(count) / recording_.seconds, 1.25 * noise / std::sqrt(count)};
    finding.statistic = count * (typical / noise) * (typical / noise);
    finding.p_value = 1e-6;
    finding.where = {marks.x.front(), last_s, 0.0, 0.5 / transport.interval_s};
    finding.evidence = fmt::format(
        "{:.0f} single samples of {} stand out by about {:.3g} deg/s, {:.0f} "
        "times the noise",
        count, series.name, typical, typical / noise);
    finding.figure = Figure{"Samples that stand out", "time / s", "deg/s", false, false, {marks}};
    findings_.push_back(std::move(finding));
  }
  return findings_;
}
}  // namespace vgyro::gap

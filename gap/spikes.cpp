#include "gap/spikes.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <span>

#include <fmt/core.h>

#include "gap/curve.h"
#include "gap/median.h"

namespace vgyro::gap {

namespace {

using model::Effect;
using model::Kind;

// Normal noise reaches this once in 10¹⁰ samples: not in a recording of a day.
constexpr double kSpikeSigmas = 6.5;
// A deviation from the neighbours of two lattice steps is rounding.
constexpr double kSpikeLatticeSteps = 2.5;
// One or two are an accident, not a property of the gyro.
constexpr std::size_t kSpikesMin = 3;
// Neighbours on each side. Two leave a middle pair when one of the four is a spike itself.
constexpr std::size_t kNeighbours = 2;
// Stretches over which the scatter is taken: short, because noise may rise with the rate, but with
// enough samples for a median, and at a high rate no longer than the median is worth.
constexpr double kStretch_s = 0.75;
constexpr double kStretchSamplesMin = 20.0;
constexpr double kStretchSamplesMax = 1000.0;
// With fewer samples that can be judged a stretch's median says nothing.
constexpr std::size_t kJudgedMin = 10;
// Standard deviation of normal noise over the median of its magnitude.
constexpr double kSigmaPerMedian = 1.4826;
// Samples about an instant whose own neighbours tell how well the curve is known there, and what of
// that is noise: three standard deviations.
constexpr std::size_t kUnsureReach = 3;
constexpr double kNoiseSigmas = 3.0;
// Times the rest, as a knock in between may be off; a spike of the curve itself is off by itself.
constexpr double kUnsure = 1.5;
// Standard error of a median over that of a mean: √(π/2).
constexpr double kMedianError = 1.25;

// How each sample of one gyro stands to its neighbours.
struct Standing {
  std::vector<double> out_dps;     // deviation from their median; 0: cannot be judged
  std::vector<double> sigma_dps;   // scatter of the deviations about there; 0: nothing stands out
  std::vector<double> unsure_dps;  // what it is seen against is no better known there
};

// What gyro k is seen against.
SampledCurve truth_for(const Recording& recording, const Timing& timing,
                       const std::array<Transport, 2>& transports, std::size_t gyro) {
  if (recording.has_reference) return {timing.reference_dps.t_s, timing.reference_dps.value};
  return {transports[1 - gyro].t_s, recording.gyros[1 - gyro].rate_dps};
}

std::vector<double> deviations_dps(const GyroSeries& series, const Transport& transport,
                                   const SampledCurve& truth, const Lag& lag) {
  const std::vector<double>& t_s = transport.t_s;
  const std::size_t n = series.t_s.size();
  const auto felt_s = [&](std::size_t i) { return t_s[i] - lag.at(t_s[i]); };
  const auto covered = [&](std::size_t i) {
    return felt_s(i) > truth.from_s() && felt_s(i) < truth.to_s();
  };
  std::vector<double> error(n);
  for (std::size_t i = 0; i < n; ++i)
    error[i] = series.rate_dps[i] - truth.nearby(felt_s(i)).value;
  std::vector<double> out(n, 0.0);
  for (std::size_t i = kNeighbours; i + kNeighbours < n; ++i) {
    const auto from = transport.masked.begin() + static_cast<std::ptrdiff_t>(i - kNeighbours);
    const auto unusable = [](std::uint8_t mask) { return mask != 0; };
    if (std::any_of(from, from + 2 * kNeighbours + 1, unusable)) continue;
    if (!covered(i - kNeighbours) || !covered(i + kNeighbours)) continue;
    std::array<double, 2 * kNeighbours> near{error[i - 2], error[i - 1], error[i + 1],
                                             error[i + 2]};
    std::sort(near.begin(), near.end());
    out[i] = error[i] - 0.5 * (near[kNeighbours - 1] + near[kNeighbours]);
  }
  return out;
}

// Of each stretch of so many samples; 0 where too few can be judged.
std::vector<double> stretch_sigmas_dps(const std::vector<double>& out, std::size_t stretch) {
  std::vector<double> sigmas;
  std::vector<double> sizes;
  for (std::size_t from = 0; from < out.size(); from += stretch) {
    sizes.clear();
    for (std::size_t i = from; i < std::min(out.size(), from + stretch); ++i) {
      if (out[i] != 0.0) sizes.push_back(std::abs(out[i]));
    }
    sigmas.push_back(sizes.size() < kJudgedMin ? 0.0 : kSigmaPerMedian * median_of(sizes));
  }
  return sigmas;
}

// A sample is judged by the widest of its stretch and the two beside, because noise may rise with
// the rate.
std::vector<double> sigmas_dps(const std::vector<double>& out, double interval_s) {
  const auto stretch = static_cast<std::size_t>(
      std::clamp(kStretch_s / interval_s, kStretchSamplesMin, kStretchSamplesMax));
  const std::vector<double> of_stretch = stretch_sigmas_dps(out, stretch);
  std::vector<double> sigmas(out.size(), 0.0);
  for (std::size_t i = 0; i < out.size(); ++i) {
    const std::size_t own = i / stretch;
    // Nowhere near enough good neighbours: nothing stands out.
    if (of_stretch[own] <= 0.0) continue;
    sigmas[i] = of_stretch[own];
    if (own > 0) sigmas[i] = std::max(sigmas[i], of_stretch[own - 1]);
    if (own + 1 < of_stretch.size()) sigmas[i] = std::max(sigmas[i], of_stretch[own + 1]);
  }
  return sigmas;
}

// How far each sample of a curve is from what its six neighbours let expect, beyond its noise: in a
// knock that is quicker than its samples nothing tells what was between them. The widest about
// each.
std::vector<double> unsure_dps(const SampledCurve& truth) {
  const std::span<const double> y = truth.values();
  std::vector<double> off(y.size(), 0.0);
  for (std::size_t i = 3; i + 3 < y.size(); ++i) {
    const double sixth = y[i - 3] + y[i + 3] - 6.0 * (y[i - 2] + y[i + 2]) +
                         15.0 * (y[i - 1] + y[i + 1]) - 20.0 * y[i];
    off[i] = std::abs(sixth) / 20.0;
  }
  std::vector<double> sizes = off;
  const double noise_dps = sizes.empty() ? 0.0 : kNoiseSigmas * kSigmaPerMedian * median_of(sizes);
  std::vector<double> widest(off.size(), 0.0);
  for (std::size_t i = 0; i < off.size(); ++i) {
    const std::size_t from = i - std::min<std::size_t>(i, kUnsureReach);
    const std::size_t to = std::min(off.size(), i + kUnsureReach + 1);
    for (std::size_t k = from; k < to; ++k)
      widest[i] = std::max(widest[i], kUnsure * (off[k] - noise_dps));
  }
  return widest;
}

// At each of a gyro's samples.
std::vector<double> unsure_at(const Transport& transport, const SampledCurve& truth,
                              const Lag& lag) {
  const std::vector<double> widest = unsure_dps(truth);
  const std::span<const double> truth_s = truth.times_s();
  std::vector<double> unsure;
  if (widest.empty()) return std::vector<double>(transport.t_s.size(), 0.0);
  unsure.reserve(transport.t_s.size());
  for (const double t_s : transport.t_s) {
    const auto at = std::lower_bound(truth_s.begin(), truth_s.end(), t_s - lag.at(t_s));
    const auto place = static_cast<std::size_t>(at - truth_s.begin());
    unsure.push_back(widest[std::min(place, widest.size() - 1)]);
  }
  return unsure;
}

Standing standing_of(const Recording& recording, const Timing& timing,
                     const std::array<Transport, 2>& transports, std::size_t gyro) {
  Standing standing;
  const SampledCurve truth = truth_for(recording, timing, transports, gyro);
  const Lag& lag = timing.lag[gyro];
  standing.out_dps = deviations_dps(recording.gyros[gyro], transports[gyro], truth, lag);
  standing.unsure_dps = unsure_at(transports[gyro], truth, lag);
  standing.sigma_dps = sigmas_dps(standing.out_dps, transports[gyro].interval_s);
  return standing;
}

bool stands_out(const Standing& standing, std::size_t i, double lattice_dps) {
  if (standing.sigma_dps[i] <= 0.0) return false;
  const double size = std::abs(standing.out_dps[i]);
  if (size < std::max({kSpikeSigmas * standing.sigma_dps[i], kSpikeLatticeSteps * lattice_dps,
                       standing.unsure_dps[i]}))
    return false;
  return size >= std::abs(standing.out_dps[i - 1]) && size >= std::abs(standing.out_dps[i + 1]);
}

// Without a reference a spike shows in both gyros' deviations, and interpolation spreads the
// other's over the four samples about its instant.
bool is_others(const Standing& others, const Transport& transport, double at_s, double size_dps) {
  const std::vector<double>& t_s = transport.t_s;
  const std::ptrdiff_t near = std::lower_bound(t_s.begin(), t_s.end(), at_s) - t_s.begin();
  constexpr auto kReach = static_cast<std::ptrdiff_t>(kNeighbours);
  for (std::ptrdiff_t j = near - kReach; j < near + kReach; ++j) {
    if (j < kReach || j + kReach >= static_cast<std::ptrdiff_t>(t_s.size())) continue;
    const auto place = static_cast<std::size_t>(j);
    // What it is seen against, this gyro, is the rougher one there: it is not the other's.
    const double out_dps = std::abs(others.out_dps[place]);
    const bool larger = out_dps > size_dps && out_dps > others.unsure_dps[place];
    if (larger || transport.masked[place] != 0) return true;
  }
  return false;
}

// Indices of a gyro's spikes, which are masked.
std::vector<std::size_t> mask_spikes(const Recording& recording, const Timing& timing,
                                     std::array<Transport, 2>& transports,
                                     const std::array<Standing, 2>& standings, std::size_t gyro) {
  Transport& transport = transports[gyro];
  const std::size_t other = 1 - gyro;
  std::vector<std::size_t> spikes;
  for (std::size_t i = kNeighbours; i + kNeighbours < transport.t_s.size(); ++i) {
    if (transport.masked[i] != 0 || !stands_out(standings[gyro], i, transport.lattice_dps))
      continue;
    const double size_dps = std::abs(standings[gyro].out_dps[i]);
    if (!recording.has_reference &&
        is_others(standings[other], transports[other],
                  transport.t_s[i] - timing.lag[gyro].at(transport.t_s[i]), size_dps))
      continue;
    transport.masked[i] = kSpike;
    spikes.push_back(i);
  }
  return spikes;
}

// Precondition: there are spikes.
Finding finding_of(const Recording& recording, const Transport& transport, const Standing& standing,
                   const std::vector<std::size_t>& spikes, std::size_t gyro) {
  const GyroSeries& series = recording.gyros[gyro];
  std::vector<double> sizes;
  Curve marks{"deviation from the neighbours", {}, {}, {}, true};
  for (const std::size_t i : spikes) {
    sizes.push_back(std::abs(standing.out_dps[i]));
    marks.x.push_back(series.t_s[i]);
    marks.y.push_back(standing.out_dps[i]);
  }
  const double count = static_cast<double>(sizes.size());
  const double typical = median_of(sizes);
  double noise = 0.0;
  for (const double sigma : standing.sigma_dps)
    noise += sigma;
  noise /= static_cast<double>(standing.sigma_dps.size());
  Finding finding;
  finding.effect = Effect{gyro, Kind::kSpikes, {count / recording.seconds, typical}, 0};
  finding.sigma = {std::sqrt(count) / recording.seconds, kMedianError * noise / std::sqrt(count)};
  finding.statistic = count * (typical / noise) * (typical / noise);
  finding.p_value = kFoundPValue;
  finding.cost_nats = finding.effect.parameters[0] * recording.seconds * kImpossibleNats;
  finding.where = {marks.x.front(), marks.x.back(), 0.0, 0.5 / transport.interval_s};
  finding.evidence = fmt::format(
      "{:.0f} single samples of {} stand out by about {:.3g} deg/s, {:.0f} "
      "times the noise",
      count, series.name, typical, typical / noise);
  finding.figure = Figure{"Samples that stand out", "time / s", "deg/s", false, false, {marks}};
  return finding;
}

}  // namespace

std::vector<Finding> find_spikes(const Recording& recording, const Timing& timing,
                                 std::array<Transport, 2>& transports,
                                 const std::vector<Effect>& known) {
  // Of both before any is masked: a spike must not hide the other gyro's.
  const std::array<Standing, 2> standings{standing_of(recording, timing, transports, 0),
                                          standing_of(recording, timing, transports, 1)};
  std::vector<Finding> findings;
  for (std::size_t gyro = 0; gyro < 2; ++gyro) {
    const std::vector<std::size_t> spikes =
        mask_spikes(recording, timing, transports, standings, gyro);
    count_masked(transports[gyro]);
    const bool told = std::any_of(known.begin(), known.end(), [&](const Effect& effect) {
      return effect.gyro == gyro && effect.kind == Kind::kSpikes;
    });
    if (told || spikes.size() < kSpikesMin) continue;
    findings.push_back(finding_of(recording, transports[gyro], standings[gyro], spikes, gyro));
  }
  return findings;
}

}  // namespace vgyro::gap

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
// With fewer samples that can be judged a stretch's median says nothing; with fewer in one place it
// says too little to be preferred.
constexpr std::size_t kJudgedMin = 10;
constexpr std::size_t kJudgedOfPlaceMin = 20;
// What interpolation errs by depends on where between two samples one looks: at one of them,
// half-way, or in between. A reference half as fast as a gyro is right at every second sample, and
// folds the road at the others.
constexpr std::size_t kPlaces = 3;
// Standard deviation of normal noise over the median of its magnitude.
constexpr double kSigmaPerMedian = 1.4826;
// The tail begins where five of a hundred are beyond: more than ever were spikes.
constexpr double kTailShare = 0.05;
// Of normal noise: its tail begins at so many medians.
constexpr double kTailPerMedian = 2.906;
// Normal noise has its median here when it is judged by the widest of three stretches. It is less
// where rounding leaves most deviations nothing, which says nothing of the tail.
constexpr double kMedianMin_sigmas = 0.54;
// What stands out of both gyros at once is the reference's: in the other one it is no chance, and
// of a like size. What is between two samples of one may be on a sample of the other.
constexpr double kCommonSigmas = 4.0;
constexpr double kCommonShare = 0.5;
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
  std::vector<std::size_t> place;  // where between two samples of what it is seen against
  std::array<double, kPlaces> tail{};  // by place: how much further deviations reach than normal
  double against_s = 0.0;              // interval of what it is seen against
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

// Where each sample falls between two of what it is seen against.
std::vector<std::size_t> places_of(const Transport& transport, const SampledCurve& truth,
                                   const Lag& lag) {
  const std::span<const double> truth_s = truth.times_s();
  std::vector<std::size_t> places(transport.t_s.size(), 0);
  if (truth.empty()) return places;
  const double half_s = 0.5 * truth.interval_s();
  for (std::size_t i = 0; i < places.size(); ++i) {
    const double felt_s = transport.t_s[i] - lag.at(transport.t_s[i]);
    const auto behind = std::lower_bound(truth_s.begin() + 1, truth_s.end() - 1, felt_s);
    const double apart_s = std::min(std::abs(felt_s - *(behind - 1)), std::abs(*behind - felt_s));
    places[i] = static_cast<std::size_t>(std::min(kPlaces - 1.0, kPlaces * apart_s / half_s));
  }
  return places;
}

// A sample is judged by the widest of its stretch and the two beside, because noise may rise with
// the rate. 0: nowhere near enough good neighbours.
std::vector<double> widest_of_three(const std::vector<double>& sigmas) {
  std::vector<double> widest = sigmas;
  for (std::size_t i = 0; i < sigmas.size(); ++i) {
    if (sigmas[i] <= 0.0) continue;
    if (i > 0) widest[i] = std::max(widest[i], sigmas[i - 1]);
    if (i + 1 < sigmas.size()) widest[i] = std::max(widest[i], sigmas[i + 1]);
  }
  return widest;
}

// Of each stretch of so many samples, of those in it that count; 0 where fewer than `least` can be
// judged.
template <typename Counts>
std::vector<double> stretch_sigmas_dps(const std::vector<double>& out, std::size_t stretch,
                                       std::size_t least, const Counts& counts) {
  std::vector<double> sigmas;
  std::vector<double> sizes;
  for (std::size_t from = 0; from < out.size(); from += stretch) {
    sizes.clear();
    for (std::size_t i = from; i < std::min(out.size(), from + stretch); ++i) {
      if (out[i] != 0.0 && counts(i)) sizes.push_back(std::abs(out[i]));
    }
    sigmas.push_back(sizes.size() < least ? 0.0 : kSigmaPerMedian * median_of(sizes));
  }
  return widest_of_three(sigmas);
}

// At each sample, by what lies in the same place; at least what rounding makes.
std::vector<double> sigmas_dps(const std::vector<double>& out,
                               const std::vector<std::size_t>& places, double interval_s,
                               double lattice_dps) {
  const auto stretch = static_cast<std::size_t>(
      std::clamp(kStretch_s / interval_s, kStretchSamplesMin, kStretchSamplesMax));
  const std::vector<double> of_all =
      stretch_sigmas_dps(out, stretch, kJudgedMin, [](std::size_t) { return true; });
  std::array<std::vector<double>, kPlaces> of_place;
  for (std::size_t place = 0; place < kPlaces; ++place) {
    of_place[place] = stretch_sigmas_dps(out, stretch, kJudgedOfPlaceMin,
                                         [&](std::size_t i) { return places[i] == place; });
  }
  std::vector<double> sigmas(out.size(), 0.0);
  for (std::size_t i = 0; i < out.size(); ++i) {
    const double of_like = of_place[places[i]][i / stretch];
    const double sigma = of_like > 0.0 ? of_like : of_all[i / stretch];
    if (sigma > 0.0) sigmas[i] = std::max(sigma, kSpikeLatticeSteps / kSpikeSigmas * lattice_dps);
  }
  return sigmas;
}

// How much further than normal noise the deviations in one place reach, as far out as a spike must
// stand, by the law exp(-(x/a)^k) through their median and where their tail begins. It grows with
// the 2.1th power of how much further the tail begins: with the square.
double tail_of(const Standing& standing, std::size_t place) {
  const std::vector<double>& out = standing.out_dps;
  const std::vector<double>& sigma = standing.sigma_dps;
  std::vector<double> sizes;
  for (std::size_t i = 0; i < out.size(); ++i) {
    if (standing.place[i] == place && out[i] != 0.0 && sigma[i] > 0.0)
      sizes.push_back(std::abs(out[i]) / sigma[i]);
  }
  if (sizes.empty()) return 1.0;
  const double median = std::max(kMedianMin_sigmas, median_of(sizes));
  const auto beyond = static_cast<std::ptrdiff_t>(kTailShare * static_cast<double>(sizes.size()));
  const auto begins = sizes.end() - 1 - beyond;
  std::nth_element(sizes.begin(), begins, sizes.end());
  const double further = std::max(1.0, *begins / (kTailPerMedian * median));
  return further * further;
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
  // Without a reference the other's steps show as its own do.
  const double lattice_dps =
      std::max(transports[gyro].lattice_dps,
               recording.has_reference ? 0.0 : transports[1 - gyro].lattice_dps);
  standing.place = places_of(transports[gyro], truth, lag);
  standing.sigma_dps =
      sigmas_dps(standing.out_dps, standing.place, transports[gyro].interval_s, lattice_dps);
  standing.against_s = truth.interval_s();
  for (std::size_t place = 0; place < kPlaces; ++place)
    standing.tail[place] = tail_of(standing, place);
  return standing;
}

bool stands_out(const Standing& standing, std::size_t i) {
  if (standing.sigma_dps[i] <= 0.0) return false;
  const double size = std::abs(standing.out_dps[i]);
  const double reached_dps = standing.tail[standing.place[i]] * standing.sigma_dps[i];
  if (size < std::max(kSpikeSigmas * reached_dps, standing.unsure_dps[i])) return false;
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

// Whether the other gyro shows alike, at about `at_s` of its own time, what stands out of one.
bool is_references(const Standing& others, const std::vector<double>& t_s, double at_s,
                   double out_dps) {
  const auto from = std::lower_bound(t_s.begin(), t_s.end(), at_s - others.against_s);
  const auto to = std::upper_bound(from, t_s.end(), at_s + others.against_s);
  const auto last = static_cast<std::size_t>(to - t_s.begin());
  for (auto j = static_cast<std::size_t>(from - t_s.begin()); j < last; ++j) {
    const double other_dps = std::copysign(1.0, out_dps) * others.out_dps[j];
    const double size_dps = std::abs(out_dps);
    const bool like = other_dps > kCommonShare * size_dps && size_dps > kCommonShare * other_dps;
    const double sigma_dps = others.sigma_dps[j];
    if (like && sigma_dps > 0.0 && other_dps > kCommonSigmas * sigma_dps) return true;
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
    if (transport.masked[i] != 0 || !stands_out(standings[gyro], i)) continue;
    const double out_dps = standings[gyro].out_dps[i];
    const double felt_s = transport.t_s[i] - timing.lag[gyro].at(transport.t_s[i]);
    if (recording.has_reference) {
      const double others_s = felt_s + timing.lag[other].at(felt_s);
      if (is_references(standings[other], transports[other].t_s, others_s, out_dps)) continue;
    } else if (is_others(standings[other], transports[other], felt_s, std::abs(out_dps))) {
      continue;
    }
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

#include "gap/spikes.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <random>

#include <gtest/gtest.h>

#include "made_faults.h"

namespace vgyro::gap {
namespace {

using model::Kind;

// Between spikes of either gyro: further apart than the deviations of one reach.
constexpr std::size_t kApart = 12;
constexpr double kSpikeShare = 0.004;
// In units of the noise of a sample: well beyond 6.5, the noise of both gyros together.
constexpr double kSpikeSigmas = 40.0;
// What a spike costs whoever knows nothing of it, in nats.
constexpr double kSpikeNats = 50.0;

Making making_of(std::uint64_t seed) {
  Making making;
  making.seconds = 120.0;
  making.rest_s = 30.0;
  making.seed = seed;
  return making;
}

// Gyro 2 samples between gyro 1's samples, as two sensors with clocks of their own do: at the very
// same instants a spike would look the same in both.
Recording recording_of(const Making& making, bool with_reference) {
  Recording recording = make_recording(making);
  for (double& t_s : recording.gyros[1].t_s)
    t_s += 0.43 * making.interval_s;
  return with_reference ? recording : without_reference(std::move(recording));
}

struct Planted {
  Recording recording;
  std::array<std::vector<std::size_t>, 2> at;
  std::array<double, 2> size_dps{};
};

// Spikes of both gyros, far from each other.
Planted plant(std::uint64_t seed, bool with_reference) {
  const Making making = making_of(seed);
  Planted planted{recording_of(making, with_reference), {}, {}};
  const std::vector<std::size_t> all =
      scattered(planted.recording.gyros[0].t_s.size(), kApart, kSpikeShare, seed);
  for (std::size_t k = 0; k < all.size(); ++k)
    planted.at[k % 2].push_back(all[k]);
  for (std::size_t gyro = 0; gyro < 2; ++gyro) {
    planted.size_dps[gyro] = kSpikeSigmas * sample_noise_dps(making, gyro);
    add_spikes(planted.recording.gyros[gyro], planted.at[gyro], planted.size_dps[gyro]);
  }
  return planted;
}

const Finding* spikes_of(const std::vector<Finding>& findings, std::size_t gyro) {
  for (const Finding& finding : findings) {
    if (finding.effect.gyro == gyro && finding.effect.kind == Kind::kSpikes) return &finding;
  }
  return nullptr;
}

// None found, and none masked.
void expect_no_spikes(const Recording& recording) {
  std::array<Transport, 2> transports = check_both(recording);
  EXPECT_TRUE(find_spikes(recording, timing_of(recording, transports), transports, {}).empty());
  for (const Transport& transport : transports)
    EXPECT_TRUE(masked_samples(transport).empty());
}

class Spikes : public testing::TestWithParam<bool> {
 protected:
  [[nodiscard]] static Recording clean(std::uint64_t seed) {
    return recording_of(making_of(seed), GetParam());
  }
};
INSTANTIATE_TEST_SUITE_P(WithAndWithoutAReference, Spikes, testing::Bool(), [](const auto& with) {
  return with.param ? "WithReference" : "WithoutReference";
});

TEST_P(Spikes, NoneAreFoundWhereNoneArePlanted) {
  for (const std::uint64_t seed : {21U, 22U, 23U, 24U, 25U}) {
    SCOPED_TRACE(seed);
    expect_no_spikes(clean(seed));
  }
}

TEST_P(Spikes, ThoseThatWerePlantedAreMaskedAndNoOthers) {
  for (const std::uint64_t seed : {1U, 2U, 3U}) {
    const Planted planted = plant(seed, GetParam());
    std::array<Transport, 2> transports = check_both(planted.recording);
    find_spikes(planted.recording, timing_of(planted.recording, transports), transports, {});
    for (std::size_t gyro = 0; gyro < 2; ++gyro) {
      ASSERT_GT(planted.at[gyro].size(), 10U);
      EXPECT_EQ(masked_samples(transports[gyro]), planted.at[gyro])
          << "seed " << seed << ", gyro " << gyro + 1;
    }
  }
}

TEST_P(Spikes, TheirRateSizeAndCostAreToldOfEachGyro) {
  const Planted planted = plant(4, GetParam());
  std::array<Transport, 2> transports = check_both(planted.recording);
  const std::vector<Finding> findings =
      find_spikes(planted.recording, timing_of(planted.recording, transports), transports, {});
  ASSERT_EQ(findings.size(), 2U);
  for (std::size_t gyro = 0; gyro < 2; ++gyro) {
    const Finding* const finding = spikes_of(findings, gyro);
    ASSERT_NE(finding, nullptr);
    const double count = static_cast<double>(planted.at[gyro].size());
    EXPECT_DOUBLE_EQ(finding->effect.parameters[0], count / planted.recording.seconds);
    EXPECT_NEAR(finding->effect.parameters[1], planted.size_dps[gyro], 5.0 * finding->sigma[1]);
    EXPECT_LT(finding->sigma[1], 0.1 * planted.size_dps[gyro]);
    EXPECT_NEAR(finding->cost_nats, count * kSpikeNats, 1e-6);
    const std::vector<double>& t_s = planted.recording.gyros[gyro].t_s;
    EXPECT_EQ(finding->where.from_s, t_s[planted.at[gyro].front()]);
    EXPECT_EQ(finding->where.to_s, t_s[planted.at[gyro].back()]);
    ASSERT_EQ(finding->figure.curves.size(), 1U);
    EXPECT_EQ(finding->figure.curves[0].x.size(), planted.at[gyro].size());
  }
}

TEST_P(Spikes, WhatTheModelKnowsIsMaskedButNotFoundAgain) {
  const Planted planted = plant(5, GetParam());
  std::array<Transport, 2> transports = check_both(planted.recording);
  const std::vector<Finding> findings =
      find_spikes(planted.recording, timing_of(planted.recording, transports), transports,
                  {{0, Kind::kSpikes, {0.2, 0.4}, 0}});
  EXPECT_EQ(spikes_of(findings, 0), nullptr);
  EXPECT_NE(spikes_of(findings, 1), nullptr);
  EXPECT_EQ(masked_samples(transports[0]), planted.at[0]);
}

TEST_P(Spikes, TwoAreAnAccidentAndThreeAreFound) {
  for (const std::size_t count : {2U, 3U}) {
    Recording recording = clean(6);
    std::vector<std::size_t> at{2000, 6000, 9000};
    at.resize(count);
    add_spikes(recording.gyros[0], at, 0.5);
    std::array<Transport, 2> transports = check_both(recording);
    EXPECT_EQ(find_spikes(recording, timing_of(recording, transports), transports, {}).size(),
              count == 3 ? 1U : 0U);
    EXPECT_EQ(masked_samples(transports[0]), at);
  }
}

// The sample before a step and the one after it stand half-way out of their neighbours: two masked
// samples are no finding.
TEST_P(Spikes, AStepIsNone) {
  Making making = making_of(7);
  making.error = [](std::size_t gyro, double t_s, double) {
    return gyro == 0 && t_s >= 60.0 ? 0.5 : 0.0;
  };
  const Recording recording = recording_of(making, GetParam());
  std::array<Transport, 2> transports = check_both(recording);
  EXPECT_TRUE(find_spikes(recording, timing_of(recording, transports), transports, {}).empty());
  EXPECT_LE(masked_samples(transports[0]).size() + masked_samples(transports[1]).size(), 2U);
}

// Of what lasts longer the edges stand out, as they do of a step; the regression sees the rest.
TEST_P(Spikes, OfWhatLastsForLongerOnlyTheEdgesAreMasked) {
  constexpr std::size_t kLength = 8;
  Recording recording = clean(8);
  for (const std::size_t from : {3000U, 5000U, 7000U, 9000U}) {
    for (std::size_t k = 0; k < kLength; ++k)
      recording.gyros[1].rate_dps[from + k] += 1.0;
  }
  std::array<Transport, 2> transports = check_both(recording);
  find_spikes(recording, timing_of(recording, transports), transports, {});
  for (const std::size_t from : {3000U, 5000U, 7000U, 9000U}) {
    for (std::size_t k = 1; k + 1 < kLength; ++k)
      EXPECT_EQ(transports[1].masked[from + k], 0) << from + k;
  }
}

TEST_P(Spikes, NoiseThatRisesWithTheRateIsNone) {
  Making making = making_of(9);
  std::mt19937_64 random(9);
  std::normal_distribution<double> normal;
  making.error = [&](std::size_t, double, double rate_dps) {
    return 2e-2 * std::abs(rate_dps) * normal(random);
  };
  const Recording recording = recording_of(making, GetParam());
  std::array<Transport, 2> transports = check_both(recording);
  EXPECT_TRUE(find_spikes(recording, timing_of(recording, transports), transports, {}).empty());
}

TEST_P(Spikes, NoneAreSeenAcrossMaskedSamples) {
  Recording recording = clean(10);
  add_spikes(recording.gyros[0], {4000, 6000, 8000}, 0.5);
  std::array<Transport, 2> transports = check_both(recording);
  transports[0].masked[4001] = 1;
  find_spikes(recording, timing_of(recording, transports), transports, {});
  EXPECT_EQ(transports[0].masked[4000], 0);
  EXPECT_NE(transports[0].masked[6000], 0);
}

// Against a reference each gyro is judged by itself, however near the other's spike is.
TEST(SpikesOfBoth, WhereTheyMeetAreBothFoundAgainstAReference) {
  Recording recording = recording_of(making_of(11), true);
  const std::vector<std::size_t> at = scattered(recording.gyros[0].t_s.size(), 40, 0.01, 11);
  add_spikes(recording.gyros[0], at, 0.4);
  add_spikes(recording.gyros[1], at, 0.9);
  std::array<Transport, 2> transports = check_both(recording);
  EXPECT_EQ(find_spikes(recording, timing_of(recording, transports), transports, {}).size(), 2U);
  for (const Transport& transport : transports)
    EXPECT_EQ(masked_samples(transport), at);
}

// Without one the smaller of two that meet cannot be told from the trace of the larger.
TEST(SpikesOfBoth, OfTwoThatMeetTheLargerIsFoundWithoutAReference) {
  for (const std::size_t larger : {0U, 1U}) {
    Recording recording = recording_of(making_of(12), false);
    const std::vector<std::size_t> at = scattered(recording.gyros[0].t_s.size(), 40, 0.01, 12);
    add_spikes(recording.gyros[larger], at, 3.0);
    add_spikes(recording.gyros[1 - larger], at, -0.8);
    std::array<Transport, 2> transports = check_both(recording);
    const std::vector<Finding> findings =
        find_spikes(recording, timing_of(recording, transports), transports, {});
    ASSERT_EQ(findings.size(), 1U);
    EXPECT_EQ(findings[0].effect.gyro, larger);
    EXPECT_EQ(masked_samples(transports[larger]), at);
    EXPECT_TRUE(masked_samples(transports[1 - larger]).empty());
  }
}

// Interpolation spreads them over the other gyro's samples.
TEST(SpikesOfBoth, AreOfTheGyroThatHasThem) {
  for (const std::size_t gyro : {0U, 1U}) {
    Recording recording = recording_of(making_of(13), false);
    const std::vector<std::size_t> at = scattered(recording.gyros[0].t_s.size(), 40, 0.01, 13);
    add_spikes(recording.gyros[gyro], at, 1.5);
    std::array<Transport, 2> transports = check_both(recording);
    const std::vector<Finding> findings =
        find_spikes(recording, timing_of(recording, transports), transports, {});
    ASSERT_EQ(findings.size(), 1U);
    EXPECT_EQ(findings[0].effect.gyro, gyro);
    EXPECT_EQ(masked_samples(transports[gyro]), at);
    EXPECT_TRUE(masked_samples(transports[1 - gyro]).empty());
  }
}

// Rounding to a coarse lattice makes samples jump by a step or two: they are no spikes.
TEST(SpikesOfBoth, AreMoreThanStepsOfTheLattice) {
  Recording recording = recording_of(making_of(14), true);
  constexpr double kStep_dps = 0.2;
  GyroSeries& series = recording.gyros[0];
  for (double& rate_dps : series.rate_dps)
    rate_dps = kStep_dps * std::round(rate_dps / kStep_dps);
  const std::vector<std::size_t> at{4000, 5500, 7000, 9000};
  add_spikes(series, at, 2.0 * kStep_dps);
  std::array<Transport, 2> transports = check_both(recording);
  ASSERT_NEAR(transports[0].lattice_dps, kStep_dps, 1e-3 * kStep_dps);
  EXPECT_EQ(spikes_of(find_spikes(recording, timing_of(recording, transports), transports, {}), 0),
            nullptr);
  add_spikes(series, at, 4.0 * kStep_dps);
  transports = check_both(recording);
  find_spikes(recording, timing_of(recording, transports), transports, {});
  EXPECT_EQ(masked_samples(transports[0]), at);
}

// Rate of a vehicle on a road: a Gaussian process of 2 to 60 Hz, as a sum of waves, while it moves.
std::function<double(double)> road_dps(double rms_dps, double from_s, std::uint64_t seed) {
  struct Wave {
    double rate_rad_s, phase_rad;
  };
  constexpr int kWaves = 150;
  std::mt19937_64 random(seed);
  std::uniform_real_distribution<double> frequency_hz(2.0, 60.0);
  std::uniform_real_distribution<double> phase_rad(0.0, 2.0 * kPi);
  std::vector<Wave> waves;
  for (int k = 0; k < kWaves; ++k)
    waves.push_back({2.0 * kPi * frequency_hz(random), phase_rad(random)});
  const double amplitude_dps = rms_dps * std::sqrt(2.0 / kWaves);
  return [=](double t_s) {
    double sum = 0.0;
    if (t_s < from_s) return sum;
    for (const Wave& wave : waves)
      sum += std::sin(wave.rate_rad_s * t_s + wave.phase_rad);
    return amplitude_dps * sum;
  };
}

// Of every second instant.
void thin(ScalarSeries& series) {
  for (std::size_t i = 0; 2 * i < series.t_s.size(); ++i) {
    series.t_s[i] = series.t_s[2 * i];
    series.value[i] = series.value[2 * i];
  }
  series.t_s.resize((series.t_s.size() + 1) / 2);
  series.value.resize(series.t_s.size());
}

// A quiet gyro and a rough one, and a reference that samples half as often: every second sample of
// a gyro stands between two of the reference's, where the road folds.
Recording on_a_road(std::uint64_t seed) {
  constexpr double kRoad_dps = 0.3;
  Making making = making_of(seed);
  making.white_dps_rthz = {3e-5, 5e-3};
  Recording recording = recording_of(making, true);
  const auto road = road_dps(kRoad_dps, making.rest_s, seed);
  for (GyroSeries& series : recording.gyros) {
    for (std::size_t i = 0; i < series.t_s.size(); ++i)
      series.rate_dps[i] += road(series.t_s[i]);
  }
  ScalarSeries& reference = recording.reference_dps;
  for (std::size_t i = 0; i < reference.t_s.size(); ++i)
    reference.value[i] += road(reference.t_s[i]);
  thin(reference);
  return recording;
}

TEST(SpikesOnARoad, WhatASlowReferenceFoldsIsNone) {
  for (const std::uint64_t seed : {31U, 32U, 33U}) {
    SCOPED_TRACE(seed);
    expect_no_spikes(on_a_road(seed));
  }
}

TEST(SpikesOnARoad, AreFoundBesideWhatASlowReferenceFolds) {
  for (const std::size_t gyro : {0U, 1U}) {
    constexpr double kSize_dps = 6.0;
    Recording recording = on_a_road(34);
    const std::vector<std::size_t> at =
        scattered(recording.gyros[gyro].t_s.size(), kApart, kSpikeShare, 34);
    add_spikes(recording.gyros[gyro], at, kSize_dps);
    std::array<Transport, 2> transports = check_both(recording);
    const std::vector<Finding> findings =
        find_spikes(recording, timing_of(recording, transports), transports, {});
    ASSERT_EQ(findings.size(), 1U);
    EXPECT_EQ(findings[0].effect.gyro, gyro);
    EXPECT_NEAR(findings[0].effect.parameters[1], kSize_dps, 5.0 * findings[0].sigma[1]);
    EXPECT_EQ(masked_samples(transports[gyro]), at);
    EXPECT_TRUE(masked_samples(transports[1 - gyro]).empty());
  }
}

// Of a law whose tail is longer than that of e^-|x|.
TEST_P(Spikes, NoiseWithALongTailIsNone) {
  for (const std::uint64_t seed : {41U, 42U, 43U}) {
    Making making = making_of(seed);
    std::mt19937_64 random(seed);
    std::exponential_distribution<double> size;
    std::bernoulli_distribution up;
    making.error = [&](std::size_t, double, double) {
      const double size_dps = 0.1 * std::pow(size(random), 1.4);
      return up(random) ? size_dps : -size_dps;
    };
    const Recording recording = recording_of(making, GetParam());
    std::array<Transport, 2> transports = check_both(recording);
    EXPECT_TRUE(find_spikes(recording, timing_of(recording, transports), transports, {}).empty())
        << "seed " << seed;
  }
}

// A reference that goes wrong for two of its samples is as sure of itself as ever.
TEST(SpikesOfBoth, AreTheReferencesWhereTheyAreAlike) {
  Recording recording = recording_of(making_of(16), true);
  for (GyroSeries& series : recording.gyros) {
    ScalarSeries slow{series.t_s, series.rate_dps};
    thin(slow);
    series.t_s = slow.t_s;
    series.rate_dps = slow.value;
  }
  std::vector<double>& reference = recording.reference_dps.value;
  double off_dps = 2.0;
  for (const std::size_t at : scattered(reference.size(), 60, 0.01, 16)) {
    for (std::size_t k = 0; k < 3; ++k)
      reference[at + k] += off_dps;
    off_dps = -off_dps;
  }
  std::array<Transport, 2> transports = check_both(recording);
  EXPECT_TRUE(find_spikes(recording, timing_of(recording, transports), transports, {}).empty());
}

// A step of the coarse gyro's lattice stands far out of what the fine one reads.
TEST(SpikesOfBoth, AreNoStepsOfTheOthersLattice) {
  constexpr double kStep_dps = 0.37;
  Making making = making_of(17);
  making.white_dps_rthz = {1e-4, 1.2e-2};
  Recording recording = recording_of(making, false);
  for (double& rate_dps : recording.gyros[1].rate_dps)
    rate_dps = kStep_dps * std::round(rate_dps / kStep_dps);
  std::array<Transport, 2> transports = check_both(recording);
  ASSERT_NEAR(transports[1].lattice_dps, kStep_dps, 1e-3 * kStep_dps);
  EXPECT_TRUE(find_spikes(recording, timing_of(recording, transports), transports, {}).empty());
}

// What clips is told with the cost of all that is masked, and spikes are masked after it was found.
TEST(SpikesOfBoth, CountInTheCostOfWhatClips) {
  Recording recording = recording_of(making_of(15), true);
  add_spikes(recording.gyros[0], {500, 1000, 1500, 2000}, 0.5);
  for (double& rate_dps : recording.gyros[0].rate_dps)
    rate_dps = std::clamp(rate_dps, -35.0, 35.0);
  std::array<Transport, 2> transports = check_both(recording);
  ASSERT_EQ(transports[0].findings.size(), 1U);
  ASSERT_EQ(transports[0].findings[0].effect.kind, Kind::kSaturation);
  const double clipped = static_cast<double>(masked_samples(transports[0]).size());
  EXPECT_DOUBLE_EQ(transports[0].findings[0].cost_nats, 0.5 * kSpikeNats * clipped);
  find_spikes(recording, timing_of(recording, transports), transports, {});
  const double masked = static_cast<double>(masked_samples(transports[0]).size());
  EXPECT_EQ(masked, clipped + 4.0);
  EXPECT_DOUBLE_EQ(transports[0].findings[0].cost_nats, 0.5 * kSpikeNats * masked);
}

}  // namespace
}  // namespace vgyro::gap

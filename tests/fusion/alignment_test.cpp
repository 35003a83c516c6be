#include "fusion/alignment.h"

#include <algorithm>
#include <functional>
#include <vector>

#include <gtest/gtest.h>

#include "tests/fusion/random.h"

namespace vgyro::fusion {
namespace {

using namespace std::chrono_literals;

constexpr TimePoint kStart = time_from_ns(1'700'000'000'000'000'000);

struct GyroSample {
  TimePoint t;
  double rate_dps = 0.0;
};
using Stream = std::vector<GyroSample>;
using Signal = std::function<double(double)>;

double seconds(TimePoint t) {
  return to_seconds(t - kStart);
}

Stream stream_of(double rate_hz, Duration phase, double length_s, const Signal& signal) {
  Stream stream;
  for (int i = 0; i < rate_hz * length_s; ++i) {
    const TimePoint t = kStart + phase + from_seconds(i / rate_hz);
    stream.push_back({t, signal(seconds(t))});
  }
  return stream;
}

Stream without(Stream stream, double from_s, double to_s) {
  std::erase_if(stream,
                [&](const GyroSample& s) { return seconds(s.t) >= from_s && seconds(s.t) < to_s; });
  return stream;
}

struct Push {
  std::size_t gyro = 0;
  GyroSample sample;
};

/// Both streams in the order of their stamps, as one bus delivers them.
std::vector<Push> merged(const Stream& a, const Stream& b) {
  std::vector<Push> pushes;
  for (const GyroSample& s : a)
    pushes.push_back({0, s});
  for (const GyroSample& s : b)
    pushes.push_back({1, s});
  std::stable_sort(pushes.begin(), pushes.end(),
                   [](const Push& x, const Push& y) { return x.sample.t < y.sample.t; });
  return pushes;
}

struct Aligned {
  std::vector<AlignedPair> pairs;
  std::vector<TimePoint> arrived;  ///< stamp of the push that completed the pair
  int refused = 0;
  Aligner aligner;
};

Aligned align(const std::vector<Push>& pushes) {
  Aligned result;
  for (const Push& push : pushes) {
    if (!result.aligner.push(push.gyro, push.sample.t, push.sample.rate_dps)) ++result.refused;
    AlignedPair pair;
    while (result.aligner.pop(pair)) {
      result.pairs.push_back(pair);
      result.arrived.push_back(push.sample.t);
    }
  }
  return result;
}

Aligned align(const Stream& a, const Stream& b) {
  return align(merged(a, b));
}

void expect_growing(const std::vector<AlignedPair>& pairs) {
  for (std::size_t i = 1; i < pairs.size(); ++i)
    ASSERT_GT(pairs[i].t, pairs[i - 1].t) << i;
}

bool same(const AlignedPair& a, const AlignedPair& b) {
  return a.t == b.t && a.complete == b.complete && a.rate_dps == b.rate_dps;
}

void expect_same(const std::vector<AlignedPair>& a, const std::vector<AlignedPair>& b) {
  ASSERT_EQ(a.size(), b.size());
  for (std::size_t i = 0; i < a.size(); ++i) {
    ASSERT_TRUE(same(a[i], b[i])) << i << " at " << seconds(a[i].t) << " and " << seconds(b[i].t)
                                  << " complete " << seconds(a[i].complete) << " and "
                                  << seconds(b[i].complete) << " with " << a[i].rate_dps[0] << ' '
                                  << a[i].rate_dps[1] << " and " << b[i].rate_dps[0] << ' '
                                  << b[i].rate_dps[1];
  }
}

Signal noise(std::uint64_t seed, double sigma = 1.0) {
  return [random = Random(seed), sigma](double /*t_s*/) mutable { return random.normal(sigma); };
}
double line_a(double t_s) {
  return 3.0 + 0.7 * t_s;
}
double line_b(double t_s) {
  return -2.0 - 1.3 * t_s;
}

// Interpolation of lines is exact except for rounding.
constexpr double kRounding = 1e-12;

void expect_on_lines(const Aligned& result) {
  for (const AlignedPair& pair : result.pairs) {
    ASSERT_NEAR(pair.rate_dps[0], line_a(seconds(pair.t)), kRounding);
    ASSERT_NEAR(pair.rate_dps[1], line_b(seconds(pair.t)), kRounding);
  }
}

// Gyros that one unit samples at the same instant pass unchanged and without delay.
TEST(Aligner, LeavesEqualStampsAsTheyAre) {
  const Stream a = stream_of(100.0, 0ms, 10.0, noise(1));
  const Stream b = stream_of(100.0, 0ms, 10.0, noise(2));
  const Aligned result = align(a, b);
  ASSERT_EQ(result.pairs.size(), a.size());
  for (std::size_t i = 0; i < a.size(); ++i) {
    const AlignedPair& pair = result.pairs[i];
    ASSERT_EQ(pair.t, a[i].t);
    ASSERT_EQ(pair.rate_dps, (std::array<double, 2>{a[i].rate_dps, b[i].rate_dps}));
    // Which gyro paces is only known with the eighth sample of each.
    ASSERT_EQ(pair.complete, std::max(pair.t, a[Aligner::kSamplesToChoose - 1].t));
    ASSERT_EQ(result.arrived[i], pair.complete);
  }
}

// Two units on one bus have any phase to each other; on lines, interpolation is exact at every
// phase, for both gyros.
TEST(Aligner, InterpolatesLinesExactlyAtEveryPhase) {
  for (Duration phase = 100us; phase < 10ms; phase += 700us) {
    SCOPED_TRACE(to_seconds(phase));
    const Aligned result =
        align(stream_of(100.0, 0ms, 10.0, line_a), stream_of(100.0, phase, 10.0, line_b));
    EXPECT_GE(result.pairs.size(), 998U);
    expect_on_lines(result);
    expect_growing(result.pairs);
  }
}

// At equal rates the gyro paces whose pairs are complete sooner.
TEST(Aligner, LetsThePhaseWithTheShorterWaitPace) {
  for (Duration phase = 500us; phase < 10ms; phase += 1ms) {
    SCOPED_TRACE(to_seconds(phase));
    const Aligned result =
        align(stream_of(100.0, 0ms, 5.0, line_a), stream_of(100.0, phase, 5.0, line_b));
    EXPECT_EQ(result.aligner.pacing_gyro(), phase < 5ms ? 0U : 1U);
    const AlignedPair& last = result.pairs.back();
    EXPECT_EQ(last.complete - last.t, std::min(phase, 10ms - phase));
  }
}

// The slower gyro paces: nothing is known between its samples.
TEST(Aligner, LetsTheSlowerGyroPace) {
  for (const auto& [rate_a, rate_b] : {std::pair{100.0, 83.0}, {100.0, 50.0}, {500.0, 100.0}}) {
    SCOPED_TRACE(::testing::Message() << rate_a << " Hz and " << rate_b << " Hz");
    for (const bool swapped : {false, true}) {
      const Stream fast = stream_of(rate_a, 1ms, 10.0, swapped ? line_b : line_a);
      const Stream slow = stream_of(rate_b, 0ms, 10.0, swapped ? line_a : line_b);
      const Aligned result = swapped ? align(slow, fast) : align(fast, slow);
      EXPECT_EQ(result.aligner.pacing_gyro(), swapped ? 0U : 1U);
      EXPECT_NEAR(static_cast<double>(result.pairs.size()), rate_b * 10.0, 3.0);
      EXPECT_NEAR(1.0 / to_seconds(result.aligner.interval(swapped ? 0 : 1)), rate_b, 0.1);
      expect_on_lines(result);
    }
  }
}

// Stamps that jitter are still true: on lines it makes no difference.
TEST(Aligner, InterpolatesAtTheTrueStampsOfJitteringStreams) {
  for (std::uint64_t seed = 1; seed <= 10; ++seed) {
    for (const double rate_b : {100.0, 83.0, 500.0}) {
      SCOPED_TRACE(::testing::Message() << "seed " << seed << " rate " << rate_b);
      Random random(seed);
      const auto jittered = [&random](double rate_hz, const Signal& signal) {
        Stream stream = stream_of(rate_hz, 0ms, 10.0, signal);
        for (GyroSample& s : stream) {
          s.t += from_seconds(random.uniform(0.0, 0.9 / rate_hz));
          s.rate_dps = signal(seconds(s.t));
        }
        return stream;
      };
      const Aligned result = align(jittered(100.0, line_a), jittered(rate_b, line_b));
      EXPECT_GE(result.pairs.size(), std::min(rate_b, 100.0) * 10.0 - 5.0);
      expect_on_lines(result);
      expect_growing(result.pairs);
      EXPECT_EQ(result.refused, 0);
    }
  }
}

// A gyro five times faster is averaged over the pace interval, which lowers its noise as much as
// five samples allow. The expected factor comes from the weights: the interpolant's mean over the
// interval is a weighted sum of samples, here integrated numerically from their hat functions.
TEST(Aligner, AveragesAFasterGyroAndReducesItsNoise) {
  for (const Duration phase : {0us, 300us, 1000us}) {
    SCOPED_TRACE(::testing::Message() << "phase " << to_seconds(phase) << " seeds 1, 2");
    const Stream fast = stream_of(500.0, phase, 100.0, noise(1));
    const Stream slow = stream_of(100.0, 0ms, 100.0, noise(2));
    const Aligned result = align(fast, slow);
    double weights_squared = 0.0;
    for (int sample = -4; sample <= 4; ++sample) {
      const double at = sample + to_seconds(phase) / 0.002;
      double weight = 0.0;
      constexpr int kSteps = 100'000;
      for (int i = 0; i < kSteps; ++i) {
        const double x = -2.5 + 5.0 * (i + 0.5) / kSteps;
        weight += std::max(0.0, 1.0 - std::abs(x - at)) / kSteps;
      }
      weights_squared += weight * weight;
    }
    Rms of_fast;
    Rms of_slow;
    for (const AlignedPair& pair : result.pairs) {
      of_fast.add(pair.rate_dps[0]);
      of_slow.add(pair.rate_dps[1]);
    }
    const double factor = std::sqrt(weights_squared);
    EXPECT_LT(factor, 1.0 / std::sqrt(5.0)) << "as good as five samples, and the ends' halves";
    EXPECT_NEAR(of_fast.value() / factor, 1.0, kSigmas * of_fast.relative_error());
    EXPECT_NEAR(of_slow.value(), 1.0, kSigmas * of_slow.relative_error());
  }
}

// The mean over whole intervals removes what would otherwise alias: to plain interpolation, a tone
// at the pace's own frequency looks like a constant.
TEST(Aligner, AveragesATonesAliasAway) {
  const auto tone = [](double t_s) { return std::cos(2.0 * 3.14159265358979 * 100.0 * t_s); };
  const Aligned result =
      align(stream_of(2000.0, 0ms, 5.0, tone), stream_of(100.0, 0ms, 5.0, line_b));
  ASSERT_GT(result.pairs.size(), 400U);
  for (const AlignedPair& pair : result.pairs)
    ASSERT_NEAR(pair.rate_dps[0], 0.0, 1e-9);
}

// A frame that two queues have swapped is put in its place while it can still be used.
TEST(Aligner, PutsALateSampleInItsPlaceWhileItIsNotUsed) {
  const Stream a = stream_of(100.0, 0ms, 2.0, noise(1));
  const Stream b = stream_of(100.0, 3ms, 2.0, noise(2));
  std::vector<Push> swapped = merged(a, b);
  // Each stream's sample 50 comes after its sample 51, with no sample of the other stream between
  // them that would complete a pair.
  const auto place = [&swapped](std::size_t gyro, TimePoint t) {
    return std::find_if(swapped.begin(), swapped.end(),
                        [&](const Push& p) { return p.gyro == gyro && p.sample.t == t; });
  };
  std::iter_swap(place(0, a[50].t), place(1, b[50].t));
  std::iter_swap(place(0, a[50].t), place(0, a[51].t));
  const Aligned result = align(swapped);
  EXPECT_EQ(result.refused, 0);
  expect_growing(result.pairs);
  const Aligned straight = align(a, b);
  ASSERT_EQ(result.pairs.size(), straight.pairs.size());
  for (std::size_t i = 0; i < result.pairs.size(); ++i) {
    EXPECT_EQ(result.pairs[i].t, straight.pairs[i].t) << i;
    EXPECT_EQ(result.pairs[i].rate_dps, straight.pairs[i].rate_dps) << i;
  }
}

// A sample that is too late is refused: its pair is complete.
TEST(Aligner, RefusesASampleThatComesTooLate) {
  const Stream a = stream_of(100.0, 0ms, 1.0, line_a);
  const Stream b = stream_of(100.0, 3ms, 1.0, line_b);
  Aligned result = align(a, b);
  for (const std::size_t gyro : {0U, 1U}) {
    EXPECT_FALSE(result.aligner.push(gyro, kStart + 500ms + 1us, 99.0));
    EXPECT_FALSE(result.aligner.push(gyro, kStart - 1h, 99.0));
  }
  AlignedPair pair;
  EXPECT_FALSE(result.aligner.pop(pair));
}

// The same stamp twice is the same sample twice.
TEST(Aligner, RefusesAStampThatItHolds) {
  Aligner aligner;
  EXPECT_TRUE(aligner.push(0, kStart, 1.0));
  EXPECT_TRUE(aligner.push(0, kStart + 10ms, 1.0));
  EXPECT_FALSE(aligner.push(0, kStart + 10ms, 2.0));
  EXPECT_FALSE(aligner.push(0, kStart, 2.0));
  EXPECT_TRUE(aligner.push(1, kStart, 2.0)) << "of the other gyro it is another sample";
}

// Random reordering within each stream: some samples are refused, but no pair goes back in time or
// has a value that is not on the lines.
TEST(Aligner, StaysInOrderUnderAnyReordering) {
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    for (const double rate_b : {100.0, 500.0}) {
      SCOPED_TRACE(::testing::Message() << "seed " << seed << " rate " << rate_b);
      Random random(seed);
      std::vector<Push> pushes =
          merged(stream_of(100.0, 0ms, 20.0, line_a), stream_of(rate_b, 3ms, 20.0, line_b));
      for (std::size_t i = 0; i + 6 < pushes.size(); ++i)
        std::swap(pushes[i], pushes[i + random.below(6)]);
      const Aligned result = align(pushes);
      expect_growing(result.pairs);
      expect_on_lines(result);
      EXPECT_GT(result.pairs.size(), 1000U);
    }
  }
}

// Three lost frames are bridged, four are a gap: nothing is interpolated over it, and the pacing
// gyro's samples in it are counted.
TEST(Aligner, InterpolatesOverThreeLostFramesAndNotOverFour) {
  for (const int lost : {1, 3, 4, 20}) {
    SCOPED_TRACE(lost);
    const Stream a = stream_of(100.0, 0ms, 5.0, line_a);
    const Stream b = without(stream_of(100.0, 3ms, 5.0, line_b), 2.0, 2.0 + 0.01 * lost);
    const Aligned result = align(a, b);
    ASSERT_EQ(result.aligner.pacing_gyro(), 0U);
    expect_on_lines(result);
    const auto in_gap =
        std::count_if(result.pairs.begin(), result.pairs.end(), [lost](const AlignedPair& pair) {
          return seconds(pair.t) > 1.995 && seconds(pair.t) < 1.995 + 0.01 * (lost + 1);
        });
    // a[0] comes before the first sample of b.
    const std::uint64_t unpaired = result.aligner.counts().unpaired[0] - 1;
    if (lost <= 3) {
      EXPECT_EQ(in_gap, lost + 1);
      EXPECT_EQ(unpaired, 0U);
    } else {
      EXPECT_EQ(in_gap, 0);
      EXPECT_EQ(unpaired, static_cast<std::uint64_t>(lost) + 1);
    }
    EXPECT_EQ(result.aligner.counts().unpaired[1], 0U);
  }
}

// If the faster gyro is averaged, an interval with a gap in it has no mean.
TEST(Aligner, AveragesOverNoGap) {
  const Stream fast = without(stream_of(500.0, 0ms, 5.0, line_a), 2.0, 2.009);
  const Stream slow = stream_of(100.0, 0ms, 5.0, line_b);
  const Aligned result = align(fast, slow);
  expect_on_lines(result);
  for (const AlignedPair& pair : result.pairs)
    EXPECT_FALSE(seconds(pair.t) > 1.994 && seconds(pair.t) < 2.014) << seconds(pair.t);
  EXPECT_GE(result.pairs.size(), 495U);
}

// A gap of the pacing gyro itself makes no pairs, neither in it nor across it.
TEST(Aligner, MakesNoPairsWhereThePacingGyroIsSilent) {
  const Stream a = without(stream_of(100.0, 0ms, 20.0, line_a), 5.0, 15.0);
  const Aligned result = align(a, stream_of(100.0, 3ms, 20.0, line_b));
  ASSERT_EQ(result.aligner.pacing_gyro(), 0U);
  EXPECT_EQ(result.pairs.size(), a.size() - 1);
  expect_on_lines(result);
}

// While the other gyro is silent, samples wait as long as there is room; then each one is counted.
// When it returns, pairs are made again.
TEST(Aligner, CountsWhatASilentGyroLeavesUnpaired) {
  const Stream a = stream_of(100.0, 0ms, 60.0, line_a);
  const Stream b = without(stream_of(100.0, 3ms, 60.0, line_b), 10.0, 50.0);
  const Aligned result = align(a, b);
  ASSERT_EQ(result.aligner.pacing_gyro(), 0U);
  expect_on_lines(result);
  EXPECT_EQ(result.pairs.size() + result.aligner.counts().unpaired[0], a.size());
  EXPECT_NEAR(static_cast<double>(result.aligner.counts().unpaired[0]), 4000.0, 3.0);
  EXPECT_EQ(result.pairs.back().t, a.back().t);
}

// One gyro alone for hours: memory is bounded by the type's own size, and every lost sample is
// counted.
TEST(Aligner, HoldsNoMoreThanItsBuffersWhenOnlyOneGyroSpeaks) {
  Aligner aligner;
  for (int i = 0; i < 1'000'000; ++i)
    ASSERT_TRUE(aligner.push(0, kStart + i * 10ms, 1.0));
  AlignedPair pair;
  EXPECT_FALSE(aligner.pop(pair));
  EXPECT_FALSE(aligner.chosen());
  EXPECT_EQ(aligner.counts().unpaired[0], 1'000'000U - Aligner::kCapacity);
}

// A full buffer has no place for a sample that is older than its oldest one.
TEST(Aligner, RefusesALateSampleInAFullBufferRatherThanLoseANewOne) {
  Aligner aligner;
  for (int i = 0; i < static_cast<int>(Aligner::kCapacity); ++i)
    ASSERT_TRUE(aligner.push(0, kStart + i * 10ms, 1.0));
  EXPECT_FALSE(aligner.push(0, kStart - 5ms, 1.0));
  EXPECT_TRUE(aligner.push(0, kStart + 15ms, 1.0));
}

// A gyro that is switched on later makes pairs from its first two samples on.
TEST(Aligner, PairsAGyroThatComesMuchLater) {
  const Stream a = stream_of(100.0, 0ms, 60.0, line_a);
  const Stream b = stream_of(100.0, 40s + 3ms, 20.0, line_b);
  const Aligned result = align(a, b);
  ASSERT_TRUE(result.aligner.chosen());
  EXPECT_EQ(result.aligner.pacing_gyro(), 0U);
  expect_on_lines(result);
  EXPECT_GE(result.pairs.size(), 1998U);
  EXPECT_EQ(result.pairs.size() + result.aligner.counts().unpaired[0], a.size());
}

// A gap among the very first samples does not make a gyro slow, and must not make the aligner
// bridge such gaps.
TEST(Aligner, ChoosesAsIfAGapAmongTheFirstSamplesWereNotThere) {
  const Stream a = stream_of(100.0, 0ms, 20.0, line_a);
  const Stream b = without(without(stream_of(100.0, 3ms, 20.0, line_b), 0.04, 1.0), 10.0, 10.5);
  const Aligned result = align(a, b);
  ASSERT_TRUE(result.aligner.chosen());
  EXPECT_EQ(result.aligner.pacing_gyro(), 0U);
  EXPECT_EQ(result.aligner.interval(1), 10ms);
  expect_on_lines(result);
  for (const AlignedPair& pair : result.pairs)
    EXPECT_FALSE(seconds(pair.t) > 9.994 && seconds(pair.t) < 10.502) << seconds(pair.t);
}

// One gyro breaks off and returns long after the other began: both are still 100-Hz gyros.
TEST(Aligner, ChoosesRightlyWhenTheFirstGyroWasAwayAtTheStart) {
  const Stream a = without(stream_of(100.0, 0ms, 40.0, line_a), 0.2, 20.0);
  const Stream b = stream_of(100.0, 10s + 3ms, 30.0, line_b);
  const Aligned result = align(a, b);
  ASSERT_TRUE(result.aligner.chosen());
  EXPECT_EQ(result.aligner.interval(0), 10ms);
  EXPECT_EQ(result.aligner.interval(1), 10ms);
  EXPECT_GE(result.pairs.size(), 1998U);
  expect_on_lines(result);
}

// The clocks are set again and again, up to the end of time: a leap of decades is not an interval.
TEST(Aligner, TakesNoLeapOfTheClockForAnInterval) {
  constexpr Duration kLeap{1'120'000'000'000'000'000};
  Aligner aligner;
  for (int i = 0; i <= 8; ++i) {
    aligner.push(0, time_from_ns(0) + i * kLeap, 1.0);
    aligner.push(1, time_from_ns(0) + i * kLeap, 1.0);
    aligner.push(1, time_from_ns(0) + i * kLeap + (i < 8 ? kLeap : Duration{1}) / 2, 1.0);
  }
  AlignedPair pair;
  while (aligner.pop(pair)) {
  }
  ASSERT_TRUE(aligner.chosen());
  for (const std::size_t gyro : {0U, 1U})
    EXPECT_LE(aligner.interval(gyro), Aligner::kIntervalMax);
}

// The latency, from pair.t to pair.complete, is bounded: one interval of the other gyro when
// interpolating, half an interval of the pace more when averaging.
TEST(Aligner, CompletesEveryPairWithinItsLatencyBound) {
  for (const double rate_b : {83.0, 100.0, 500.0, 1000.0}) {
    SCOPED_TRACE(rate_b);
    const Stream a = stream_of(100.0, 0ms, 10.0, line_a);
    const Stream b = stream_of(rate_b, 300us, 10.0, line_b);
    const Aligned result = align(a, b);
    const std::size_t pace = result.aligner.pacing_gyro();
    const bool averages = rate_b > 150.0;
    const Duration bound = result.aligner.interval(1 - pace) + 2ns +
                           (averages ? result.aligner.interval(pace) / 2 : Duration::zero());
    const Stream& first_eight = rate_b < 100.0 ? b : a;
    const TimePoint burst_end = first_eight[Aligner::kSamplesToChoose].t + 1ms;
    ASSERT_GT(result.pairs.size(), 700U);
    for (std::size_t i = 0; i < result.pairs.size(); ++i) {
      const AlignedPair& pair = result.pairs[i];
      ASSERT_EQ(pair.complete, result.arrived[i]) << i;
      if (pair.complete <= burst_end) continue;
      ASSERT_LE(pair.complete - pair.t, bound) << i;
    }
  }
}

// Which of two buses the kernel serves first is chance; the pairs must not depend on it. Each
// stream keeps its order, and arrives up to 50 ms later than its stamps.
TEST(Aligner, GivesTheSamePairsHoweverTheStreamsInterleave) {
  for (std::uint64_t seed = 1; seed <= 30; ++seed) {
    for (const double rate_b : {100.0, 83.0, 500.0}) {
      SCOPED_TRACE(::testing::Message() << "seed " << seed << " rate " << rate_b);
      Random random(seed);
      const auto jittered = [&random](double rate_hz, Duration phase) {
        Stream stream =
            stream_of(rate_hz, phase, 4.0, [&random](double) { return random.normal(); });
        for (GyroSample& s : stream)
          s.t += from_seconds(random.uniform(0.0, 0.4 / rate_hz));
        return without(stream, 2.0, 2.1);
      };
      const Stream a = jittered(100.0, 0ms);
      const Stream b = jittered(rate_b, from_seconds(random.uniform(0.0, 0.01)));
      struct Arrival {
        TimePoint at;
        Push push;
      };
      std::vector<Arrival> arrivals;
      for (const std::size_t gyro : {0U, 1U}) {
        TimePoint last{};
        for (const GyroSample& s : gyro == 0 ? a : b) {
          last = std::max(last, s.t + from_seconds(random.uniform(0.0, 0.05)));
          arrivals.push_back({last, {gyro, s}});
        }
      }
      std::stable_sort(arrivals.begin(), arrivals.end(),
                       [](const Arrival& x, const Arrival& y) { return x.at < y.at; });
      std::vector<Push> permuted;
      for (const Arrival& arrival : arrivals)
        permuted.push_back(arrival.push);
      const Aligned straight = align(a, b);
      const Aligned other = align(permuted);
      EXPECT_EQ(other.refused, 0);
      ASSERT_GT(straight.pairs.size(), 300U);
      expect_same(other.pairs, straight.pairs);
      if (HasFatalFailure()) return;
    }
  }
}

// Nothing is interpolated across a step of the clock.
TEST(Aligner, ForgetsItsSamplesButNotItsChoiceWhenCleared) {
  Aligned result = align(stream_of(100.0, 0ms, 1.0, line_a), stream_of(100.0, 3ms, 1.0, line_b));
  Aligner& aligner = result.aligner;
  aligner.clear();
  EXPECT_TRUE(aligner.chosen());
  AlignedPair pair;
  const TimePoint later = kStart + 1s + 20ms;
  EXPECT_TRUE(aligner.push(1, later + 3ms, line_b(1.023)));
  EXPECT_TRUE(aligner.push(0, later, line_a(1.02)));
  EXPECT_FALSE(aligner.pop(pair)) << "the sample of b before the step is gone";
  EXPECT_TRUE(aligner.push(0, later + 10ms, line_a(1.03)));
  EXPECT_TRUE(aligner.push(1, later + 13ms, line_b(1.033)));
  ASSERT_TRUE(aligner.pop(pair));
  EXPECT_EQ(pair.t, later + 10ms);
  EXPECT_EQ(pair.complete, later + 13ms);
  EXPECT_NEAR(pair.rate_dps[1], line_b(1.03), kRounding);
}

// A gyro a hundred times faster still fits the buffers, and is averaged like any other.
TEST(Aligner, AveragesAGyroAHundredTimesFaster) {
  const Aligned result =
      align(stream_of(1000.0, 0ms, 20.0, line_a), stream_of(10.0, 300us, 20.0, line_b));
  ASSERT_TRUE(result.aligner.chosen());
  EXPECT_EQ(result.aligner.pacing_gyro(), 1U);
  EXPECT_GE(result.pairs.size(), 190U);
  expect_on_lines(result);
}

// The limit of the buffers: one gyro sends a thousand values to the other's one or two.
TEST(Aligner, AveragesAGyroTwoThousandTimesFaster) {
  for (const double slow_hz : {3.0, 2.0, 1.0}) {
    const Aligned result =
        align(stream_of(2000.0, 0ms, 30.0, line_a), stream_of(slow_hz, 300us, 30.0, line_b));
    ASSERT_TRUE(result.aligner.chosen());
    EXPECT_FALSE(result.aligner.too_far_apart());
    EXPECT_GE(static_cast<double>(result.pairs.size()), 30.0 * slow_hz - 9.0) << slow_hz;
    for (const AlignedPair& pair : result.pairs)
      ASSERT_NEAR(pair.rate_dps[0], line_a(seconds(pair.t)), 1e-9);
  }
  const Aligned result =
      align(stream_of(4000.0, 0ms, 30.0, line_a), stream_of(1.0, 300us, 30.0, line_b));
  EXPECT_TRUE(result.aligner.too_far_apart());
}

// --- a wrong first choice is corrected -----------------------------------------------------------

Stream burst(int count, Duration phase) {
  Stream stream;
  for (int i = 0; i < count; ++i)
    stream.push_back({kStart + phase + i * 31us, 0.0});
  return stream;
}

Stream joined(Stream first, const Stream& second) {
  first.insert(first.end(), second.begin(), second.end());
  return first;
}

struct PacePair {
  double a_hz;
  double b_hz;
};

// Two queues that are emptied at once look like gyros of thirty kilohertz.
TEST(Aligner, ChoosesAgainWhenTheFirstSamplesWereABurst) {
  for (const PacePair pace :
       {PacePair{100.0, 100.0}, {100.0, 1000.0}, {1000.0, 100.0}, {83.0, 52.0}}) {
    for (const int which : {0, 1, 2}) {
      SCOPED_TRACE(::testing::Message() << pace.a_hz << " and " << pace.b_hz << " Hz, " << which);
      const Stream a =
          joined(which != 1 ? burst(20, 0us) : Stream{}, stream_of(pace.a_hz, 5ms, 10.0, line_a));
      const Stream b =
          joined(which != 0 ? burst(20, 7us) : Stream{}, stream_of(pace.b_hz, 8ms, 10.0, line_b));
      Aligned result = align(a, b);
      std::erase_if(result.pairs, [](const AlignedPair& pair) { return seconds(pair.t) < 4.0; });
      EXPECT_GE(static_cast<double>(result.pairs.size()),
                6.0 * std::min(pace.a_hz, pace.b_hz) - 5.0);
      for (const AlignedPair& pair : result.pairs) {
        ASSERT_NEAR(pair.rate_dps[0], line_a(seconds(pair.t)), 1e-9);
        ASSERT_NEAR(pair.rate_dps[1], line_b(seconds(pair.t)), 1e-9);
      }
      expect_growing(result.pairs);
    }
  }
}

// A gyro that is set to another rate, and one that was slow at first.
TEST(Aligner, FollowsAGyroToAnotherRate) {
  for (const PacePair rates :
       {PacePair{100.0, 10.0}, {10.0, 100.0}, {3.0, 100.0}, {1000.0, 50.0}}) {
    SCOPED_TRACE(::testing::Message() << rates.a_hz << " then " << rates.b_hz << " Hz");
    const Stream b = stream_of(100.0, 3ms, 60.0, line_b);
    Stream a = without(stream_of(rates.a_hz, 0ms, 60.0, line_a), 30.0, 60.0);
    a = joined(a, without(stream_of(rates.b_hz, 0ms, 60.0, line_a), 0.0, 30.0));
    const Aligned result = align(a, b);
    expect_growing(result.pairs);
    const auto late = std::count_if(result.pairs.begin(), result.pairs.end(),
                                    [](const auto& pair) { return seconds(pair.t) >= 45.0; });
    EXPECT_GE(static_cast<double>(late), 15.0 * std::min(rates.b_hz, 100.0) - 3.0);
    EXPECT_NEAR(to_seconds(result.aligner.interval(0)), 1.0 / rates.b_hz, 0.1 / rates.b_hz);
    for (const AlignedPair& pair : result.pairs)
      ASSERT_NEAR(pair.rate_dps[1], line_b(seconds(pair.t)), 1e-9);
  }
}

// Jitter, losses and queues that deliver in bursts are no change of pace, and cost no pair.
TEST(Aligner, KeepsItsChoiceThroughJitterLossesAndHeaps) {
  Random random(31);
  Stream a = stream_of(100.0, 0ms, 300.0, line_a);
  Stream b = stream_of(100.0, 3ms, 300.0, line_b);
  std::erase_if(a, [&](const GyroSample&) { return random.uniform(0.0, 1.0) < 0.25; });
  for (std::size_t i = 0; i < b.size(); ++i) {
    const std::size_t heap = i / 5 * 5 + 4;
    const Duration late = heap < b.size() ? b[heap].t - b[i].t : Duration::zero();
    if (i > 100) b[i].t += late * 6 / 10;
  }
  const Aligned result = align(merged(a, b));
  EXPECT_EQ(result.refused, 0);
  const Duration first = result.aligner.interval(0);
  EXPECT_GE(static_cast<double>(result.pairs.size()), 0.98 * static_cast<double>(a.size()));
  EXPECT_NEAR(to_seconds(first), 0.0125, 0.0035);
}

}  // namespace
}  // namespace vgyro::fusion

// After any history, good data give good results: a hostile minute before a good recording changes
// neither the validity of its end nor, beyond noise, its rates. Each case is a seed, which is
// printed on failure.

#include <cmath>
#include <string>

#include <gtest/gtest.h>

#include "gateway/pipeline.h"
#include "tests/gateway/rig.h"

namespace vgyro::gateway {
namespace {

using rig::Dice;
using rig::Event;
using rig::ms;
using rig::Recording;

constexpr double kSigma_dps = 0.01;
constexpr double kLimit_dps = 300.0;
constexpr std::array<double, 2> kBias_dps{0.5, -0.3};
constexpr TimePoint kStart = time_from_ns(1'700'000'000'000'000'000);
constexpr Duration kHostile = std::chrono::minutes(1);
constexpr double kRest_s = 5.0;
constexpr double kWindow_s = 2.0;

struct Rates {
  std::array<double, 2> hz{100.0, 100.0};
  /// The recovery after the last of many faults, then the calibration; longer if the aligner must
  /// first learn that a gyro is slow.
  double rest_s = 16.0;

  [[nodiscard]] double good_s() const { return rest_s + 14.0; }
  /// At rest, then moving to and fro.
  [[nodiscard]] double truth_dps(double t_s) const {
    return t_s < rest_s ? 0.0 : 20.0 * std::sin(0.5 * (t_s - rest_s));
  }
};

class Gyros {
 public:
  Gyros(const Rates& rates, std::uint32_t seed) : rates_(rates), noise_(seed) {}

  /// Both gyros for this long; if it `moves`, the platform moves after the rest.
  Recording speak(TimePoint from, Duration length, bool moves) {
    std::vector<Recording> parts(2);
    for (std::size_t gyro = 0; gyro < 2; ++gyro) {
      const Duration period = from_seconds(1.0 / rates_.hz[gyro]);
      for (Duration t = gyro == 0 ? ms(0) : period / 3; t < length; t += period)
        parts[gyro].push_back(
            sample(gyro, from + t, moves ? rates_.truth_dps(to_seconds(t)) : 0.0));
    }
    return rig::merge(std::move(parts));
  }

  Event sample(std::size_t gyro, TimePoint t, double rate_dps) {
    std::normal_distribution<double> noise(kBias_dps[gyro], kSigma_dps);
    Event event{static_cast<can::BusIndex>(gyro),
                rig::rate_frame(gyro == 0 ? rig::kIdA : rig::kIdB, rate_dps + noise(noise_)), t};
    event.frame.data[6] = ++counter_[gyro];
    return event;
  }

 private:
  Rates rates_;
  std::mt19937 noise_;
  std::array<std::uint8_t, 2> counter_{};
};

Plan plan_of(Method method) {
  Plan plan = rig::two_gyros();
  plan.corrector.method = method;
  plan.corrector.order = 0;
  plan.corrector.window_s = kWindow_s;
  plan.calibration.rest_s = kRest_s;
  for (GyroPlan& gyro : plan.gyros) {
    gyro.rate.minimum = -kLimit_dps;
    gyro.rate.maximum = kLimit_dps;
    gyro.rate.step = rig::kInputStep_dps;
    gyro.valid =
        ValidCondition{rig::codec_of(rig::signal_of(32, 8, 1.0, 0.0, dbc::ValueType::kUnsigned)),
                       Comparison::kEqual, 0.0, "S == 0"};
    gyro.e2e.counter = AliveCounter{
        "C", rig::codec_of(rig::signal_of(48, 8, 1.0, 0.0, dbc::ValueType::kUnsigned)), 256};
  }
  return plan;
}

// --- what can happen to a recording
// --------------------------------------------------------------

enum class Evil : std::uint32_t {
  kLate,        // read half a second after its stamp
  kTwice,       // with the same stamp
  kTwiceApart,  // with a stamp and a counter of their own
  kWildStamps,  // some frames have a random stamp
  kFirstWild,   // only the first frame has one
  kHoleOfOne,
  kHoleOfBoth,
  kBurst,  // many at one instant, as from a queue
  kSlow,   // only a few frames arrive
  kSwappedBuses,
  kGarbage,  // bits that are no rate
  kFlagged,
  kClockForth,
  kClockBack,
  kFrozenCounter,
  kZeros,
  kCount
};

struct Spell {
  Evil evil = Evil::kLate;
  TimePoint from;
  TimePoint to;
  std::size_t gyro = 0;
  std::int64_t size_ms = 0;
};

class HostileMinute {
 public:
  explicit HostileMinute(std::uint32_t seed) : dice_(seed) {
    const std::uint32_t count = 1 + dice_.below(6);
    for (std::uint32_t i = 0; i < count; ++i) {
      const Duration from = ms(dice_.one_in(3) ? 0 : dice_.below(60'000));
      spells_.push_back({static_cast<Evil>(dice_.below(static_cast<std::uint32_t>(Evil::kCount))),
                         kStart + from, kStart + from + ms(100 + dice_.below(60'000)),
                         dice_.below(2), size_ms()});
    }
  }

  Recording of(const Recording& good) {
    Recording bad;
    for (const Event& event : good)
      suffer(event, bad);
    for (const Event& event : late_)
      bad.push_back(event);
    return bad;
  }

  [[nodiscard]] std::string text() const {
    std::string text;
    for (const Spell& spell : spells_) {
      text += " evil " + std::to_string(static_cast<unsigned>(spell.evil)) + " of gyro " +
              std::to_string(spell.gyro) + " from " +
              std::to_string(to_seconds(spell.from - kStart)) + " to " +
              std::to_string(to_seconds(spell.to - kStart)) + ", " + std::to_string(spell.size_ms) +
              " ms;";
    }
    return text;
  }

 private:
  /// From a millisecond to years.
  std::int64_t size_ms() {
    constexpr double kDecades = 11.0;
    const double share = static_cast<double>(dice_.below(1000)) / 1000.0;
    return static_cast<std::int64_t>(std::pow(10.0, kDecades * share));
  }

  void suffer(const Event& event, Recording& bad) {
    Event one = event;
    std::vector<Event> more;
    for (const Spell& spell : spells_) {
      if (event.stamp < spell.from || event.stamp >= spell.to) continue;
      const bool concerned = event.bus == spell.gyro;
      if (!suffer(spell, concerned, one, more)) return;
    }
    bad.push_back(one);
    bad.insert(bad.end(), more.begin(), more.end());
    if (late_.size() > 40) {
      bad.insert(bad.end(), late_.begin(), late_.end());
      late_.clear();
    }
  }

  /// False if the frame does not arrive, or not yet.
  bool suffer(const Spell& spell, bool concerned, Event& one, std::vector<Event>& more) {
    const bool both = spell.evil == Evil::kHoleOfBoth || spell.evil == Evil::kClockForth ||
                      spell.evil == Evil::kClockBack || spell.evil == Evil::kSwappedBuses;
    if (!concerned && !both) return true;
    switch (spell.evil) {
      case Evil::kLate:
        if (!dice_.one_in(3)) return true;
        late_.push_back(one);
        return false;
      case Evil::kTwice:
        more.push_back(one);
        return true;
      case Evil::kTwiceApart:
        more.push_back(one);
        more.back().stamp += std::chrono::microseconds(1 + dice_.below(3000));
        more.back().frame.data[6] ^= 0x80U;
        return true;
      case Evil::kWildStamps:
        if (dice_.one_in(4)) make_wild(one);
        return true;
      case Evil::kFirstWild:
        if (!wild_[spell.gyro]) make_wild(one);
        wild_[spell.gyro] = true;
        return true;
      case Evil::kHoleOfOne:
      case Evil::kHoleOfBoth:
        return false;
      case Evil::kBurst:
        one.stamp = spell.from + std::chrono::microseconds(burst_us_ += 1 + dice_.below(50));
        return true;
      case Evil::kSlow:
        return dice_.one_in(30);
      case Evil::kSwappedBuses:
        one.bus = static_cast<can::BusIndex>(1 - one.bus);
        return true;
      case Evil::kGarbage:
        if (!dice_.one_in(5)) return true;
        for (std::uint8_t& byte : one.frame.data)
          byte = static_cast<std::uint8_t>(dice_.below(256));
        one.frame.length = static_cast<std::uint8_t>(dice_.below(9));
        return true;
      case Evil::kFlagged:
        one.frame.data[4] = 1;
        return true;
      case Evil::kClockForth:
        one.stamp += ms(spell.size_ms);
        return true;
      case Evil::kClockBack:
        one.stamp -= ms(spell.size_ms);
        return true;
      case Evil::kFrozenCounter:
        one.frame.data[6] = 7;
        return true;
      case Evil::kZeros:
        std::fill_n(one.frame.data.begin(), 4, std::uint8_t{0});
        return true;
      case Evil::kCount:
        break;
    }
    return true;
  }

  void make_wild(Event& event) {
    const bool anywhere = dice_.one_in(4);
    if (anywhere) {
      event.stamp =
          time_from_ns(static_cast<std::int64_t>(dice_.bits() % 9'000'000'000'000'000'000));
    } else {
      event.stamp += ms(static_cast<std::int64_t>(dice_.below(40'000)) - 20'000);
    }
  }

  Dice dice_;
  std::vector<Spell> spells_;
  std::vector<Event> late_;
  std::array<bool, 2> wild_{};
  std::int64_t burst_us_ = 0;
};

struct End {
  std::uint64_t valid = 0;
  std::uint64_t invalid = 0;
  double worst_dps = 0.0;
  State state = State::kWaiting;
};

/// Results in the last two seconds of the good recording.
struct EndWatcher final : RateObserver {
  EndWatcher(const Rates& rates, TimePoint good_from, TimePoint judged_from)
      : rates_(rates), good_from_(good_from), judged_from_(judged_from) {}
  void on_rate(TimePoint t, const std::array<double, 2>& /*raw_dps*/, double virtual_dps) override {
    if (t < judged_from_) return;
    if (std::isnan(virtual_dps)) {
      ++end.invalid;
      return;
    }
    ++end.valid;
    const double error_dps = virtual_dps - rates_.truth_dps(to_seconds(t - good_from_));
    end.worst_dps = std::max(end.worst_dps, std::abs(error_dps));
  }
  End end;

 private:
  Rates rates_;
  TimePoint good_from_;
  TimePoint judged_from_;
};

/// Uses the timer like the daemon, but not ten times a second through years that the clock leapt
/// over.
void receive(Pipeline& pipeline, const Event& event, rig::Collector& out) {
  constexpr int kMost = 20;
  for (int i = 0; i < kMost && pipeline.next_deadline() < event.stamp; ++i)
    pipeline.advance(pipeline.next_deadline(), out);
  pipeline.receive(event.bus, event.frame, event.stamp, out);
  out.frames.clear();
}

End play(const Plan& plan, const Recording& before, const Recording& good, const Rates& rates,
         double judged_s) {
  Pipeline pipeline(plan);
  rig::Collector out;
  for (const Event& event : before)
    receive(pipeline, event, out);
  const TimePoint good_from = good.front().stamp;
  EndWatcher watcher(rates, good_from, good_from + from_seconds(rates.good_s() - judged_s));
  pipeline.observe(&watcher);
  for (const Event& event : good)
    receive(pipeline, event, out);
  pipeline.observe(nullptr);
  watcher.end.state = pipeline.status().state;
  return watcher.end;
}

enum class Calibrated : std::uint8_t { kBefore, kWithinOrBehind };

void expect_recovery(const Rates& rates, Method method, Calibrated when, std::uint32_t seed) {
  Gyros gyros(rates, seed);
  HostileMinute hostile(seed);
  Recording before;
  if (when == Calibrated::kBefore) {
    const Duration calm = from_seconds(rates.rest_s);
    before = gyros.speak(kStart - calm, calm, false);
  }
  const Recording bad = hostile.of(gyros.speak(kStart, kHostile, false));
  before.insert(before.end(), bad.begin(), bad.end());
  const Recording good = gyros.speak(kStart + kHostile, from_seconds(rates.good_s()), true);
  const double judged_s = std::max(2.0, 4.0 / std::min(rates.hz[0], rates.hz[1]));
  const Plan plan = plan_of(method);
  const End alone = play(plan, {}, good, rates, judged_s);
  const End end = play(plan, before, good, rates, judged_s);
  SCOPED_TRACE("seed " + std::to_string(seed) + " at " + std::to_string(rates.hz[0]) + " and " +
               std::to_string(rates.hz[1]) + " Hz, method " +
               std::to_string(static_cast<int>(method)) + ":" + hostile.text());
  ASSERT_GT(alone.valid, 2U);
  ASSERT_EQ(alone.invalid, 0U);
  ASSERT_EQ(alone.state, State::kRunning);
  EXPECT_EQ(end.state, State::kRunning);
  EXPECT_GE(end.valid + 2, alone.valid);
  EXPECT_EQ(end.invalid, 0U);
  // If garbage was learned instead of a rest, only the next rest corrects it.
  if (when == Calibrated::kBefore || method == Method::kMean) {
    EXPECT_LT(end.worst_dps, alone.worst_dps + 0.02);
  }
}

void expect_recoveries(const Rates& rates, Method method, std::uint32_t seeds) {
  for (std::uint32_t seed = 0; seed < seeds; ++seed) {
    expect_recovery(rates, method, Calibrated::kBefore, seed);
    expect_recovery(rates, method, Calibrated::kWithinOrBehind, seed);
  }
}

constexpr std::array kQuickRates{Rates{}, Rates{{100.0, 333.0}}, Rates{{1000.0, 10.0}}};
constexpr Rates kSlowRates{{1.0, 1.0}, 80.0};

TEST(Recovery, AnyHostileMinuteIsForgottenByMean) {
  for (const Rates& rates : kQuickRates)
    expect_recoveries(rates, Method::kMean, 40);
}

TEST(Recovery, AnyHostileMinuteIsForgottenByMutual) {
  for (const Rates& rates : kQuickRates)
    expect_recoveries(rates, Method::kMutual, 20);
}

TEST(Recovery, AnyHostileMinuteIsForgottenByOptimal) {
  for (const Rates& rates : kQuickRates)
    expect_recoveries(rates, Method::kOptimal, 60);
}

// The stamp guard and the time-outs adapt to slow gyros.
TEST(Recovery, AnyHostileMinuteIsForgottenWithGyrosOfOneHertz) {
  expect_recoveries(kSlowRates, Method::kMean, 100);
  expect_recoveries(kSlowRates, Method::kMutual, 100);
}

}  // namespace
}  // namespace vgyro::gateway

// Healthy pairs of many kinds are never contradicted; impossible pairs soon are, with the right
// cause.

#include "fusion/pair_relation.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <functional>
#include <optional>
#include <vector>

#include <gtest/gtest.h>

#include "random.h"

namespace vgyro::fusion {
namespace {

constexpr double kPi = 3.14159265358979323846;

// A platform's rate, deg/s, as a sum of smooth turns: of a car, a ship, a hand or a turntable.
class Motion {
 public:
  enum class Kind : std::uint8_t {
    kDrive,
    kShip,
    kHand,
    kTable,
    kSlalom,
    kStill,
    kOneTurn,
    kSpin,
    kCrawl
  };
  static constexpr int kKinds = 9;

  Motion(Kind kind, std::uint64_t seed, double length_s) {
    Random random(seed);
    switch (kind) {
      case Kind::kDrive:
        for (double t = random.uniform(5.0, 15.0); t < length_s; t += random.uniform(4.0, 25.0)) {
          const double rate_dps = random.uniform(3.0, 25.0) * (random.below(2) == 0 ? -1.0 : 1.0);
          turns_.push_back({t, random.uniform(0.8, 3.0), random.uniform(1.0, 6.0), rate_dps});
        }
        waves_.push_back({random.uniform(0.05, 0.3), random.uniform(0.1, 0.4), 0.0});
        break;
      case Kind::kShip:
        for (int i = 0; i < 3; ++i)
          waves_.push_back(
              {random.uniform(0.5, 3.0), random.uniform(0.06, 0.2), random.uniform(0.0, 6.0)});
        break;
      case Kind::kHand:
        for (int i = 0; i < 8; ++i)
          waves_.push_back(
              {random.uniform(2.0, 20.0), random.uniform(0.1, 1.5), random.uniform(0.0, 6.0)});
        break;
      case Kind::kTable:
        waves_.push_back({random.uniform(5.0, 60.0), random.uniform(0.2, 1.2), 0.0});
        break;
      case Kind::kSlalom:
        waves_.push_back({random.uniform(8.0, 30.0), random.uniform(0.3, 0.6), 0.0});
        waves_.push_back({random.uniform(1.0, 4.0), random.uniform(0.7, 1.0), 1.0});
        break;
      case Kind::kStill:
        break;
      case Kind::kOneTurn:
        turns_.push_back({random.uniform(13.0, 200.0), random.uniform(0.3, 3.0),
                          random.uniform(0.1, 5.0), random.uniform(-60.0, 60.0)});
        break;
      case Kind::kSpin:
        turns_.push_back({random.uniform(13.0, 60.0), random.uniform(0.3, 20.0), 1e6,
                          random.uniform(-600.0, 600.0)});
        break;
      case Kind::kCrawl:
        for (double t = random.uniform(5.0, 15.0); t < length_s; t += random.uniform(4.0, 25.0))
          turns_.push_back(
              {t, random.uniform(2.0, 6.0), random.uniform(2.0, 15.0), random.uniform(-2.0, 2.0)});
        break;
    }
  }

  // The platform rests at first.
  [[nodiscard]] double at(double t_s) const {
    return smooth((t_s - kRest_s) / 2.0) * moving_at(t_s);
  }

 private:
  static constexpr double kRest_s = 12.0;

  [[nodiscard]] double moving_at(double t_s) const {
    double rate_dps = 0.0;
    for (const Wave& wave : waves_)
      rate_dps += wave.rate_dps * std::sin(2.0 * kPi * wave.frequency_hz * t_s + wave.phase);
    for (const Turn& turn : turns_) {
      const double in = smooth((t_s - turn.from_s) / turn.ramp_s);
      const double out = smooth((t_s - turn.from_s - turn.ramp_s - turn.hold_s) / turn.ramp_s);
      rate_dps += turn.rate_dps * (in - out);
    }
    return rate_dps;
  }

  struct Turn {
    double from_s;
    double ramp_s;
    double hold_s;
    double rate_dps;
  };
  struct Wave {
    double rate_dps;
    double frequency_hz;
    double phase;
  };
  static double smooth(double x) {
    if (x <= 0.0) return 0.0;
    return x >= 1.0 ? 1.0 : x * x * (3.0 - 2.0 * x);
  }
  std::vector<Turn> turns_;
  std::vector<Wave> waves_;
};

struct RelationGyro {
  double slope = 1.0;
  double delay_s = 0.0;
  double cutoff_hz = 0.0;  ///< 0: none
  double bias_dps = 0.0;
  double white_dps = 0.01;  ///< of a sample
  double step_dps = 0.0;
  double ramp_dps_s = 0.0;
  double shake_dps = 0.0;  ///< vibration of its own, between 5 and 30 Hz
  std::vector<double> jumps_s;
  double jump_dps = 0.0;
  double skew = 0.0;  ///< relative error of its clock; positive: fast
  double clip_dps = 1e9;
  double spikes_hz = 0.0;
  double spike_dps = 0.0;
  double sick_from_s = 1e9;  ///< from here to sick_to_s …
  double sick_to_s = 1e9;
  double sick_noise_dps = 0.0;          ///< … it has this noise
  bool stuck = false;                   ///< … its value stands
  bool blind = false;                   ///< … it feels no rotation
  std::function<double(double)> bytes;  ///< change of its value in transmission
};

struct RelationWorld {
  std::array<RelationGyro, 2> gyros;
  double rate_hz = 100.0;
  double length_s = 240.0;
};

using Own = std::function<double(double)>;

/// Runs the relation over a world; `own` is the rate that gyro 2 feels instead of the platform's.
class RelationRun {
 public:
  RelationRun(const RelationWorld& world, const Motion& motion, std::uint64_t seed,
              const Own& own = {})
      : world_(world), random_(seed) {
    const double step_s = 1.0 / world.rate_hz;
    for (auto& hz : shake_hz_)
      hz = random_.uniform(5.0, 30.0);
    const auto count = static_cast<int>(world.length_s * world.rate_hz);
    for (int i = 0; i < count; ++i) {
      const double t_s = i * step_s;
      std::array<double, 2> reading{};
      for (std::size_t gyro = 0; gyro < 2; ++gyro) {
        const double felt_s = t_s * (1.0 + world.gyros[gyro].skew) - world.gyros[gyro].delay_s;
        reading[gyro] = read(gyro, t_s, gyro == 1 && own ? own(felt_s) : motion.at(felt_s), step_s);
      }
      relation.add(t_s, reading);
      if (!relation.contradicts()) continue;
      ++contradicted;
      if (!first_s) {
        first_s = t_s;
        first = relation.verdict();
      }
    }
  }

  PairRelation relation;
  std::optional<double> first_s;
  PairVerdict first;
  int contradicted = 0;

 private:
  double read(std::size_t gyro, double t_s, double rate_dps, double step_s) {
    const RelationGyro& own = world_.gyros[gyro];
    double& state = low_pass_[gyro];
    const double share =
        own.cutoff_hz > 0.0 ? 1.0 - std::exp(-2.0 * kPi * own.cutoff_hz * step_s) : 1.0;
    state += share * (rate_dps - state);
    const bool sick = t_s >= own.sick_from_s && t_s < own.sick_to_s;
    double value =
        (own.blind && sick ? 0.0 : own.slope * state) + own.bias_dps + own.ramp_dps_s * t_s;
    value +=
        own.shake_dps * std::sin(2.0 * kPi * shake_hz_[gyro] * t_s) + random_.normal(own.white_dps);
    if (sick) value += random_.normal(own.sick_noise_dps);
    for (const double at_s : own.jumps_s)
      if (t_s >= at_s) value += own.jump_dps;
    if (random_.uniform(0.0, 1.0) < own.spikes_hz * step_s)
      value += own.spike_dps * (random_.below(2) == 0 ? -1.0 : 1.0);
    value = std::clamp(value, -own.clip_dps, own.clip_dps);
    if (own.step_dps > 0.0) value = own.step_dps * std::round(value / own.step_dps);
    if (sick && own.stuck) value = held_[gyro];
    held_[gyro] = value;
    return own.bytes ? own.bytes(value) : value;
  }

  RelationWorld world_;
  Random random_;
  std::array<double, 2> low_pass_{};
  std::array<double, 2> held_{};
  std::array<double, 2> shake_hz_{};
};

RelationGyro healthy_gyro(Random& draw) {
  RelationGyro gyro;
  if (draw.below(2) == 0) gyro.slope = draw.uniform(0.7, 1.4);
  if (draw.below(2) == 0) gyro.delay_s = draw.uniform(-0.3, 0.3);
  if (draw.below(3) == 0) gyro.cutoff_hz = draw.uniform(1.0, 20.0);
  if (draw.below(3) == 0) gyro.white_dps = draw.uniform(0.1, 2.0);
  if (draw.below(3) == 0) gyro.step_dps = draw.uniform(0.01, 0.5);
  if (draw.below(3) == 0) gyro.ramp_dps_s = draw.uniform(-0.05, 0.05);
  if (draw.below(3) == 0) gyro.shake_dps = draw.uniform(0.1, 3.0);
  if (draw.below(3) == 0) gyro.skew = draw.uniform(-3e-4, 3e-4);
  if (draw.below(3) == 0) {
    gyro.jump_dps = draw.uniform(-8.0, 8.0);
    for (int i = 0; i < 3; ++i)
      gyro.jumps_s.push_back(draw.uniform(10.0, 230.0));
  }
  gyro.bias_dps = draw.uniform(-5.0, 5.0);
  return gyro;
}

double draw_rate_hz(Random& draw) {
  return std::array<double, 5>{10.0, 25.0, 50.0, 100.0, 200.0}.at(draw.below(5));
}

/// Worlds of every kind of motion, drawn by `draw_world`; none may be contradicted.
void expect_no_contradiction(std::uint64_t seeds,
                             const std::function<RelationWorld(Random&)>& draw_world) {
  int runs = 0;
  for (int kind = 0; kind < Motion::kKinds; ++kind) {
    for (std::uint64_t seed = 0; seed < seeds; ++seed) {
      Random draw(1000 * static_cast<std::uint64_t>(kind) + seed);
      const RelationWorld world = draw_world(draw);
      const Motion motion(static_cast<Motion::Kind>(kind), seed, world.length_s);
      const RelationRun run(world, motion, seed + 7);
      ++runs;
      const RelationGyro& other = world.gyros[1];
      EXPECT_EQ(run.contradicted, 0)
          << "kind " << kind << " seed " << seed << " hz " << world.rate_hz << " slope "
          << other.slope << " delay " << other.delay_s << " cutoff " << other.cutoff_hz << " white "
          << other.white_dps << " step " << other.step_dps << " shake " << other.shake_dps
          << " jump " << other.jump_dps << " sick from " << other.sick_from_s << " at "
          << run.first_s.value_or(-1) << " cause " << static_cast<int>(run.first.contradiction)
          << " slope " << run.first.slope << " lag " << run.first.lag_s;
    }
  }
  std::printf("%d runs\n", runs);
}

TEST(PairRelationHealthy, IsNeverContradicted) {
  expect_no_contradiction(60, [](Random& draw) {
    RelationWorld world;
    world.rate_hz = draw_rate_hz(draw);
    RelationGyro& other = world.gyros.at(draw.below(2));
    other = healthy_gyro(draw);
    // At such a slow sampling rate, strong vibration of one gyro looks like motion of its own.
    if (world.rate_hz < 50.0) other.shake_dps = std::min(other.shake_dps, 1.0);
    return world;
  });
}

TEST(PairRelationHealthy, IsNotContradictedWhereOneFallsSick) {
  expect_no_contradiction(60, [](Random& draw) {
    RelationWorld world;
    world.rate_hz = draw_rate_hz(draw);
    RelationGyro& sick = world.gyros.at(draw.below(2));
    sick = healthy_gyro(draw);
    if (world.rate_hz < 50.0) sick.shake_dps = std::min(sick.shake_dps, 1.0);
    sick.sick_from_s = draw.uniform(8.0, 150.0);
    sick.sick_to_s = draw.below(3) == 0 ? 1e9 : sick.sick_from_s + draw.uniform(0.5, 80.0);
    switch (draw.below(4)) {
      case 0:
        sick.stuck = true;
        break;
      case 1:
        sick.blind = true;
        // At such a slow sampling rate, a blind gyro's vibration looks like motion of its own.
        if (world.rate_hz < 100.0) sick.shake_dps = 0.0;
        break;
      case 2:
        sick.spikes_hz = draw.uniform(0.05, 2.0);
        sick.spike_dps = draw.uniform(1.0, 300.0);
        break;
      default:
        sick.sick_noise_dps = draw.uniform(1.0, 25.0);
    }
    return world;
  });
}

// Both gyros feel a line beyond half the sampling rate: its alias looks like slow motion, and its
// sign may differ because the two are sampled at different instants.
TEST(PairRelationHealthy, IsNotContradictedByVibrationBeyondItsBand) {
  for (std::uint64_t seed = 0; seed < 400; ++seed) {
    Random draw(seed);
    const double rate_hz = draw_rate_hz(draw);
    const double line_hz = rate_hz * static_cast<double>(1 + draw.below(3)) +
                           (draw.below(2) == 0 ? -1.0 : 1.0) * draw.uniform(0.2, 1.5);
    const double size_dps = draw.uniform(0.2, 1.0);
    const double offset_s = draw.uniform(0.3, 0.7) / line_hz;
    PairRelation relation;
    for (int i = 0; i < static_cast<int>(120.0 * rate_hz); ++i) {
      const double t_s = i / rate_hz;
      const double first_dps = size_dps * std::sin(2.0 * kPi * line_hz * t_s) + draw.normal(0.01);
      const double second_dps =
          size_dps * std::sin(2.0 * kPi * line_hz * (t_s + offset_s)) + draw.normal(0.01);
      relation.add(t_s, {first_dps, second_dps});
      ASSERT_FALSE(relation.contradicts())
          << "seed " << seed << " line " << line_hz << " Hz at " << rate_hz;
    }
  }
}

// Expects the contradiction to be found within `within_s` seconds.
void expect_found(const char* name, RelationWorld world, Contradiction expected, double slope,
                  double within_s, const std::function<Own(const Motion&)>& own = {},
                  int missed_most = 0, int wrong_most = 0) {
  double longest_s = 0.0;
  double sum_s = 0.0;
  int wrong = 0;
  int missed = 0;
  for (int kind = 0; kind < 3; ++kind) {
    for (std::uint64_t seed = 0; seed < 12; ++seed) {
      world.rate_hz = seed % 2 == 0 ? 100.0 : 50.0;
      const Motion motion(static_cast<Motion::Kind>(kind), seed, world.length_s);
      const RelationRun run(world, motion, seed, own ? own(motion) : Own{});
      if (!run.first_s) {
        ++missed;
        std::printf("%s: missed kind %d seed %d\n", name, kind, static_cast<int>(seed));
        continue;
      }
      if (run.relation.verdict().contradiction != expected) {
        ++wrong;
        std::printf("%s: kind %d seed %d says %d (first %d at %.1f), slope %.2f lag %.2f\n", name,
                    kind, static_cast<int>(seed),
                    static_cast<int>(run.relation.verdict().contradiction),
                    static_cast<int>(run.first.contradiction), *run.first_s,
                    run.relation.verdict().slope, run.relation.verdict().lag_s);
      } else if (std::isfinite(slope)) {
        EXPECT_NEAR(run.relation.verdict().slope, slope, 0.1 * std::abs(slope));
      }
      longest_s = std::max(longest_s, *run.first_s);
      sum_s += *run.first_s;
    }
  }
  std::printf("%s: missed %d, other cause %d, mean %.1f s, longest %.1f s\n", name, missed, wrong,
              sum_s / (36 - missed), longest_s);
  EXPECT_LE(missed, missed_most);
  EXPECT_LE(wrong, wrong_most);
  EXPECT_LT(longest_s, within_s);
}

TEST(PairRelation, FindsAWrongSign) {
  RelationWorld world;
  world.gyros[1].slope = -1.0;
  expect_found("sign", world, Contradiction::kSign, -1.0, 60.0);
}

TEST(PairRelation, FindsAWrongUnit) {
  for (const double factor :
       {57.2958, 1.0 / 57.2958, 3600.0, 1.0 / 3600.0, 6.0, 1.0 / 6.0, -57.2958, 1000.0}) {
    RelationWorld world;
    world.gyros[1].slope = factor;
    world.gyros[1].white_dps = 0.01 * std::abs(factor);
    // On a slowly turning platform, a signal that is divided may look like drift.
    const bool divided = factor < 0.1;
    expect_found("unit", world, factor < 0.0 ? Contradiction::kSign : Contradiction::kScale, factor,
                 divided ? 240.0 : 60.0, {}, divided ? 2 : 0);
  }
}

TEST(PairRelation, FindsALag) {
  for (const double delay_s : {1.0, -1.0, 2.0}) {
    RelationWorld world;
    world.gyros[1].delay_s = delay_s;
    // A ship turns so slowly that a delay of a second hardly exceeds the allowance of a pair.
    expect_found("lag", world, Contradiction::kLag, 1.0, 240.0, {}, 0, 1);
  }
}

TEST(PairRelation, FindsWhatHasNothingInCommon) {
  RelationWorld world;
  std::uint64_t seed = 0;
  expect_found(
      "unrelated", world, Contradiction::kUnrelated, NAN, 240.0,
      [&seed](const Motion&) {
        const auto kind = static_cast<Motion::Kind>(seed / 12 == 1 ? 2 : seed / 12);
        const Motion other(kind, 900 + seed++, 240.0);
        return Own([other](double t_s) { return other.at(t_s); });
      },
      1, 1);
}

TEST(PairRelation, FindsTheWrongAxis) {
  RelationWorld world;
  std::uint64_t seed = 0;
  expect_found("axis", world, Contradiction::kUnrelated, NAN, 240.0, [&seed](const Motion& motion) {
    const Motion roll(Motion::Kind::kHand, 500 + seed++, 240.0);
    return Own([&motion, roll](double t_s) { return 0.1 * motion.at(t_s) + 0.1 * roll.at(t_s); });
  });
}

// A raw value of 16 bits, `step_dps` each, decoded otherwise than it was encoded.
std::function<double(double)> misread(double step_dps, std::function<double(std::uint16_t)> read) {
  return [=](double value_dps) {
    const auto raw =
        static_cast<std::int16_t>(std::clamp(std::lround(value_dps / step_dps), -32768L, 32767L));
    return step_dps * read(static_cast<std::uint16_t>(raw));
  };
}

void expect_wrong_bytes_found(const char* name, const std::function<double(double)>& bytes) {
  double longest_s = 0.0;
  int missed = 0;
  for (int kind = 0; kind < 4; ++kind) {
    for (std::uint64_t seed = 0; seed < 12; ++seed) {
      RelationWorld world;
      world.length_s = 300.0;
      world.gyros[1].bytes = bytes;
      world.gyros[1].bias_dps = Random(seed).uniform(-0.5, 0.5);
      const Motion motion(static_cast<Motion::Kind>(kind), seed, world.length_s);
      const RelationRun run(world, motion, seed);
      if (!run.first_s || !run.relation.contradicts()) ++missed;
      longest_s = std::max(longest_s, run.first_s.value_or(0.0));
    }
  }
  std::printf("%s: missed %d of 48, longest %.1f s\n", name, missed, longest_s);
  // If a hand moves the platform all the time, erratic values cannot always be distinguished from
  // its motion.
  EXPECT_LE(missed, 3);
}

TEST(PairRelation, FindsWrongBytes) {
  for (const double step_dps : {0.005, 0.01}) {
    expect_wrong_bytes_found(
        "unsigned", misread(step_dps, [](std::uint16_t raw) { return static_cast<double>(raw); }));
    expect_wrong_bytes_found(
        "swapped", misread(step_dps, [](std::uint16_t raw) {
          return static_cast<double>(static_cast<std::int16_t>(raw << 8U | raw >> 8U));
        }));
  }
}

TEST(PairRelation, TakesAContradictionBackOnceTheTwoMoveTogether) {
  const Motion motion(Motion::Kind::kDrive, 3, 600.0);
  PairRelation relation;
  Random random(5);
  std::optional<double> back_s;
  for (int i = 0; i < 60000; ++i) {
    const double t_s = 0.01 * i;
    const double rate_dps = motion.at(t_s);
    relation.add(t_s, {rate_dps + random.normal(0.01),
                       (t_s < 300.0 ? -rate_dps : rate_dps) + random.normal(0.01)});
    if (i == 29999) {
      EXPECT_EQ(relation.verdict().contradiction, Contradiction::kSign);
    }
    if (t_s > 300.0 && !back_s && !relation.contradicts()) back_s = t_s;
  }
  ASSERT_TRUE(back_s);
  EXPECT_LT(*back_s, 400.0);
  EXPECT_FALSE(relation.contradicts());
  EXPECT_EQ(relation.times(), 1);
}

TEST(PairRelation, KeepsWhatAnEarlierRunFoundUntilThePairHasMoved) {
  PairVerdict found;
  found.contradiction = Contradiction::kSign;
  found.slope = -1.0;
  const Motion motion(Motion::Kind::kDrive, 4, 240.0);
  PairRelation relation;
  relation.resume(found);
  for (int i = 0; i < 24000; ++i) {
    const double t_s = 0.01 * i;
    relation.add(t_s, {motion.at(t_s), motion.at(t_s)});
    if (t_s < 12.0) {
      ASSERT_EQ(relation.verdict().contradiction, Contradiction::kSign) << t_s;
    }
  }
  EXPECT_FALSE(relation.contradicts());
}

}  // namespace
}  // namespace vgyro::fusion

// Healthy pairs of many kinds are never contradicted; pairs that cannot be one are, soon, and by name.

#include "fusion/pair_relation.h"

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

// A platform's rate, deg/s, as a sum of smooth turns: what a car, a ship, a hand or a turntable does.
class Motion {
 public:
  enum class Kind : std::uint8_t { kDrive, kShip, kHand, kTable, kSlalom };
  static constexpr int kKinds = 5;

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
          waves_.push_back({random.uniform(0.5, 3.0), random.uniform(0.06, 0.2), random.uniform(0.0, 6.0)});
        break;
      case Kind::kHand:
        for (int i = 0; i < 8; ++i)
          waves_.push_back({random.uniform(2.0, 20.0), random.uniform(0.1, 1.5), random.uniform(0.0, 6.0)});
        break;
      case Kind::kTable:
        waves_.push_back({random.uniform(5.0, 60.0), random.uniform(0.2, 1.2), 0.0});
        break;
      case Kind::kSlalom:
        waves_.push_back({random.uniform(8.0, 30.0), random.uniform(0.3, 0.6), 0.0});
        waves_.push_back({random.uniform(1.0, 4.0), random.uniform(0.7, 1.0), 1.0});
        break;
    }
  }

  [[nodiscard]] double at(double t_s) const {
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

 private:
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
  double shake_dps = 0.0;   ///< vibration of its own, between 5 and 30 Hz
  std::vector<double> jumps_s;
  double jump_dps = 0.0;
  bool blind = false;
};

struct RelationWorld {
  std::array<RelationGyro, 2> gyros;
  double rate_hz = 100.0;
  double length_s = 240.0;
};

using Own = std::function<double(double)>;

/// What the relation says at each pair; `own` is what gyro 2 feels instead of the platform's rate.
class RelationRun {
 public:
  RelationRun(const RelationWorld& world, const Motion& motion, std::uint64_t seed, const Own& own = {})
      : world_(world), random_(seed) {
    const double step_s = 1.0 / world.rate_hz;
    for (auto& hz : shake_hz_) hz = random_.uniform(5.0, 30.0);
    const auto count = static_cast<int>(world.length_s * world.rate_hz);
    for (int i = 0; i < count; ++i) {
      const double t_s = i * step_s;
      std::array<double, 2> reading{};
      for (std::size_t gyro = 0; gyro < 2; ++gyro) {
        const double felt_s = t_s - world.gyros[gyro].delay_s;
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
    const double share = own.cutoff_hz > 0.0 ? 1.0 - std::exp(-2.0 * kPi * own.cutoff_hz * step_s) : 1.0;
    state += share * (rate_dps - state);
    double value = (own.blind ? 0.0 : own.slope * state) + own.bias_dps + own.ramp_dps_s * t_s;
    value += own.shake_dps * std::sin(2.0 * kPi * shake_hz_[gyro] * t_s) + random_.normal(own.white_dps);
    for (const double at_s : own.jumps_s)
      if (t_s >= at_s) value += own.jump_dps;
    return own.step_dps > 0.0 ? own.step_dps * std::round(value / own.step_dps) : value;
  }

  RelationWorld world_;
  Random random_;
  std::array<double, 2> low_pass_{};
  std::array<double, 2> shake_hz_{};
};

TEST(PairRelationHealthy, IsNeverContradicted) {
  int runs = 0;
  for (int kind = 0; kind < Motion::kKinds; ++kind) {
    for (std::uint64_t seed = 0; seed < 40; ++seed) {
      Random draw(1000 * static_cast<std::uint64_t>(kind) + seed);
      RelationWorld world;
      world.rate_hz = std::array<double, 5>{10.0, 25.0, 50.0, 100.0, 200.0}.at(draw.below(5));
      RelationGyro& other = world.gyros[1];
      if (draw.below(2) == 0) other.slope = draw.uniform(0.7, 1.3);
      if (draw.below(2) == 0) other.delay_s = draw.uniform(-0.4, 0.4);
      if (draw.below(3) == 0) other.cutoff_hz = draw.uniform(0.5, 20.0);
      if (draw.below(3) == 0) other.white_dps = 0.3;
      if (draw.below(3) == 0) other.step_dps = draw.uniform(0.01, 0.5);
      if (draw.below(3) == 0) other.ramp_dps_s = draw.uniform(-0.05, 0.05);
      if (draw.below(3) == 0) other.shake_dps = draw.uniform(0.1, 3.0);
      // Sampled so slowly a blind gyro's vibration is motion of its own.
      if (draw.below(4) == 0) {
        other.blind = true;
        if (world.rate_hz < 100.0) other.shake_dps = 0.0;
      }
      if (draw.below(3) == 0) {
        other.jump_dps = draw.uniform(-8.0, 8.0);
        for (int i = 0; i < 3; ++i) other.jumps_s.push_back(draw.uniform(10.0, 230.0));
      }
      other.bias_dps = draw.uniform(-5.0, 5.0);
      const Motion motion(static_cast<Motion::Kind>(kind), seed, world.length_s);
      const RelationRun run(world, motion, seed + 7);
      ++runs;
      EXPECT_EQ(run.contradicted, 0)
          << "kind " << kind << " seed " << seed << " hz " << world.rate_hz << " slope " << other.slope << " delay "
          << other.delay_s << " cutoff " << other.cutoff_hz << " white " << other.white_dps << " step "
          << other.step_dps << " shake " << other.shake_dps << " jump " << other.jump_dps << " blind " << other.blind
          << " at " << run.first_s.value_or(-1) << " cause " << static_cast<int>(run.first.contradiction)
          << " slope " << run.first.slope << " lag " << run.first.lag_s;
    }
  }
  std::printf("%d healthy runs\n", runs);
}

// How far gyro 1 has to have moved before it is found, seconds into the recording.
void expect_found(const char* name, RelationWorld world, Contradiction expected, double slope, double within_s,
                  const std::function<Own(const Motion&)>& own = {}, int missed_most = 0) {
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
        std::printf("%s: kind %d seed %d says %d (first %d at %.1f), slope %.2f lag %.2f\n", name, kind,
                    static_cast<int>(seed), static_cast<int>(run.relation.verdict().contradiction),
                    static_cast<int>(run.first.contradiction), *run.first_s, run.relation.verdict().slope,
                    run.relation.verdict().lag_s);
      } else if (std::isfinite(slope)) {
        EXPECT_NEAR(run.relation.verdict().slope, slope, 0.1 * std::abs(slope));
      }
      longest_s = std::max(longest_s, *run.first_s);
      sum_s += *run.first_s;
    }
  }
  std::printf("%s: missed %d, other cause %d, mean %.1f s, longest %.1f s\n", name, missed, wrong, sum_s / (36 - missed),
              longest_s);
  EXPECT_LE(missed, missed_most);
  EXPECT_EQ(wrong, 0);
  EXPECT_LT(longest_s, within_s);
}

TEST(PairRelation, FindsAWrongSign) {
  RelationWorld world;
  world.gyros[1].slope = -1.0;
  expect_found("sign", world, Contradiction::kSign, -1.0, 60.0);
}

TEST(PairRelation, FindsAWrongUnit) {
  for (const double factor : {57.2958, 1.0 / 57.2958, 3600.0, 1.0 / 3600.0, 6.0, 1.0 / 6.0, -57.2958, 1000.0}) {
    RelationWorld world;
    world.gyros[1].slope = factor;
    world.gyros[1].white_dps = 0.01 * std::abs(factor);
    // What is divided may be drift, where the platform turns slowly.
    const bool divided = factor < 0.1;
    expect_found("unit", world, factor < 0.0 ? Contradiction::kSign : Contradiction::kScale, factor, divided ? 240.0 : 60.0, {}, divided ? 1 : 0);
  }
}

TEST(PairRelation, FindsALag) {
  for (const double delay_s : {1.0, -1.0, 2.0}) {
    RelationWorld world;
    world.gyros[1].delay_s = delay_s;
    expect_found("lag", world, Contradiction::kLag, 1.0, 240.0);
  }
}

TEST(PairRelation, FindsWhatHasNothingInCommon) {
  RelationWorld world;
  std::uint64_t seed = 0;
  expect_found("unrelated", world, Contradiction::kUnrelated, NAN, 240.0, [&seed](const Motion&) {
    const auto kind = static_cast<Motion::Kind>(seed / 12 == 1 ? 2 : seed / 12);
    const Motion other(kind, 900 + seed++, 240.0);
    return Own([other](double t_s) { return other.at(t_s); });
  });
}

TEST(PairRelation, FindsTheWrongAxis) {
  RelationWorld world;
  std::uint64_t seed = 0;
  expect_found("axis", world, Contradiction::kUnrelated, NAN, 240.0, [&seed](const Motion& motion) {
    const Motion roll(Motion::Kind::kHand, 500 + seed++, 240.0);
    return Own([&motion, roll](double t_s) { return 0.1 * motion.at(t_s) + 0.1 * roll.at(t_s); });
  });
}

}  // namespace
}  // namespace vgyro::fusion

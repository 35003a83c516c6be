// Whatever arrives on a bus, the pipeline does not fail, its counts stay consistent, and no rate is
// valid without its preconditions. Each case is a seed, which is printed on failure.

#include <gtest/gtest.h>

#include "gateway/pipeline.h"
#include "tests/gateway/rig.h"

namespace vgyro::gateway {
namespace {

constexpr std::int64_t kStampMax_ns = 9'000'000'000'000'000'000;

class Hostile {
 public:
  explicit Hostile(std::uint32_t seed) : dice_(seed) {}

  can::Frame frame() {
    constexpr std::uint32_t kIds[] = {rig::kIdA, rig::kIdB, rig::kIdReference, 0x610, 0x7FF};
    can::Frame frame;
    frame.id = one_in(8) ? dice_.below(can::kExtendedIdMax) : kIds[dice_.below(std::size(kIds))];
    frame.flags = one_in(4) ? static_cast<std::uint8_t>(dice_.below(64)) : std::uint8_t{0};
    frame.length = one_in(4) ? static_cast<std::uint8_t>(dice_.below(65)) : std::uint8_t{8};
    for (std::uint8_t& byte : frame.data)
      byte = static_cast<std::uint8_t>(dice_.below(256));
    return frame;
  }

  /// Mostly a few milliseconds later, now and then earlier, far ahead, or anywhere.
  TimePoint stamp() {
    now_ns_ += dice_.below(3'000'000);
    if (one_in(200)) now_ns_ -= rig::ms(dice_.below(5'000)).count();
    if (one_in(200)) now_ns_ += rig::ms(dice_.below(20'000)).count();
    if (one_in(500)) now_ns_ = anywhere();
    now_ns_ = std::clamp<std::int64_t>(now_ns_, 0, kStampMax_ns);
    return time_from_ns(one_in(300) ? anywhere() : now_ns_);
  }

  can::BusIndex bus() {
    return static_cast<can::BusIndex>(one_in(10) ? dice_.below(256) : dice_.below(2));
  }
  bool one_in(std::uint32_t n) { return dice_.one_in(n); }

 private:
  std::int64_t anywhere() { return static_cast<std::int64_t>(dice_.bits() % kStampMax_ns); }
  rig::Dice dice_;
  std::int64_t now_ns_ = 1'700'000'000'000'000'000;
};

Plan hostile_plan(std::uint32_t seed) {
  Plan plan = seed % 2 == 0 ? rig::two_gyros() : rig::with_reference();
  plan.output.fd = seed % 3 == 0;
  plan.corrector.order = static_cast<int>(seed % 4);
  plan.corrector.window_s = 0.2;
  plan.calibration.rest_s = 0.1;
  for (GyroPlan& gyro : plan.gyros) {
    gyro.rate.minimum = -3000.0;
    gyro.rate.maximum = 3000.0;
  }
  plan.gyros[0].e2e.counter = AliveCounter{
      "C", rig::codec_of(rig::signal_of(48, 4, 1.0, 0.0, dbc::ValueType::kUnsigned)), 15};
  plan.gyros[1].temperature = rig::quantity_of(rig::signal_of(32, 16));
  plan.gyros[1].valid =
      ValidCondition{rig::codec_of(rig::signal_of(48, 2, 1.0, 0.0, dbc::ValueType::kUnsigned)),
                     Comparison::kNotEqual, 3.0, "S != 3"};
  return plan;
}

void expect_books_to_balance(const Pipeline& pipeline, const rig::Collector& out) {
  const Status& status = pipeline.status();
  for (const GyroStatus& gyro : status.gyros) {
    EXPECT_EQ(gyro.frames, gyro.samples + rig::rejected_total(gyro));
  }
  EXPECT_EQ(status.rates_out, out.with_id(0x610).size());
  EXPECT_EQ(status.biases_out, out.with_id(0x611).size());
  EXPECT_EQ(status.biases_out, out.with_id(0x612).size());
  EXPECT_LE(status.rates_out_valid + status.rates_out_of_range, status.rates_out);
  EXPECT_LE(status.reference_rejected, status.reference_frames);
}

// Random frames of all kinds at random times: no crash, and every frame of a gyro is either a
// sample or counted under its cause.
TEST(Hostile, RandomFramesAreSurvivedAndAccountedFor) {
  for (std::uint32_t seed = 0; seed < 60; ++seed) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    Hostile hostile(seed);
    Pipeline pipeline(hostile_plan(seed));
    rig::Collector out;
    for (int i = 0; i < 5000; ++i) {
      const TimePoint stamp = hostile.stamp();
      pipeline.receive(hostile.bus(), hostile.frame(), stamp, out);
      if (hostile.one_in(20)) pipeline.advance(stamp, out);
    }
    expect_books_to_balance(pipeline, out);
    EXPECT_GT(pipeline.status().gyros[0].samples, 0U);
    EXPECT_GT(pipeline.status().gyros[1].samples, 0U);
  }
}

// Noise on the bus during a calibration that cannot end makes no output valid.
TEST(Hostile, NothingIsValidBeforeCalibration) {
  for (std::uint32_t seed = 0; seed < 20; ++seed) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    Hostile hostile(seed);
    Plan plan = hostile_plan(0);
    plan.calibration.rest_s = 1e12;
    Pipeline pipeline(plan);
    rig::Collector out;
    for (int i = 0; i < 5000; ++i)
      pipeline.receive(hostile.bus(), hostile.frame(), hostile.stamp(), out);
    EXPECT_EQ(pipeline.status().rates_out_valid, 0U);
    EXPECT_NE(pipeline.status().state, State::kRunning);
    EXPECT_NE(pipeline.status().state, State::kDegraded);
  }
}

// Two good gyros among hostile frames of other senders give the same output as alone.
TEST(Hostile, GoodGyrosAreNotDisturbedByOthers) {
  const rig::Recording good =
      rig::merge({rig::stream_a(rig::ms(0), rig::ms(4000), rig::constant(0.1)),
                  rig::stream_b(rig::ms(0), rig::ms(4000), rig::constant(0.2))});
  Pipeline alone(rig::two_gyros());
  rig::Collector expected;
  rig::play(alone, good, expected);
  for (std::uint32_t seed = 0; seed < 20; ++seed) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    Hostile hostile(seed);
    Pipeline pipeline(rig::two_gyros());
    rig::Collector out;
    for (const rig::Event& event : good) {
      can::Frame foreign = hostile.frame();
      foreign.id = 0x700 + foreign.id % 0x80;
      pipeline.receive(hostile.bus(), foreign, event.stamp, out);
      pipeline.receive(event.bus, event.frame, event.stamp, out);
    }
    EXPECT_EQ(out.with_id(0x610), expected.with_id(0x610));
  }
}

Plan protected_plan() {
  Plan plan = rig::two_gyros();
  for (GyroPlan& gyro : plan.gyros) {
    gyro.e2e.counter = AliveCounter{
        "C", rig::codec_of(rig::signal_of(48, 4, 1.0, 0.0, dbc::ValueType::kUnsigned)), 15, 3};
    gyro.e2e.crc = CheckValue{
        "Crc", "crc8_j1850",
        dbc::E2eProtection({.kind = dbc::E2eKind::kCrc8J1850, .crc_byte = 7, .bytes = 8})};
  }
  return plan;
}

// An impostor sends on the gyros' own identifiers, at the right time and in the right form, but
// with wrong check values or counters: every such frame is counted, and the output is that of the
// true gyros, byte for byte.
TEST(Hostile, AnImpostorChangesNothingWhereFramesAreProtected) {
  const Plan plan = protected_plan();
  rig::Recording good = rig::merge({rig::stream_a(rig::ms(0), rig::ms(4000), rig::constant(0.1)),
                                    rig::stream_b(rig::ms(0), rig::ms(4000), rig::constant(0.2))});
  std::array<unsigned, 2> counts{};
  for (rig::Event& event : good) {
    const std::size_t gyro = event.frame.id == rig::kIdA ? 0 : 1;
    event.frame.length = 8;
    event.frame.data[6] = static_cast<std::uint8_t>(counts[gyro]++ % 15);
    plan.gyros[gyro].e2e.crc->protection.seal({event.frame.data.data(), 8});
  }
  Pipeline alone(plan);
  rig::Collector expected;
  rig::play(alone, good, expected);
  ASSERT_GT(alone.status().rates_out_valid, 200U);
  for (std::uint32_t seed = 0; seed < 20; ++seed) {
    SCOPED_TRACE("seed " + std::to_string(seed));
    rig::Dice dice(seed);
    Pipeline pipeline(plan);
    rig::Collector out;
    std::array<std::uint64_t, 2> forged{};
    for (const rig::Event& event : good) {
      pipeline.receive(event.bus, event.frame, event.stamp, out);
      can::Frame forgery = event.frame;
      const std::size_t gyro = forgery.id == rig::kIdA ? 0 : 1;
      forgery.data[2] = static_cast<std::uint8_t>(dice.below(256));
      if (seed % 2 == 0) {
        plan.gyros[gyro].e2e.crc->protection.seal({forgery.data.data(), 8});
        forgery.data[7] = static_cast<std::uint8_t>(forgery.data[7] ^ (1U + dice.below(255)));
      } else {
        forgery.data[6] = static_cast<std::uint8_t>((forgery.data[6] + 5 + dice.below(7)) % 15);
        plan.gyros[gyro].e2e.crc->protection.seal({forgery.data.data(), 8});
      }
      ++forged[gyro];
      pipeline.receive(event.bus, forgery, event.stamp + rig::ms(1), out);
    }
    EXPECT_EQ(out.with_id(0x610), expected.with_id(0x610));
    const Reject cause = seed % 2 == 0 ? Reject::kCrcWrong : Reject::kWrongSequence;
    for (std::size_t gyro = 0; gyro < 2; ++gyro) {
      const GyroStatus& status = pipeline.status().gyros[gyro];
      EXPECT_GT(forged[gyro], 300U);
      EXPECT_EQ(status.rejected[static_cast<std::size_t>(cause)], forged[gyro]);
      EXPECT_FALSE(status.fault);
    }
  }
}

}  // namespace
}  // namespace vgyro::gateway

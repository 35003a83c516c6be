// The gateway's output without an estimation: the grid of VG_Bias through gaps and leaps of time,
// the counts, and frames that match the DBC file.

#include "gateway/sender.h"

#include <cmath>
#include <limits>
#include <new>
#include <vector>

#include <gtest/gtest.h>

#include "receiver.h"
#include "rig.h"

namespace vgyro::gateway {
namespace {

using rig::at_ms;
using rig::ms;

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
constexpr std::uint32_t kRateId = 0x610;
constexpr std::uint32_t kBiasId = 0x611;
constexpr std::uint32_t kModelId = 0x612;

RateOutput rate_of(double rate_dps) {
  return {.valid = true,
          .rate_dps = rate_dps,
          .sigma_dps = 0.004,
          .corrected_dps = {rate_dps, rate_dps},
          .state = State::kRunning,
          .quality = Quality::kTwoGyros,
          .health = 0,
          .age = ms(3),
          .instant = at_ms(0)};
}

class SenderTest : public ::testing::Test {
 protected:
  void rate(TimePoint stamp, const RateOutput& output) {
    const Sender::Turn turn(sender, out, stamp);
    sender.send_rate(output);
  }
  void bias(TimePoint stamp, const BiasOutput& bias_output, const ModelOutput& model_output) {
    const Sender::Turn turn(sender, out, stamp);
    sender.send_bias(bias_output, model_output);
  }
  [[nodiscard]] Status status() const {
    Status told;
    sender.tell(told);
    return told;
  }
  /// Offers samples at these instants; returns those that reached a grid point.
  std::vector<TimePoint> reached(TimePoint from, TimePoint to, Duration every) {
    std::vector<TimePoint> found;
    for (TimePoint t = from; t < to; t += every)
      if (sender.reach_grid(t)) found.push_back(t);
    return found;
  }

  const Receiver receiver{"vgyro.dbc"};
  Sender sender{OutputPlan{}};
  rig::Collector out;
};

// --- the grid ------------------------------------------------------------------------------------

// Ten points a second at whole tenths of the time axis, whatever the phase of the samples.
TEST_F(SenderTest, GridStandsAtWholeTenthsOfASecond) {
  const std::vector<TimePoint> found = reached(at_ms(1003), at_ms(3003), ms(10));
  ASSERT_EQ(found.size(), 20U);
  EXPECT_EQ(found[0], at_ms(1003));  // the first sample sends at once
  for (std::size_t i = 1; i < found.size(); ++i)
    EXPECT_EQ(found[i], at_ms(1003 + 100 * static_cast<std::int64_t>(i))) << i;
}

// Grid points that fell into a gap of the samples cause one frame, not one each.
TEST_F(SenderTest, GapInTheSamplesCostsPointsAndBringsNoBurst) {
  reached(at_ms(1000), at_ms(2000), ms(10));
  const std::vector<TimePoint> behind = reached(at_ms(5555), at_ms(5900), ms(10));
  const std::vector<TimePoint> expected{at_ms(5555), at_ms(5605), at_ms(5705), at_ms(5805)};
  EXPECT_EQ(behind, expected);
}

// Samples slower than the grid drive it one by one.
TEST_F(SenderTest, SlowSamplesAreAPointEach) {
  EXPECT_EQ(reached(at_ms(0), at_ms(3000), ms(250)).size(), 12U);
}

// After a leap ahead the grid continues at once from the new time.
TEST_F(SenderTest, LeapAheadGoesOnAtTheNewTime) {
  reached(at_ms(1000), at_ms(2000), ms(10));
  const TimePoint later = at_ms(2000) + std::chrono::hours(24 * 365);
  EXPECT_EQ(reached(later, later + ms(1000), ms(10)).size(), 10U);
}

// A clock that was set back by more than a second moves the grid back; samples that are merely out
// of order do not.
TEST_F(SenderTest, ClockSetBackTakesTheGridBack) {
  reached(at_ms(100'000), at_ms(101'000), ms(10));  // the next point is at 101 s
  EXPECT_FALSE(sender.reach_grid(at_ms(100'000)));
  EXPECT_TRUE(sender.reach_grid(at_ms(99'999)));
  EXPECT_EQ(reached(at_ms(100'000), at_ms(101'000), ms(10)).size(), 10U);
}

// The timer leaves the grid to the samples, and sends half a period after a point that none of them
// reached; with slow samples after two of their intervals.
TEST_F(SenderTest, TimerStepsInOnlyWhereSamplesDoNotCome) {
  ASSERT_TRUE(sender.reach_grid(at_ms(1000)));  // the next point is at 1.1 s
  EXPECT_EQ(sender.grid_missed_at(Duration::zero()), at_ms(1150));
  EXPECT_EQ(sender.grid_missed_at(ms(10)), at_ms(1150));
  EXPECT_EQ(sender.grid_missed_at(ms(400)), at_ms(1900));
  EXPECT_FALSE(sender.miss_grid(at_ms(1150) - Duration(1), ms(10)));
  EXPECT_FALSE(sender.miss_grid(at_ms(1150), ms(400)));
  EXPECT_TRUE(sender.miss_grid(at_ms(1150), ms(10)));
  EXPECT_FALSE(sender.miss_grid(at_ms(1150), ms(10))) << "once";
  EXPECT_FALSE(sender.reach_grid(at_ms(1199)));
  EXPECT_TRUE(sender.reach_grid(at_ms(1200)));
}

// Driven by the timer alone, exactly at its deadlines, the output is a heartbeat that never stops.
TEST_F(SenderTest, TimerAloneIsAHeartbeat) {
  TimePoint t = at_ms(777);
  ASSERT_TRUE(sender.miss_grid(t, Duration::zero())) << "at once, before the first sample";
  for (int i = 0; i < 100; ++i) {
    const TimePoint due = sender.grid_missed_at(Duration::zero());
    ASSERT_GT(due, t);
    ASSERT_LE(due - t, Sender::kBiasPeriod + Sender::kBiasGrace);
    t = due;
    ASSERT_TRUE(sender.miss_grid(t, Duration::zero()));
  }
}

// A VG_Bias that is sent because of a change of state does not shift the grid.
TEST_F(SenderTest, BiasOutOfTurnLeavesTheGrid) {
  ASSERT_TRUE(sender.reach_grid(at_ms(1000)));
  bias(at_ms(1042), {}, {});
  EXPECT_FALSE(sender.reach_grid(at_ms(1099)));
  EXPECT_TRUE(sender.reach_grid(at_ms(1100)));
}

// --- frames --------------------------------------------------------------------------------------

// Every frame decodes by the DBC file to the given values, and has the stamp of its cause.
TEST_F(SenderTest, FramesSayWhatTheDbcFileSays) {
  rate(at_ms(1003), rate_of(-12.34565));
  bias(at_ms(1004), {{0.12345, -1.5}, BiasMode::kStop, kGyro2Suspect}, {-2.5e-5, 0.003, 1e-5});
  ASSERT_EQ(out.frames.size(), 3U);
  Fields fields = receiver.decode(out.frames[0].frame);
  EXPECT_NEAR(fields["VG_Rate"].value, -12.34565, 1e-9);
  EXPECT_NEAR(fields["VG_Sigma"].value, 0.004, 1e-9);
  EXPECT_NEAR(fields["VG_Age"].value, 3.0, 1e-9);
  EXPECT_EQ(fields["VG_State"].label, "running");
  EXPECT_EQ(fields["VG_Quality"].label, "two_gyros");
  EXPECT_EQ(fields["VG_Valid"].raw, 1);
  fields = receiver.decode(out.frames[1].frame);
  EXPECT_NEAR(fields["VB_Bias1"].value, 0.12345, 1e-9);
  EXPECT_NEAR(fields["VB_Bias2"].value, -1.5, 1e-9);
  EXPECT_EQ(fields["VB_Mode"].label, "stop");
  EXPECT_EQ(fields["VB_Health"].raw, kGyro2Suspect);
  fields = receiver.decode(out.frames[2].frame);
  EXPECT_NEAR(fields["VM_Slope"].value, -2.5e-5, 1e-12);
  EXPECT_NEAR(fields["VM_BiasSigma"].value, 0.003, 1e-9);
  EXPECT_NEAR(fields["VM_SlopeSigma"].value, 1e-5, 1e-12);
  EXPECT_EQ(out.frames[0].stamp, at_ms(1003));
  EXPECT_EQ(out.frames[1].stamp, at_ms(1004));
  EXPECT_EQ(out.frames[2].stamp, at_ms(1004));
}

// Exactly one frame for every rate, two for every bias. Valid rates and those that the frame cannot
// carry are counted separately; an invalid rate does not count as out of range.
TEST_F(SenderTest, BooksCountWhatWentOut) {
  for (int i = 0; i < 7; ++i)
    rate(at_ms(i), rate_of(1.0));
  for (const double beyond : {420.0, -1e9, kNaN})
    rate(at_ms(10), rate_of(beyond));
  RateOutput invalid = rate_of(1e9);
  invalid.valid = false;
  rate(at_ms(11), invalid);
  bias(at_ms(12), {}, {});
  bias(at_ms(13), {}, {});
  EXPECT_EQ(status().rates_out, 11U);
  EXPECT_EQ(status().rates_out_valid, 7U);
  EXPECT_EQ(status().rates_out_of_range, 3U);
  EXPECT_EQ(status().biases_out, 2U);
  EXPECT_EQ(out.with_id(kRateId).size(), 11U);
  EXPECT_EQ(out.with_id(kBiasId).size(), 2U);
  EXPECT_EQ(out.with_id(kModelId).size(), 2U);
}

// The status holds the last rate as sent: none if it was not valid.
TEST_F(SenderTest, StatusTellsTheLastRateThatTheBusSaw) {
  EXPECT_TRUE(std::isnan(status().rate_dps));
  rate(at_ms(1), rate_of(1.5));
  EXPECT_EQ(status().rate_dps, 1.5);
  EXPECT_EQ(status().sigma_dps, 0.004);
  EXPECT_EQ(status().quality, Quality::kTwoGyros);
  rate(at_ms(2), rate_of(1e9));
  EXPECT_TRUE(std::isnan(status().rate_dps));
  EXPECT_TRUE(std::isnan(status().sigma_dps));
  EXPECT_EQ(status().quality, Quality::kUnusable);
  Fields fields = receiver.decode(out.frames.back().frame);
  EXPECT_EQ(fields["VG_Rate"].label, "invalid");
  EXPECT_EQ(fields["VG_Quality"].label, "unusable");
}

/// Like a bus that is down: accepts every `n`-th frame.
class Refusing final : public FrameSink {
 public:
  explicit Refusing(std::uint64_t n) : n_(n) {}
  void put(const can::Frame& frame, TimePoint) override {
    if (++offered_ % n_ == 0) taken.push_back(frame);
  }
  std::vector<can::Frame> taken;

 private:
  std::uint64_t n_;
  std::uint64_t offered_ = 0;
};

// A frame that the sink refuses is lost, not kept: the next one has its own time, and its counter
// shows the receiver how many are missing. The counts include every frame handed over.
TEST_F(SenderTest, FrameThatTheSinkRefusesLeavesAGapInTheCounter) {
  Refusing bus(4);
  for (std::int64_t i = 0; i < 40; ++i) {
    const Sender::Turn turn(sender, bus, at_ms(i));
    sender.send_rate(rate_of(static_cast<double>(i)));
  }
  ASSERT_EQ(bus.taken.size(), 10U);
  for (std::size_t k = 0; k < bus.taken.size(); ++k) {
    const std::size_t sent = 4 * k + 3;
    Fields fields = receiver.decode(bus.taken[k]);
    EXPECT_NEAR(fields["VG_Rate"].value, static_cast<double>(sent), 1e-9);
    EXPECT_EQ(fields["VG_Counter"].raw, static_cast<std::int64_t>(sent % 15)) << sent;
  }
  EXPECT_EQ(status().rates_out, 40U);
}

/// In the product, this would end the program.
class Broken final : public FrameSink {
 public:
  void put(const can::Frame&, TimePoint) override { throw std::bad_alloc(); }
};

// A sink that throws ends its turn: the next turn may use another sink.
TEST_F(SenderTest, SinkThatThrowsEndsItsTurn) {
  Broken broken;
  EXPECT_THROW(
      {
        const Sender::Turn turn(sender, broken, at_ms(1));
        sender.send_rate(rate_of(1.0));
      },
      std::bad_alloc);
  rate(at_ms(2), rate_of(2.0));
  ASSERT_EQ(out.frames.size(), 1U);
  EXPECT_EQ(out.frames[0].stamp, at_ms(2));
}

// --- foreign layouts -----------------------------------------------------------------------------

constexpr std::uint32_t kLayoutId = 0x123;

/// Rate: 16 bits from bit 0, 0.01 deg/s, 0x8000 is "not available"; a counter from bit 16 on, up to
/// 14.
OutputLayout layout_on(can::BusIndex bus) {
  const dbc::SignalCodec rate = rig::codec_of(rig::signal_of(0, 16, 0.01));
  const dbc::SignalCodec counter =
      rig::codec_of(rig::signal_of(16, 4, 1.0, 0.0, dbc::ValueType::kUnsigned));
  OutputLayout layout{.bus = bus,
                      .message = "FOREIGN",
                      .id = kLayoutId,
                      .rates = {{.rate = {.name = "Rate",
                                          .codec = rate,
                                          .minimum = -327.67,
                                          .maximum = 327.67,
                                          .none_raw = 0x8000,
                                          .beyond_raw = 0x8000,
                                          .has_code = true}}}};
  layout.e2e.counter = AliveCounter{"Counter", counter, 15};
  return layout;
}

/// Two buses: records what is sent on which.
class TwoBuses final : public FrameSink {
 public:
  void put(const can::Frame& frame, TimePoint) override { own.push_back(frame); }
  void put_on(can::BusIndex bus, const can::Frame& frame, TimePoint) override {
    other_bus = bus;
    other.push_back(frame);
  }
  std::vector<can::Frame> own;
  std::vector<can::Frame> other;
  can::BusIndex other_bus = 0;
};

// Layouts are sent beside VG_Rate, in the order of the configuration, each on its bus.
TEST_F(SenderTest, LayoutsGoOutWithTheRateOnTheirBus) {
  OutputPlan plan;
  plan.layouts = {layout_on(0), layout_on(2)};
  plan.layouts[0].id = 0x124;
  Sender both{plan};
  TwoBuses buses;
  {
    const Sender::Turn turn(both, buses, at_ms(1));
    both.send_rate(rate_of(-1.0));
    both.send_bias({}, {});
  }
  ASSERT_EQ(buses.own.size(), 4U);
  EXPECT_EQ(buses.own[0].id, kRateId);
  EXPECT_EQ(buses.own[1].id, 0x124U);
  ASSERT_EQ(buses.other.size(), 1U);
  EXPECT_EQ(buses.other_bus, 2);
  EXPECT_EQ(rig::signed_bits(buses.other[0], 0, 16), -100);
  EXPECT_EQ(buses.own[2].id, kBiasId);
}

// Layouts alone, without VG_ frames: a rate that only VG_Rate could not carry is valid, and
// spoken() counts it.
TEST_F(SenderTest, LayoutsMayGoOutAlone) {
  OutputPlan plan;
  plan.vgyro_frames = false;
  plan.layouts = {layout_on(0)};
  plan.layouts[0].rates[0].rate.scale = 10.0;
  Sender alone{plan};
  {
    const Sender::Turn turn(alone, out, at_ms(1));
    alone.send_rate(rate_of(500.0));
    alone.send_bias({}, {});
  }
  ASSERT_EQ(out.frames.size(), 1U);
  EXPECT_EQ(rig::signed_bits(out.frames[0].frame, 0, 16), 5000);
  EXPECT_EQ(alone.spoken(), 2U);
  Status told;
  alone.tell(told);
  EXPECT_EQ(told.rates_out_valid, 1U);
  EXPECT_EQ(told.biases_out, 0U);
  EXPECT_EQ(told.layouts_out[0], (LayoutCounts{.frames = 1, .valid = 1}));
}

// After a reload, the same frame keeps its counter and counts; a new one begins.
TEST_F(SenderTest, LayoutsGoOnWithAnotherPlan) {
  OutputPlan plan;
  plan.layouts = {layout_on(0)};
  Sender going{plan};
  const auto send = [&] {
    const Sender::Turn turn(going, out, at_ms(1));
    going.send_rate(rate_of(400.0));
  };
  for (int i = 0; i < 17; ++i)
    send();
  plan.layouts.insert(plan.layouts.begin(), layout_on(0));
  plan.layouts[0].id = 0x200;
  going.change_plan(plan);
  send();
  EXPECT_EQ(rig::bits(out.with_id(kLayoutId).back().frame, 16, 4), 17U % 15U);
  EXPECT_EQ(rig::bits(out.with_id(0x200).back().frame, 16, 4), 0U);
  Status told;
  going.tell(told);
  EXPECT_EQ(told.layouts_out[0], (LayoutCounts{.frames = 1, .out_of_range = 1}));
  EXPECT_EQ(told.layouts_out[1], (LayoutCounts{.frames = 18, .out_of_range = 18}));
  EXPECT_EQ(told.layouts_total().frames, 19U);
}

// One identifier on two buses means two frames, each with its own counter and counts.
TEST_F(SenderTest, OneIdentifierOnTwoBusesIsCountedApart) {
  OutputPlan plan;
  plan.layouts = {layout_on(0), layout_on(2)};
  plan.layouts[1].every = ms(100);
  Sender going{plan};
  TwoBuses buses;
  const auto send = [&](int at) {
    const Sender::Turn turn(going, buses, at_ms(at));
    going.send_rate(rate_of(1.0));
  };
  for (int i = 0; i < 7; ++i)
    send(1000 + i);
  going.change_plan(plan);
  send(1007);
  send(1200);
  EXPECT_EQ(rig::bits(buses.own.back(), 16, 4), 8U);
  EXPECT_EQ(rig::bits(buses.other.back(), 16, 4), 1U);
  Status told;
  going.tell(told);
  EXPECT_EQ(told.layouts_out[0], (LayoutCounts{.frames = 9, .valid = 9}));
  EXPECT_EQ(told.layouts_out[1], (LayoutCounts{.frames = 2, .valid = 2}));
}

// NaN is no valid rate, even without VG_Rate to check what it can carry.
TEST_F(SenderTest, NoNumberIsNoValidRateWithoutVgRate) {
  OutputPlan plan;
  plan.vgyro_frames = false;
  plan.layouts = {layout_on(0)};
  Sender alone{plan};
  const Sender::Turn turn(alone, out, at_ms(1));
  EXPECT_FALSE(alone.send_rate(rate_of(kNaN)));
  EXPECT_FALSE(alone.send_rate(rate_of(std::numeric_limits<double>::infinity())));
  EXPECT_TRUE(alone.send_rate(rate_of(1e6))) << "no VG_Rate that could not carry it";
  Status told;
  alone.tell(told);
  EXPECT_EQ(told.rates_out_valid, 1U);
  EXPECT_EQ(told.layouts_out[0], (LayoutCounts{.frames = 3, .out_of_range = 3}));
}

// --- another plan --------------------------------------------------------------------------------

// Counters continue under the same identifier, and begin anew under another; counts and grid
// continue.
TEST_F(SenderTest, AnotherPlanGoesOnWithWhatItShares) {
  ASSERT_TRUE(sender.reach_grid(at_ms(1000)));
  for (int i = 0; i < 5; ++i) {
    rate(at_ms(i), rate_of(1.0));
    bias(at_ms(i), {}, {});
  }
  OutputPlan changed;
  changed.bias_id = 0x711;
  sender.change_plan(changed);
  rate(at_ms(6), rate_of(1.0));
  bias(at_ms(7), {}, {});
  EXPECT_EQ(receiver.decode(out.with_id(kRateId).back().frame)["VG_Counter"].raw, 5);
  EXPECT_EQ(receiver.decode(out.with_id(kModelId).back().frame)["VM_Counter"].raw, 5);
  ASSERT_EQ(out.with_id(0x711).size(), 1U);
  EXPECT_EQ(rig::bits(out.with_id(0x711).front().frame, 8, 4), 0U);
  EXPECT_EQ(status().rates_out, 6U);
  EXPECT_FALSE(sender.reach_grid(at_ms(1099)));
}

// Another sender continues the counters of the frames, and nothing else.
TEST_F(SenderTest, CountsOnFromAnotherOne) {
  for (int i = 0; i < 9; ++i)
    rate(at_ms(i), rate_of(1.0));
  Sender next{OutputPlan{}};
  next.count_on_from(sender);
  const Sender::Turn turn(next, out, at_ms(20));
  next.send_rate(rate_of(1.0));
  EXPECT_EQ(receiver.decode(out.frames.back().frame)["VG_Counter"].raw, 9);
  Status told;
  next.tell(told);
  EXPECT_EQ(told.rates_out, 1U);
}

}  // namespace
}  // namespace vgyro::gateway

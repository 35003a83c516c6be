#include <memory>

#include <gtest/gtest.h>

#include "gateway/pipeline.h"
#include "tests/gateway/counting_new.h"
#include "tests/gateway/rig.h"

namespace vgyro::gateway {
namespace {

using rig::ms;

class Counter final : public FrameSink {
 public:
  void put(const can::Frame& /*frame*/, TimePoint /*stamp*/) override { ++frames; }
  std::size_t frames = 0;
};

std::size_t allocations_over(Pipeline& pipeline, const rig::Recording& recording, Counter& out) {
  const std::size_t before = allocations_so_far();
  double sum = 0.0;
  for (const rig::Event& event : recording) {
    rig::receive_with_timer(pipeline, event, out);
    pipeline.advance(event.stamp, out);
    sum += pipeline.status().calibrated_s;
  }
  const std::size_t after = allocations_so_far();
  EXPECT_GT(sum, 0.0);
  return after - before;
}

// The counter itself must work, or the tests below prove nothing.
TEST(PipelineAllocation, IsSeenByTheCounter) {
  const std::size_t before = allocations_so_far();
  auto pipeline = std::make_unique<Pipeline>(rig::two_gyros());
  EXPECT_GT(allocations_so_far(), before);
}

// After construction the frame path allocates nothing: through calibration, windows, a gyro that
// drops out and returns, a step of the clock, refused frames.
TEST(PipelineAllocation, NeverHappensOnTheFramePath) {
  rig::Recording recording =
      rig::merge({rig::stream_a(ms(0), ms(50'000), rig::constant(0.1)),
                  rig::stream_b(ms(0), ms(20'000), rig::constant(0.2)),
                  rig::stream_b(ms(22'000), ms(50'000), rig::constant(0.2))});
  for (std::size_t i = recording.size() / 2; i < recording.size(); ++i)
    recording[i].stamp -= std::chrono::seconds(5);
  for (std::size_t i = 0; i < recording.size(); i += 100)
    recording[i].frame.length = 1;
  ASSERT_GE(recording.size(), 9'500U);
  Pipeline pipeline(rig::two_gyros());
  Counter out;
  EXPECT_EQ(allocations_over(pipeline, recording, out), 0U);
  EXPECT_GT(out.frames, 4'000U);
  EXPECT_EQ(pipeline.status().clock_steps, 1U);
  EXPECT_GT(pipeline.status().windows, 10U);
}

// The same test with a reference and CAN FD output.
TEST(PipelineAllocation, NeverHappensWithAReferenceAndFd) {
  Plan plan = rig::with_reference();
  plan.output.fd = true;
  const rig::Recording recording = rig::merge(
      {rig::stream_a(ms(0), ms(35'000), rig::constant(0.1)),
       rig::stream_b(ms(0), ms(35'000), rig::constant(0.2)),
       rig::stream(0, rig::kIdReference, ms(0), ms(35'000), ms(10), rig::constant(0.0))});
  ASSERT_GE(recording.size(), 10'000U);
  Pipeline pipeline(plan);
  Counter out;
  EXPECT_EQ(allocations_over(pipeline, recording, out), 0U);
  EXPECT_GT(pipeline.status().rates_out_valid, 3'000U);
}

// The same test with the rate in a foreign layout, on a bus of its own.
TEST(PipelineAllocation, NeverHappensWithAForeignLayout) {
  Plan plan = rig::two_gyros();
  plan.output.vgyro_frames = false;
  OutputLayout layout{.bus = 1,
                      .message = "FOREIGN",
                      .id = 0x123,
                      .rates = {{.rate = {.name = "Rate",
                                          .codec = rig::codec_of(rig::signal_of(0, 16, 0.01)),
                                          .minimum = -327.0,
                                          .maximum = 327.0,
                                          .none_raw = 0x8000,
                                          .beyond_raw = 0x8000,
                                          .has_code = true}}}};
  plan.output.layouts = {layout};
  const rig::Recording recording =
      rig::merge({rig::stream_a(ms(0), ms(35'000), rig::constant(0.1)),
                  rig::stream_b(ms(0), ms(35'000), rig::constant(0.2))});
  Pipeline pipeline(plan);
  Counter out;
  EXPECT_EQ(allocations_over(pipeline, recording, out), 0U);
  EXPECT_GT(pipeline.status().layouts_out[0].valid, 3'000U);
  EXPECT_EQ(out.frames, pipeline.status().layouts_out[0].frames);
}

}  // namespace
}  // namespace vgyro::gateway

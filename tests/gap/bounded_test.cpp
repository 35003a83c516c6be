// A bounded run: what is certain when the time is over is the result, the rest is told as open.

#include <algorithm>

#include <gtest/gtest.h>

#include "gap/workflow.h"
#include "tests/gap/made_study.h"

namespace vgyro::gap {
namespace {

using model::Kind;

Making with_two_effects() {
  Making making;
  making.seconds = 100.0;
  making.rest_s = 30.0;
  making.seed = 77;
  making.error = [](std::size_t gyro, double t_s, double rate_dps) {
    return gyro == 0 ? 2e-3 * rate_dps : (t_s > 60.0 ? 0.05 : 0.0);
  };
  return making;
}

// Time that goes down by the same share at every look, so that the end is where it always is.
Result found_within(int looks) {
  const Making making = with_two_effects();
  const std::vector<Recording> recordings{make_recording(making)};
  Settings settings;
  int seen = 0;
  settings.time_left = [&] { return std::max(0.0, 1.0 - static_cast<double>(seen++) / looks); };
  model::Model model;
  model.effects = noise_effects(making);
  auto result = find_gap(recordings, model, settings);
  EXPECT_TRUE(result);
  return result.value_or(Result{});
}

void expect_only_certain(const Result& result) {
  for (const NamedEffect& one : result.effects) {
    if (one.checked) continue;
    EXPECT_FALSE(one.applied) << "what was not checked is not certain";
    EXPECT_FALSE(result.open.empty());
  }
}

TEST(Bounded, WithoutTimeIsScoredAndSaysThatAllIsOpen) {
  const Result result = found_within(1);
  EXPECT_TRUE(result.effects.empty());
  EXPECT_EQ(result.verdict, Verdict::kUnexplained);
  EXPECT_GT(result.gap.before, result.gap.band95[1]);
  ASSERT_EQ(result.open.size(), 2U);
  EXPECT_EQ(result.open[0], "whether there are further effects");
  EXPECT_EQ(result.open[1], "what noise the model lacks");
}

TEST(Bounded, WithTimeEnoughIsTheWholeResult) {
  const Result result = found_within(1'000'000);
  EXPECT_TRUE(result.open.empty());
  EXPECT_EQ(result.effects.size(), 2U);
  for (const NamedEffect& one : result.effects)
    EXPECT_TRUE(one.checked && one.applied);
}

TEST(Bounded, CutAnywhereAppliesNothingThatWasNotChecked) {
  bool some = false;
  for (const int looks : {20, 40, 60, 80, 120, 200}) {
    SCOPED_TRACE(looks);
    const Result result = found_within(looks);
    expect_only_certain(result);
    some = some || (!result.effects.empty() && !result.open.empty());
  }
  EXPECT_TRUE(some) << "one of these ends between finding and the end";
}

}  // namespace
}  // namespace vgyro::gap

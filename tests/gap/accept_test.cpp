// An ambiguous effect is told and not applied, unless the caller knows the right reading.

#include <gtest/gtest.h>

#include "gap/acceptance.h"
#include "gap/workflow.h"
#include "tests/gap/made_study.h"

namespace vgyro::gap {
namespace {

using model::Kind;

constexpr double kError = 4e-4;
constexpr std::uint64_t kSeed = 45;
constexpr double kSigmas = 4.0;

Found name_of(Kind kind, std::size_t gyro, double value) {
  Found found;
  found.effect = {.gyro = gyro, .kind = kind, .parameters = {value}};
  found.sigma = {1e-5};
  return found;
}

std::vector<Found> scale_or_scale() {
  Found found = name_of(Kind::kScaleFactor, 1, -1e-3);
  found.ambiguous_with = {{Kind::kScaleFactorTemperature, 1, {}}, {Kind::kScaleFactor, 0, {1e-3}}};
  return {found, name_of(Kind::kBias, 0, 0.1)};
}

TEST(Acceptance, OfNothingLeavesEveryAmbiguousNameAsItIs) {
  std::vector<Found> found = scale_or_scale();
  EXPECT_FALSE(accept_readings({}, found));
  EXPECT_FALSE(found[0].accepted);
  EXPECT_EQ(found[0].effect.gyro, 1U);
}

TEST(Acceptance, OfTheLikeliestChangesNoName) {
  std::vector<Found> found = scale_or_scale();
  EXPECT_FALSE(accept_readings({{}}, found));
  EXPECT_TRUE(found[0].accepted);
  EXPECT_FALSE(found[1].accepted) << "it was certain";
}

TEST(Acceptance, OfTheOtherGyroExchangesNameAndReading) {
  std::vector<Found> found = scale_or_scale();
  EXPECT_TRUE(accept_readings({{.gyro = 0, .kind = {}}}, found));
  EXPECT_TRUE(found[0].accepted);
  EXPECT_EQ(found[0].effect.gyro, 0U);
  EXPECT_EQ(found[0].effect.parameters[0], 1e-3);
  EXPECT_EQ(found[0].ambiguous_with[1].gyro, 1U);
  EXPECT_EQ(found[0].ambiguous_with[1].parameters[0], -1e-3);
}

TEST(Acceptance, TakesNoReadingThatNobodyFitted) {
  std::vector<Found> found = scale_or_scale();
  EXPECT_FALSE(accept_readings({{.gyro = {}, .kind = Kind::kScaleFactorTemperature}}, found));
  EXPECT_FALSE(found[0].accepted);
}

TEST(Acceptance, AsksForAllThatIsSaid) {
  std::vector<Found> found = scale_or_scale();
  EXPECT_FALSE(accept_readings({{.gyro = 0, .kind = Kind::kDelay}}, found));
  EXPECT_FALSE(found[0].accepted);
}

// A scale factor of gyro 0 without a reference: of which gyro it is, nothing can show.
class AmbiguousScale : public testing::Test {
 protected:
  AmbiguousScale() {
    Making making;
    making.seconds = 100.0;
    making.rest_s = 30.0;
    making.seed = kSeed;
    making.error = [](std::size_t gyro, double, double rate_dps) {
      return gyro == 0 ? kError * rate_dps : 0.0;
    };
    recordings_ = {without_reference(make_recording(making))};
    model_.effects = noise_effects(making);
  }
  Result found_with(std::vector<Acceptance> accept) {
    Settings settings;
    settings.accept = std::move(accept);
    auto result = find_gap(recordings_, model_, settings);
    EXPECT_TRUE(result);
    return result.value_or(Result{});
  }
  std::vector<Recording> recordings_;
  model::Model model_;
};

TEST_F(AmbiguousScale, IsInTheAccountAndNotInTheModel) {
  const Result result = found_with({});
  ASSERT_EQ(result.effects.size(), 1U);
  const NamedEffect& scale = result.effects.front();
  EXPECT_FALSE(scale.applied);
  ASSERT_EQ(scale.ambiguous_with.size(), 1U);
  EXPECT_TRUE(scale.ambiguous_with.front().is_fitted());
  EXPECT_EQ(result.model.effects, model_.effects);
  EXPECT_EQ(result.verdict, Verdict::kExplained) << "the gap counts what was found";
  EXPECT_LE(result.gap.after, result.gap.band95[1]);
  EXPECT_DOUBLE_EQ(result.gap.of_model, result.gap.before) << "and the model leaves it all";
}

TEST_F(AmbiguousScale, OfEitherGyroIsAppliedWhereTheCallerKnows) {
  for (const std::size_t gyro : {0U, 1U}) {
    SCOPED_TRACE(gyro);
    const Result result = found_with({{.gyro = gyro, .kind = {}}});
    ASSERT_EQ(result.effects.size(), 1U);
    const NamedEffect& scale = result.effects.front();
    EXPECT_TRUE(scale.applied);
    EXPECT_EQ(scale.effect.gyro, gyro);
    EXPECT_GT(scale.sigma[0], 0.0);
    const double truth = gyro == 0 ? kError : -kError;
    EXPECT_NEAR(scale.effect.parameters[0], truth, kSigmas * scale.sigma[0]);
    ASSERT_EQ(scale.ambiguous_with.size(), 1U) << "it stays ambiguous";
    EXPECT_EQ(scale.ambiguous_with.front().gyro, 1 - gyro);
    ASSERT_EQ(result.model.effects.size(), model_.effects.size() + 1);
    EXPECT_EQ(result.model.effects.back().gyro, gyro);
    EXPECT_DOUBLE_EQ(result.gap.of_model, result.gap.after);
    EXPECT_LE(result.gap.after, result.gap.band95[1]);
  }
}

}  // namespace
}  // namespace vgyro::gap

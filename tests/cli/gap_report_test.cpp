#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include "cli/gap/report.h"
#include "made_up_result.h"
#include "model/catalogue.h"

namespace vgyro::cli {
namespace {

using Json = nlohmann::ordered_json;

GapSubject plain_subject() {
  return {"vgyro.toml", "model.toml", "drive.log", {"left", "right"}};
}

TEST(GapReportTest, HoldsTheFieldsOfTheInterface) {
  // Programs rely on these names, in which gyros count from 1.
  const Json json = gap_json(plain_subject(), made_up_result());
  EXPECT_EQ(json["format"], 1);
  EXPECT_EQ(json["verdict"], "partly_explained");
  EXPECT_EQ(json["gap"], Json::parse(R"({"unit": "nats_per_sample", "before": 0.81, "after": 0.014,
                                         "floor": 0.0, "band95": [-0.006, 0.007], "of_model": 0.7})"));
  const Json& scale = json["effects"][0];
  EXPECT_EQ(scale["kind"], "scale_factor");
  EXPECT_EQ(scale["gyro"], 2);
  EXPECT_EQ(scale["where"],
            Json::parse(R"({"from_s": 60.0, "to_s": 340.0, "band_hz": [0.0, 8.0]})"));
  EXPECT_EQ(scale["ambiguous_with"], Json::parse(R"([{"kind": "scale_factor", "gyro": 1,
                                                      "parameters": {"error": 4.2e-4}}])"));
  EXPECT_EQ(scale["applied"], false);
  EXPECT_EQ(json["effects"][1]["applied"], true);
  EXPECT_EQ(json["complete"], true);
  EXPECT_EQ(json["open"], Json::array());
  EXPECT_EQ(json["model"], "model.toml");
  EXPECT_EQ(json["report"], "report.html");
}

TEST(GapReportTest, NamesAnAxisByItsLetterAndGivesSigmaOfEstimatesAlone) {
  // An axis is chosen, not measured: it has no error bar.
  const Json tilt = gap_json(plain_subject(), made_up_result())["effects"][1];
  EXPECT_EQ(tilt["parameters"], Json::parse(R"({"axis": "z", "coefficient_dps_g": 0.00123})"));
  EXPECT_EQ(tilt["sigma"], Json::parse(R"({"coefficient_dps_g": 2e-5})"));
}

TEST(GapReportTest, LeavesOutWhatAnUnexplainedRestDoesNotHave) {
  // A slow remainder has no frequency; null would mean a lost number.
  const Json rest = gap_json(plain_subject(), made_up_result())["unexplained"];
  EXPECT_EQ(rest[0]["frequency_hz"], 37.02);
  EXPECT_EQ(rest[0]["amplitude_dps"], 0.001);
  EXPECT_FALSE(rest[1].contains("frequency_hz"));
  EXPECT_FALSE(rest[1].contains("amplitude_dps"));
}

TEST(GapReportTest, ComparisonHoldsTheFieldsOfTheInterface) {
  gap::Comparison comparison;
  comparison.gap = {.before = 0.81, .after = 0.81, .band95 = {-0.006, 0.007}};
  comparison.differences = {{1, {60.0, 410.0, 0.0, 8.0}, "rate", 900.0, "too little"}};
  const Json json = comparison_json(plain_subject(), comparison);
  EXPECT_EQ(json["format"], 1);
  EXPECT_EQ(json["gap"], Json::parse(R"({"unit": "nats_per_sample", "value": 0.81, "floor": 0.0,
                                         "band95": [-0.006, 0.007]})"));
  EXPECT_EQ(json["where"][0], Json::parse(R"({"gyro": 2, "from_s": 60.0, "to_s": 410.0,
    "band_hz": [0.0, 8.0], "against": "rate", "nats": 900.0, "text": "too little"})"));
}

TEST(GapReportTest, RoundsAParameterByLessThanAHundredthOfItsSigma) {
  // Table, gap.json and model.toml have the same number, which is as good as the exact one.
  for (const double sigma : {1e-9, 9.99e-7, 1.01e-5, 3e-3}) {
    gap::Result result = made_up_result();
    result.effects[0].sigma = {sigma};
    const double exact = result.effects[0].effect.parameters[0];
    round_to_sigma(result);
    const double rounded = result.effects[0].effect.parameters[0];
    EXPECT_NEAR(rounded, exact, 0.01 * sigma);
    EXPECT_EQ(result.model.effects[0].parameters[0], rounded);
  }
}

TEST(GapReportTest, RoundingStaysInsideTheLimitsOfTheKind) {
  // A time constant of 0.4 ± 300 s would be rounded to 0, which no model file may hold.
  gap::Result result = made_up_result();
  result.effects[0].effect = {0, model::Kind::kWarmUp, {0.01, 0.4}};
  result.effects[0].sigma = {1e-3, 3000.0};
  round_to_sigma(result);
  const auto parameters = model::info(model::Kind::kWarmUp).parameters;
  EXPECT_TRUE(parameters[1].allows(result.effects[0].effect.parameters[1]));
}

TEST(GapReportTest, TellsPeopleTheStoryInSomeTwentyLines) {
  const std::string text = gap_text(plain_subject(), made_up_result());
  for (const char* part :
       {"drive.log: 400.0 s, 40000 samples of left", "2 effects named; something remains",
        "0.81 -> 0.014", "-0.006 to 0.007", "error -0.0004212 ± 3.1e-06",
        "axis z, coefficient_dps_g 0.00123 ± 2e-05", "left scale_factor",
        "to tell what round 1 is: record a rate table",
        "unexplained: left: line at 37.02 ± 0.01 Hz",
        "left, right: temperature_bias, scale_factor_temperature: temperature is constant; let it",
        "right: saturation: the rate stays low\n", "note: 3 samples",
        "effects that are not applied: 1 ambiguous; the gap after counts them, model.toml holds "
        "them as comments only and leaves a gap of 0.7; --accept gyro=1 or gyro=2"}) {
    EXPECT_NE(text.find(part), std::string::npos) << part << "\nis not in\n" << text;
  }
  EXPECT_LE(std::count(text.begin(), text.end(), '\n'), 20);
}

TEST(GapReportTest, SaysWhatTheTimeWasTooShortFor) {
  gap::Result result = made_up_result();
  result.open = {"whether there are further effects", "what noise the model lacks"};
  result.effects[1].checked = result.effects[1].applied = false;
  const Json json = gap_json(plain_subject(), result);
  EXPECT_EQ(json["complete"], false);
  EXPECT_EQ(json["open"].size(), 2U);
  EXPECT_EQ(json["effects"][1]["checked"], false);
  const std::string text = gap_text(plain_subject(), result);
  EXPECT_NE(text.find("the time limit was reached; open is whether there are further effects, and "
                      "what noise the model lacks"),
            std::string::npos)
      << text;
  EXPECT_NE(text.find("1 ambiguous, 1 not checked for lack of time"), std::string::npos) << text;
}

TEST(GapReportTest, TellsWhenEachOfSeveralRecordingsWas) {
  gap::Result result = made_up_result();
  result.drives = {{0.0, 190.5}, {210.0, 400.0}};
  EXPECT_EQ(gap_json(plain_subject(), result)["recording"]["parts"],
            Json::parse(R"([{"from_s": 0.0, "to_s": 190.5}, {"from_s": 210.0, "to_s": 400.0}])"));
  EXPECT_NE(gap_text(plain_subject(), result).find("recording 2 from 210 to 400 s"),
            std::string::npos);
  EXPECT_FALSE(gap_json(plain_subject(), made_up_result())["recording"].contains("parts"));
}

TEST(GapReportTest, SaysThatAComparisonFoundNothing) {
  gap::Comparison comparison;
  comparison.gap = {.before = 0.004, .after = 0.004, .band95 = {-0.006, 0.007}};
  const std::string text = comparison_text(plain_subject(), comparison);
  EXPECT_NE(text.find("within"), std::string::npos) << text;
  EXPECT_NE(text.find("nowhere"), std::string::npos) << text;
}

}  // namespace
}  // namespace vgyro::cli

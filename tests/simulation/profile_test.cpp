#include "simulation/profile.h"

#include <gtest/gtest.h>

namespace vgyro::simulation {
namespace {

std::string complaint(const std::string& text) {
  const auto profile = parse_profile(text, "p.csv");
  return profile ? "none" : profile.error().message();
}

TEST(Profile, ReadsColumnsByNameAndCountsTimeFromTheFirstRow) {
  const auto profile = parse_profile(
      "\xEF\xBB\xBF# a comment\r\n rate_dps , t_s, acc_z_g ,temperature_c\r\n\r\n"
      "1.5,100, 1 ,20\r\n+2.5,101,0.5,21\r\n# more\r\n-3e0,102.5,1,22",
      "p.csv");
  ASSERT_TRUE(profile) << profile.error().message();
  EXPECT_DOUBLE_EQ(profile->length_s, 2.5);
  EXPECT_NEAR(profile->rate_dps.value(0.0), 1.5, 1e-14);
  EXPECT_NEAR(profile->rate_dps.value(1.0), 2.5, 1e-14);
  EXPECT_NEAR(profile->rate_dps.value(2.5), -3.0, 1e-14);
  ASSERT_TRUE(profile->temperature_c);
  EXPECT_NEAR(profile->temperature_c->value(1.0), 21.0, 1e-12);
  EXPECT_TRUE(profile->has_acceleration());
  EXPECT_FALSE(profile->acceleration_g[0]);
  EXPECT_NEAR(profile->acceleration_g[2]->value(1.0), 0.5, 1e-14);
}

TEST(Profile, ToleratesThatAColumnIsNotThere) {
  const auto profile = parse_profile("t_s,rate_dps\n0,1\n1,1\n", "p.csv");
  ASSERT_TRUE(profile);
  EXPECT_FALSE(profile->temperature_c);
  EXPECT_FALSE(profile->has_acceleration());
  EXPECT_FALSE(profile->supply_v);
}

TEST(Profile, ReadsTheSupplyVoltage) {
  const auto profile = parse_profile("t_s,supply_v,rate_dps\n0,5,1\n1,4.5,1\n", "p.csv");
  ASSERT_TRUE(profile) << profile.error().message();
  ASSERT_TRUE(profile->supply_v);
  EXPECT_NEAR(profile->supply_v->value(1.0), 4.5, 1e-12);
  EXPECT_NEAR(profile->rate_dps.value(1.0), 1.0, 1e-12);
}

TEST(Profile, NamesLineCauseAndRemedyOfAMistake) {
  struct Bad {
    const char* text;
    const char* begins;
    const char* holds;
  };
  const Bad cases[] = {
      {"", "p.csv: ", "is empty"},
      {"t_s,rate_dps\n", "p.csv: ", "has 0 rows"},
      {"t_s,rate_dps\n0,1\n", "p.csv: ", "at least two"},
      {"0,1\n1,1\n", "p.csv:1: ", "header line is missing"},
      {"t_s;rate_dps\n0;1\n", "p.csv:1: ", "commas"},
      {"t_s,rate_dsp\n0,1\n", "p.csv:1: ", "did you mean \"rate_dps\"?"},
      {"t_ms,rate_dps\n0,1\n", "p.csv:1: ", "did you mean \"t_s\"?"},
      {"t_s,rate_dps,acc_y\n0,1,1\n", "p.csv:1: ", "\"acc_y"},
      {"t_s,temperature_c\n0,1\n", "p.csv:1: ", "column rate_dps is missing"},
      {"t_s,rate_dps,t_s\n0,1,2\n", "p.csv:1: ", "t_s is there twice"},
      {"t_s,rate_dps\n0,1\n\n# two\n1\n", "p.csv:5: ", "has 1 values"},
      {"t_s,rate_dps\n0,1\n1,nan\n", "p.csv:3: ", "rate_dps is nan"},
      {"t_s,rate_dps\n0,1\n1,inf\n", "p.csv:3: ", "rate_dps is inf"},
      {"t_s,rate_dps\n0,1\n1,\n", "p.csv:3: ", "rate_dps is \"\""},
      {"t_s,rate_dps\n0,1\n1,2x\n", "p.csv:3: ", "\"2x\""},
      {"t_s,rate_dps\n0,1\n1,1e9\n", "p.csv:3: ", "-100000 to 100000"},
      {"t_s,rate_dps,temperature_c\n0,1,25\n1,1,-300\n", "p.csv:3: ", "temperature_c is -300"},
      {"t_s,rate_dps,supply_v\n0,1,5\n1,1,-5\n", "p.csv:3: ", "supply_v is -5"},
      {"t_s,rate_dps\n0,1\n1,1\n1,1\n", "p.csv:4: ", "not after 1"},
      {"t_s,rate_dps\n0,1\n1,1\n0.5,1\n", "p.csv:4: ", "times must grow"},
  };
  for (const Bad& bad : cases) {
    const std::string message = complaint(bad.text);
    EXPECT_TRUE(message.starts_with(bad.begins)) << message << "\nof\n" << bad.text;
    EXPECT_NE(message.find(bad.holds), std::string::npos) << message << "\nof\n" << bad.text;
  }
}

}  // namespace
}  // namespace vgyro::simulation

#include "model/file.h"

#include <gtest/gtest.h>

#include "model/catalogue.h"
#include "model/edit.h"

namespace vgyro::model {
namespace {

std::vector<std::string> complaints_of(const std::string& text) {
  const ModelResult result = parse_model(text, "m.toml");
  std::vector<std::string> messages;
  if (result) return messages;
  for (const Error& error : result.error())
    messages.push_back(error.message());
  return messages;
}

std::string effect(const std::string& lines) {
  return "format = 1\n\n[[effect]]\n" + lines;
}

// The first effect is on line 3, its keys from line 4 on.
struct Bad {
  std::string text;
  std::string begins;
  std::string holds;
};

TEST(ModelFile, GivesEffectsInTheOrderOfTheFile) {
  const ModelResult result = parse_model(R"(format = 1
[[effect]]
gyro = 1
kind = "bias"
value_dps = 0.0331
[[effect]]
gyro = 2
kind = "g_sensitivity"
axis = "z"
coefficient_dps_g = -2e-3
[[effect]]
gyro = 1
kind = "temperature_bias"
coefficient_dps_k = 1
)",
                                         "m.toml");
  ASSERT_TRUE(result);
  ASSERT_EQ(result->effects.size(), 3U);
  EXPECT_EQ(result->file, "m.toml");
  const Effect& bias = result->effects[0];
  EXPECT_EQ(bias.kind, Kind::kBias);
  EXPECT_EQ(bias.gyro, 0U);
  EXPECT_EQ(bias.line, 2U);
  EXPECT_DOUBLE_EQ(bias.parameters[0], 0.0331);
  const Effect& g = result->effects[1];
  EXPECT_EQ(g.kind, Kind::kGSensitivity);
  EXPECT_EQ(g.gyro, 1U);
  EXPECT_DOUBLE_EQ(g.parameters[0], 2.0);
  EXPECT_DOUBLE_EQ(g.parameters[1], -2e-3);
  const Effect& temperature = result->effects[2];
  EXPECT_DOUBLE_EQ(temperature.parameters[0], 1.0) << "a whole number is a number";
  EXPECT_DOUBLE_EQ(temperature.parameters[1], 25.0) << "reference_c is 25 unless it is given";
}

// For whole units: `axis` is the unit's; the axis of g_sensitivity's input is then called `from`.
TEST(ModelFile, SaysOfWhichAxisOfAUnitAnEffectIs) {
  const std::string text = R"(format = 1

[[effect]]
gyro = 1
kind = "bias"
axis = "y"
value_dps = 0.5

[[effect]]
gyro = 2
kind = "g_sensitivity"
axis = "x"
from = "z"
coefficient_dps_g = 0.25

[[effect]]
gyro = 2
kind = "cross_axis"
axis = "z"
from = "x"
coefficient = 0.125

[[effect]]
gyro = 1
kind = "g_sensitivity"
axis = "z"
coefficient_dps_g = 0.5
)";
  const ModelResult result = parse_model(text, "m.toml");
  ASSERT_TRUE(result) << result.error().front().message();
  ASSERT_EQ(result->effects.size(), 4U);
  EXPECT_EQ(result->effects[0].of_axis, 1U);
  EXPECT_EQ(result->effects[1].of_axis, 0U);
  EXPECT_EQ(result->effects[1].parameters[0], 2.0);
  EXPECT_EQ(result->effects[2].of_axis, 2U);
  EXPECT_EQ(result->effects[2].parameters[0], 0.0);
  EXPECT_EQ(result->effects[3].of_axis, std::nullopt) << "the acceleration's, as it always was";
  EXPECT_EQ(result->effects[3].parameters[0], 2.0);
  EXPECT_EQ(to_toml(*result).substr(to_toml(*result).find('\n')), text.substr(text.find('\n')));
}

TEST(ModelFile, CountsDriftsOfEachAxis) {
  std::string text = "format = 1\n";
  for (const char* axis : {"x", "x", "x", "y", "y", "y"})
    text += std::string("[[effect]]\ngyro = 1\nkind = \"gauss_markov\"\naxis = \"") + axis +
            "\"\nsigma_dps = 0.1\ntau_s = 100\n";
  EXPECT_TRUE(parse_model(text, "m.toml"));
  text += "[[effect]]\ngyro = 1\nkind = \"gauss_markov\"\nsigma_dps = 0.1\ntau_s = 100\n";
  EXPECT_EQ(complaints_of(text).size(), 1U);
}

std::vector<std::string> complaints_of_names(const std::string& text, const GyroNames& names) {
  const ModelResult result = parse_model(text, "m.toml", names);
  std::vector<std::string> messages;
  if (result) return messages;
  for (const Error& error : result.error())
    messages.push_back(error.message());
  return messages;
}

TEST(ModelFile, CallsAGyroByItsName) {
  const GyroNames names{.names = {"fog", "mems"}};
  const std::string text =
      "format = 1\n[[effect]]\ngyro = \"mems\"\nkind = \"bias\"\nvalue_dps = 1\n"
      "[[effect]]\ngyro = \"fog\"\nkind = \"bias\"\nvalue_dps = 2\n"
      "[[effect]]\ngyro = 2\nkind = \"bias\"\nvalue_dps = 3\n";
  const ModelResult result = parse_model(text, "m.toml", names);
  ASSERT_TRUE(result) << result.error().front().message();
  ASSERT_EQ(result->effects.size(), 3U);
  EXPECT_EQ(result->effects[0].gyro, 1U);
  EXPECT_EQ(result->effects[1].gyro, 0U);
  EXPECT_EQ(result->effects[2].gyro, 1U);
}

TEST(ModelFile, RefusesANameThatIsNoGyros) {
  const std::string text = effect("gyro = \"mesm\"\nkind = \"bias\"\nvalue_dps = 1\n");
  EXPECT_EQ(
      complaints_of_names(text, {.names = {"fog", "mems"}}),
      std::vector<std::string>{"m.toml:4: there is no gyro \"mesm\"; did you mean \"mems\"?"});
  EXPECT_EQ(complaints_of_names(text, {}),
            std::vector<std::string>{"m.toml:4: there is no gyro \"mesm\"; gyro = 1 or 2"});
  EXPECT_EQ(complaints_of_names(effect("gyro = \"a\"\nkind = \"bias\"\nvalue_dps = 1\n"),
                                {.names = {"a", "a"}}),
            std::vector<std::string>{"m.toml:4: both gyros have the name \"a\"; gyro = 1 or 2"});
  EXPECT_EQ(complaints_of_names(effect("gyro = \"\"\nkind = \"bias\"\nvalue_dps = 1\n"), {}).size(),
            1U);
}

TEST(ModelFile, CountsTheEffectsOfANamedGyro) {
  std::string text = "format = 1\n";
  for (const char* gyro : {"1", "1", "\"fog\"", "\"fog\""})
    text += std::string("[[effect]]\ngyro = ") + gyro +
            "\nkind = \"gauss_markov\"\nsigma_dps = 0.1\ntau_s = 100\n";
  EXPECT_EQ(complaints_of_names(text, {.names = {"fog", "mems"}}).size(), 1U);
}

TEST(ModelFile, MayHoldNoEffect) {
  const ModelResult result = parse_model("format = 1\n", "m.toml");
  ASSERT_TRUE(result);
  EXPECT_TRUE(result->effects.empty());
}

TEST(ModelFile, NamesLineCauseAndRemedyOfEveryMistake) {
  const Bad cases[] = {
      {effect("gyro = 1\nkind = \"scale_facter\"\nerror = 1e-4\n"),
       "m.toml:5: ", "did you mean \"scale_factor\"?"},
      {effect("gyro = 1\nkind = \"hum\"\n"), "m.toml:5: ", "vgyro model list"},
      {effect("gyro = 1\nkind = \"delay\"\nseconds = 0.1\naxis = \"x\"\n"),
       "m.toml:7: ", "leave `axis` out"},
      {effect("gyro = 1\nkind = \"bias\"\nvalue_dsp = 1e-4\n"),
       "m.toml:3: ", "bias needs value_dps"},
      {effect("gyro = 1\nkind = \"warm_up\"\namplitude_dps = 1\ntau_s = 0\n"),
       "m.toml:7: ", "0.001 to 1e+09 s"},
      {effect("gyro = 1\nkind = \"warm_up\"\namplitude_dps = 1\ntau_s = -5\n"),
       "m.toml:7: ", "0.001 to 1e+09 s"},
      {effect("gyro = 1\nkind = \"white_noise\"\ndensity_dps_rthz = -1e-4\n"),
       "m.toml:6: ", "to 100"},
      {effect("gyro = 1\nkind = \"gauss_markov\"\nsigma_dps = 1000\ntau_s = 5e-324\n"),
       "m.toml:6: ", "sigma_dps is 1000; 0, or 1e-12 to 100 deg/s"},
      {effect("gyro = 1\nkind = \"gauss_markov\"\nsigma_dps = 1\ntau_s = 5e-324\n"),
       "m.toml:7: ", "tau_s is 4.94066e-324; 0.001 to 1e+09 s"},
      {effect("gyro = 1\nkind = \"white_noise\"\ndensity_dps_rthz = 1e-170\n"),
       "m.toml:6: ", "0, or 1e-12 to 100 deg/s/sqrt(Hz)"},
      {effect("gyro = 1\nkind = \"quantization\"\nstep_dps = 5e-324\n"), "m.toml:6: ", "1e-09 to"},
      {effect("gyro = 1\nkind = \"bandwidth\"\ncutoff_hz = 1e-300\n"),
       "m.toml:6: ", "0.01 to 100000 Hz"},
      {effect("gyro = 1\nkind = \"bias\"\nvalue_dps = nan\n"), "m.toml:6: ", "value_dps is nan"},
      {effect("gyro = 1\nkind = \"bias\"\nvalue_dps = inf\n"), "m.toml:6: ", "value_dps is inf"},
      {effect("gyro = 1\nkind = \"bias\"\nvalue_dps = \"0.1\"\n"),
       "m.toml:6: ", "must be a number"},
      {effect("gyro = 3\nkind = \"bias\"\nvalue_dps = 0.1\n"), "m.toml:4: ", "there is no gyro 3"},
      {effect("gyro = \"a\"\nkind = \"bias\"\nvalue_dps = 0.1\n"),
       "m.toml:4: ", "there is no gyro \"a\""},
      {effect("kind = \"bias\"\nvalue_dps = 0.1\n"), "m.toml:3: ", "needs gyro"},
      {effect("gyro = 1\nvalue_dps = 0.1\n"), "m.toml:3: ", "needs kind"},
      {effect("gyro = 1\nkind = \"g_sensitivity\"\naxis = \"w\"\ncoefficient_dps_g = 1\n"),
       "m.toml:6: ", "\"x\", \"y\" or \"z\""},
      {effect("gyro = 1\nkind = \"g_sensitivity\"\naxis = 2\ncoefficient_dps_g = 1\n"),
       "m.toml:6: ", "string"},
      {effect("gyro = 1\nkind = \"angle_harmonic\"\nharmonic = 1.5\namplitude_dps = 1\n"
              "phase_rad = 0\n"),
       "m.toml:6: ", "whole number"},
      {effect("gyro = 1\nkind = \"scale_factor\"\nerror = -1\n"), "m.toml:6: ", "-0.9 to 9"},
      {effect("gyro = 1\nkind = \"stuck\"\nfrom_s = 5\nto_s = 5\n"), "m.toml:7: ", "not after"},
      {effect("gyro = 1\nkind = \"bias\"\nvalue_dps = 1\nvalue_dps = 2\n"), "m.toml:7: ", ""},
      {effect("gyro = 1\nkind = \"bias\"\nvalue_dps = 1\nvalve = 2\n"),
       "m.toml:7: ", "unknown key \"valve\""},
      {"[[effect]]\ngyro = 1\nkind = \"bias\"\nvalue_dps = 1\n", "m.toml: ", "format is missing"},
      {"format = 2\n", "m.toml:1: ", "format = 1"},
      {"format = 1\n[[efect]]\n", "m.toml:2: ", "did you mean \"effect\"?"},
      {"format = 1\n[effect]\n", "m.toml:2: ", "[[effect]]"},
      {"format = 1\neffect = [1]\n", "m.toml:2: ", "[[effect]]"},
      {"format = \n", "m.toml:1: ", ""},
  };
  for (const Bad& bad : cases) {
    SCOPED_TRACE(bad.text);
    const std::vector<std::string> messages = complaints_of(bad.text);
    ASSERT_FALSE(messages.empty());
    bool found = false;
    for (const std::string& message : messages)
      found = found || (message.starts_with(bad.begins) && message.find(bad.holds) != message.npos);
    EXPECT_TRUE(found) << messages.front();
  }
}

TEST(ModelFile, ReadsHowFarAnEffectMayBeWrong) {
  const ModelResult result = parse_model(R"(format = 1
[[effect]]
gyro = 1
kind = "scale_factor"
error = 4e-4
sigma = 3e-5
ambiguous = true
[[effect]]
gyro = 2
kind = "g_sensitivity"
axis = "z"
coefficient_dps_g = -2e-3
sigma = 1e-4
[[effect]]
gyro = 1
kind = "line"
frequency_hz = 37
amplitude_dps = 0.01
phase_rad = 0
sigma = 1e-3
[[effect]]
gyro = 1
kind = "warm_up"
amplitude_dps = 0.1
tau_s = 300
sigma = { amplitude_dps = 0.01, tau_s = 20 }
[[effect]]
gyro = 1
kind = "bias"
value_dps = 1
)",
                                         "m.toml");
  ASSERT_TRUE(result) << result.error().front().message();
  const auto& effects = result->effects;
  EXPECT_EQ(effects[0].sigma, (Parameters{3e-5}));
  EXPECT_TRUE(effects[0].ambiguous);
  EXPECT_EQ(effects[1].sigma, (Parameters{0.0, 1e-4})) << "one number is of the effect's size";
  EXPECT_EQ(effects[2].sigma, (Parameters{0.0, 1e-3})) << "of the amplitude, not of the frequency";
  EXPECT_EQ(effects[3].sigma, (Parameters{0.01, 20.0}));
  EXPECT_FALSE(is_doubted(effects[4]));
  EXPECT_TRUE(is_doubted(effects[0]));
}

TEST(ModelFile, NamesLineCauseAndRemedyOfAWrongSigma) {
  const std::string scale = "gyro = 1\nkind = \"scale_factor\"\nerror = 1e-4\n";
  const std::string tilt =
      "gyro = 1\nkind = \"g_sensitivity\"\naxis = \"x\"\ncoefficient_dps_g = 1\n";
  const Bad cases[] = {
      {effect(scale + "sigma = -1\n"), "m.toml:7: ", "sigma is -1; 0 to 9.9"},
      {effect(scale + "sigma = nan\n"), "m.toml:7: ", "sigma is nan"},
      {effect(scale + "sigma = \"1\"\n"),
       "m.toml:7: ", "sigma = 1e-3, or sigma = { error = 1e-3 }"},
      {effect(scale + "sigma = { eror = 1e-3 }\n"), "m.toml:7: ", "did you mean \"error\"?"},
      {effect(scale + "sigma = { error = 1e6 }\n"), "m.toml:7: ", "0 to 9.9"},
      {effect(tilt + "sigma = { axis = 1 }\n"), "m.toml:8: ", "axis is chosen, and has no sigma"},
      {effect(scale + "ambiguous = 1\n"), "m.toml:7: ", "true or false"},
      {effect(scale + "sgima = 1\n"), "m.toml:7: ", "did you mean \"sigma\"?"},
  };
  for (const Bad& bad : cases) {
    SCOPED_TRACE(bad.text);
    const std::vector<std::string> messages = complaints_of(bad.text);
    ASSERT_FALSE(messages.empty());
    EXPECT_TRUE(messages.front().starts_with(bad.begins)) << messages.front();
    EXPECT_NE(messages.front().find(bad.holds), std::string::npos) << messages.front();
  }
}

TEST(ModelFile, SuggestsTheParameterThatWasMeant) {
  const auto messages = complaints_of(effect("gyro = 1\nkind = \"bias\"\nvalue_dsp = 1\n"));
  ASSERT_EQ(messages.size(), 2U);
  EXPECT_EQ(messages[1],
            "m.toml:6: unknown key \"value_dsp\" in [[effect]]; did you mean \"value_dps\"?");
}

TEST(ModelFile, ReportsAllMistakesAtOnce) {
  EXPECT_EQ(complaints_of(
                "format = 3\n" +
                effect("gyro = 0\nkind = \"bias\"\nvalue_dps = nan\n").substr(sizeof "format = 1"))
                .size(),
            3U);
}

// The corrector's limit; another drift must not be dropped silently.
TEST(ModelFile, RefusesAFourthGaussMarkovDriftOfOneGyro) {
  const std::string drift =
      "[[effect]]\ngyro = 2\nkind = \"gauss_markov\"\nsigma_dps = 1e-3\n"
      "tau_s = 100\n";
  const std::string three = "format = 1\n" + drift + drift + drift;
  EXPECT_TRUE(complaints_of(three).empty());
  const auto messages = complaints_of(three + drift);
  ASSERT_EQ(messages.size(), 1U);
  EXPECT_TRUE(messages[0].starts_with("m.toml:17: ")) << messages[0];
}

TEST(ModelFile, IsBounded) {
  std::string text = "format = 1\n";
  for (std::size_t i = 0; i <= kEffectsMax; ++i)
    text += "[[effect]]\ngyro = 1\nkind = \"bias\"\nvalue_dps = 1\n";
  const auto messages = complaints_of(text);
  ASSERT_EQ(messages.size(), 1U);
  EXPECT_NE(messages[0].find("at most 256"), std::string::npos);
}

TEST(ModelFile, NamesAFileThatIsNotThere) {
  const ModelResult result = load_model("/nowhere/m.toml");
  ASSERT_FALSE(result);
  EXPECT_EQ(result.error().front().where, "/nowhere/m.toml");
}

// The corrector has three correlated drifts for each gyro; flicker uses the remaining ones.
TEST(ModelFile, KeepsRoomForFlicker) {
  const auto with_drifts = [](int drifts) {
    std::string text =
        "format = 1\n[[effect]]\ngyro = 1\nkind = \"bias_instability\"\ncoefficient_dps = 1e-3\n";
    for (int i = 0; i < drifts; ++i) {
      text += "[[effect]]\ngyro = 1\nkind = \"gauss_markov\"\nsigma_dps = 1e-3\ntau_s = 30\n";
    }
    return parse_model(text, "m.toml");
  };
  EXPECT_TRUE(with_drifts(2));
  const auto refused = with_drifts(3);
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error()[0].where, "m.toml:2");
  EXPECT_NE(refused.error()[0].message().find("beside it there may be 2"), std::string::npos)
      << refused.error()[0].message();
}

}  // namespace
}  // namespace vgyro::model

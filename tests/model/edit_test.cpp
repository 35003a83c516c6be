#include "model/edit.h"

#include <algorithm>
#include <random>

#include <gtest/gtest.h>

#include "model/catalogue.h"

namespace vgyro::model {
namespace {

constexpr unsigned kSeed = 7;

// Any value within the limits, of any magnitude.
double any_value(const Parameter& parameter, std::mt19937_64& random) {
  const auto uniform = [&] { return static_cast<double>(random() >> 11U) * 0x1p-53; };
  if (parameter.form == Parameter::Form::kAxis) return static_cast<double>(random() % 3);
  if (parameter.form == Parameter::Form::kWhole) return static_cast<double>(1 + random() % 100);
  const double magnitude = std::pow(10.0, -12.0 * uniform());
  const double value = random() % 2 == 0 || parameter.minimum >= 0.0
                           ? parameter.maximum * magnitude
                           : parameter.minimum * magnitude;
  return std::max(value, parameter.minimum);
}

Effect any_effect(Kind kind, std::mt19937_64& random) {
  Effect effect{.gyro = random() % 2, .kind = kind};
  const auto parameters = info(kind).parameters;
  for (std::size_t i = 0; i < parameters.size(); ++i)
    effect.parameters[i] = any_value(parameters[i], random);
  if (kind == Kind::kStuck && effect.parameters[0] >= effect.parameters[1])
    effect.parameters = {-1.0, 1.0};
  for (std::size_t i = 0; i < parameters.size(); ++i) {
    const bool has_one = parameters[i].form == Parameter::Form::kNumber && random() % 2 == 0;
    if (has_one) effect.sigma[i] = 1e-3 * (parameters[i].maximum - parameters[i].minimum);
  }
  effect.ambiguous = random() % 2 == 0;
  return effect;
}

void expect_same(const Effect& read, const Effect& written) {
  EXPECT_EQ(read.gyro, written.gyro);
  EXPECT_EQ(read.kind, written.kind);
  EXPECT_EQ(read.parameters, written.parameters) << info(written.kind).name;
  EXPECT_EQ(read.sigma, written.sigma) << info(written.kind).name;
  EXPECT_EQ(read.ambiguous, written.ambiguous) << info(written.kind).name;
}

constexpr const char* kUsersFiles[] = {
    "format = 1\n",
    "format = 1",
    "format = 1 # ends in a comment",
    "\xEF\xBB\xBF"
    "format = 1\n",
    "\n\n",
    "",
    "# Motor 3, ö µ\r\nformat = 1\r\n\r\n[[effect]] # first\r\n  gyro=1\r\n\tkind = 'bias'\r\n"
    "value_dps = 3.1E-2 # measured in May\r\n\r\n\r\n# end",
    "format = 1\n[[effect]]\nkind = \"scale_factor_temperature\"   # odd order\n\n# between\n"
    "coefficient_per_k = +1_000e-9\ngyro = 2",
};

TEST(ModelEdit, AppendsEveryKindToEveryFormOfFileAndKeepsWhatWasThere) {
  std::mt19937_64 random(kSeed);
  RecordProperty("seed", kSeed);
  for (const char* users : kUsersFiles) {
    const auto before = parse_model(users, "m");
    for (int round = 0; round < 20; ++round) {
      for (const KindInfo& kind : catalogue()) {
        const Effect effect = any_effect(kind.kind, random);
        const auto text = append_effect(users, effect, "found: 3.4 ± 0.1\nagain\x01");
        ASSERT_TRUE(text) << text.error().message();
        EXPECT_TRUE(text->starts_with(users)) << "every byte of the user's survives";
        const auto after = parse_model(*text, "m");
        ASSERT_TRUE(after) << *text;
        const std::size_t count = before ? before->effects.size() : 0;
        ASSERT_EQ(after->effects.size(), count + 1);
        for (std::size_t i = 0; i < count; ++i)
          expect_same(after->effects[i], before->effects[i]);
        expect_same(after->effects.back(), effect);
        EXPECT_NE(text->find("# found: 3.4 ± 0.1"), std::string::npos);
        EXPECT_NE(text->find("# again"), std::string::npos);
      }
    }
  }
}

TEST(ModelEdit, AppendsOneAfterTheOther) {
  std::mt19937_64 random(kSeed);
  std::string text = "format = 1\n";
  Model whole;
  for (const KindInfo& kind : catalogue()) {
    whole.effects.push_back(any_effect(kind.kind, random));
    const auto longer = append_effect(text, whole.effects.back(), "");
    ASSERT_TRUE(longer);
    text = *longer;
  }
  EXPECT_EQ(text, to_toml(whole));
  const auto read = parse_model(text, "m");
  ASSERT_TRUE(read);
  ASSERT_EQ(read->effects.size(), kKindCount);
  for (std::size_t i = 0; i < kKindCount; ++i)
    expect_same(read->effects[i], whole.effects[i]);
}

TEST(ModelEdit, WritesTheFewestDigitsThatReadBack) {
  const auto text =
      append_effect("", {.gyro = 1, .kind = Kind::kScaleFactor, .parameters = {-4.2e-4}}, "why");
  ASSERT_TRUE(text);
  EXPECT_EQ(
      *text,
      "format = 1\n\n# why\n[[effect]]\ngyro = 2\nkind = \"scale_factor\"\nerror = -0.00042\n");
}

TEST(ModelEdit, WritesOneNumberWhereOnlyTheSizeHasASigma) {
  Effect line{.kind = Kind::kLine, .parameters = {37.0, 0.01, 0.5}};
  line.sigma = {0.0, 1e-4, 0.0};
  EXPECT_NE(effect_table(line).find("\nsigma = 0.0001\n"), std::string::npos);
  line.sigma = {1e-3, 1e-4, 0.0};
  line.ambiguous = true;
  EXPECT_NE(effect_table(line).find(
                "\nsigma = { frequency_hz = 0.001, amplitude_dps = 0.0001 }\nambiguous = true\n"),
            std::string::npos)
      << effect_table(line);
}

TEST(ModelEdit, AppendsACommentThatChangesNoEffect) {
  const Effect bias{.gyro = 1, .kind = Kind::kBias, .parameters = {0.5}};
  for (const char* users : kUsersFiles) {
    const auto before = parse_model(users, "m");
    const auto text = append_comment(users, "not applied\n\n" + effect_table(bias));
    ASSERT_TRUE(text) << text.error().message();
    EXPECT_TRUE(text->starts_with(users));
    EXPECT_NE(text->find("# [[effect]]"), std::string::npos);
    const auto after = parse_model(*text, "m");
    ASSERT_TRUE(after) << *text;
    EXPECT_EQ(after->effects.size(), before ? before->effects.size() : 0);
  }
}

TEST(ModelEdit, KeepsTheLineEndsOfTheUser) {
  const auto text = append_effect("format = 1\r\n", {.kind = Kind::kBias}, "one\ntwo");
  ASSERT_TRUE(text);
  for (std::size_t i = 0; i < text->size(); ++i) {
    if ((*text)[i] != '\n') continue;
    EXPECT_EQ((*text)[i - 1], '\r') << "byte " << i;
  }
}

TEST(ModelEdit, RefusesWhatItCannotDoRight) {
  const Effect bias{.kind = Kind::kBias};
  const auto refusal = [](const Expected<std::string>& result) {
    return result ? std::string("done") : result.error().message();
  };
  EXPECT_NE(refusal(append_effect(
                        "format = 1\neffect = [ { gyro = 1, kind = \"bias\", value_dps = 1 } ]\n",
                        bias, ""))
                .find(":2: effects in an array"),
            std::string::npos);
  EXPECT_NE(refusal(append_effect("format = 1\neffect = []\n", bias, "")).find("[[effect]]"),
            std::string::npos);
  EXPECT_NE(refusal(append_effect("format = \n", bias, "")).find(":1: "), std::string::npos);
  EXPECT_NE(refusal(append_effect("# nothing\n", bias, "")).find("format is missing"),
            std::string::npos);
  Effect wrong = bias;
  wrong.parameters[0] = std::nan("");
  EXPECT_NE(refusal(append_effect("", wrong, "")).find("value_dps is nan"), std::string::npos);
  wrong = {.kind = Kind::kGSensitivity, .parameters = {7.0, 1.0}};
  EXPECT_NE(refusal(append_effect("", wrong, "")).find("axis"), std::string::npos);
}

// The names belong to the configuration, which an edit does not read.
TEST(ModelEdit, KeepsTheNamesOfGyros) {
  const std::string users =
      "format = 1\n\n[[effect]]\ngyro = \"mems\"  # the cheap one\nkind = \"bias\"\nvalue_dps = "
      "0.5\n";
  const auto text =
      append_effect(users, {.gyro = 0, .kind = Kind::kBias, .parameters = {0.25}}, "");
  ASSERT_TRUE(text) << text.error().message();
  EXPECT_EQ(text->substr(0, users.size()), users);
  const auto model = parse_model(*text, "m", {.names = {"fog", "mems"}});
  ASSERT_TRUE(model) << model.error().front().message();
  ASSERT_EQ(model->effects.size(), 2U);
  EXPECT_EQ(model->effects[0].gyro, 1U);
  EXPECT_EQ(model->effects[1].gyro, 0U);
}

}  // namespace
}  // namespace vgyro::model

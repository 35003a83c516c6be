// The text form of biases across a restart: exact numbers; a text that is cut, changed or
// impossible is refused. The checksum is computed here bit by bit, independently of the product.

#include "gateway/saved_state.h"

#include <bit>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <fstream>
#include <iterator>
#include <random>
#include <string>

#include <fmt/format.h>
#include <gtest/gtest.h>

#include "rig.h"

namespace vgyro::gateway {
namespace {

constexpr const char* kWhere = "state.toml";

std::uint32_t crc32_bit_by_bit(const std::string& bytes) {
  std::uint32_t crc = 0xFFFFFFFF;
  for (const char c : bytes) {
    crc ^= static_cast<unsigned char>(c);
    for (int bit = 0; bit < 8; ++bit)
      crc = (crc & 1U) != 0 ? crc >> 1U ^ 0xEDB88320U : crc >> 1U;
  }
  return ~crc;
}

std::string content_of(const std::string& text) {
  return text.substr(0, text.find("\n[checksum]"));
}

std::string sealed(const std::string& content) {
  std::array<char, 64> tail{};
  std::snprintf(tail.data(), tail.size(), "\n[checksum]\ncrc32 = \"%08x\"\n",
                crc32_bit_by_bit(content));
  return content + tail.data();
}

SavedState plain_state() {
  SavedState state;
  state.drift.bias_dps = {0.0331, -0.0074};
  state.drift.bias_covariance = {4e-8, -1e-9, 9e-8};
  state.drift.white_density = {6.4e-9, 0.0, 9e-8};
  state.drift.sample_variance = {1e-6, 2e-6};
  state.drift.walk_weight.fill(1.0 / static_cast<double>(fusion::kWalkPairs));
  state.drift.scale_difference = -4e-4;
  state.drift.scale_difference_sigma = 0.01;
  state.drift.skew_s = 1e-3;
  state.drift.skew_sigma_s = 1e-2;
  state.drift.kind_weight = {0.5, 0.0, 0.25, 0.125, 0.125};
  state.drift.slope_dps_s = {1.5e-6, -2e-7};
  state.drift.slope_sigma_dps_s = {3e-7, 4e-7};
  state.drift.coefficient_dps_k = {0.0, -3e-4};
  state.drift.coefficient_sigma_dps_k = {0.0, 2e-4};
  state.drift.temperature_c = {0.0, 31.5};
  state.drift.has_temperature = {false, true};
  state.rate_stamp = time_from_ns(1'700'000'000'123'456'000);
  state.temperature_c = {25.25, std::nullopt};
  state.devices = {"a: can0 0x101 GYRO S", "b \"x\\: can1"};
  state.rest_rate_dps = 0.0032;
  return state;
}

std::uint64_t pattern(double value) {
  return std::bit_cast<std::uint64_t>(value);
}

template <std::size_t kCount>
void expect_same(const std::array<double, kCount>& a, const std::array<double, kCount>& b) {
  for (std::size_t i = 0; i < kCount; ++i)
    EXPECT_EQ(pattern(a[i]), pattern(b[i])) << a[i] << " and " << b[i];
}

void expect_same(const SavedState& a, const SavedState& b) {
  expect_same(a.drift.bias_dps, b.drift.bias_dps);
  expect_same(a.drift.bias_covariance, b.drift.bias_covariance);
  expect_same(a.drift.white_density, b.drift.white_density);
  expect_same(a.drift.sample_variance, b.drift.sample_variance);
  expect_same(a.drift.walk_weight, b.drift.walk_weight);
  expect_same<5>({a.drift.scale_difference, a.drift.scale_difference_sigma, a.drift.skew_s,
                  a.drift.skew_sigma_s, a.rest_rate_dps},
                 {b.drift.scale_difference, b.drift.scale_difference_sigma, b.drift.skew_s,
                  b.drift.skew_sigma_s, b.rest_rate_dps});
  expect_same(a.drift.kind_weight, b.drift.kind_weight);
  expect_same(a.drift.slope_dps_s, b.drift.slope_dps_s);
  expect_same(a.drift.slope_sigma_dps_s, b.drift.slope_sigma_dps_s);
  expect_same(a.drift.coefficient_dps_k, b.drift.coefficient_dps_k);
  expect_same(a.drift.coefficient_sigma_dps_k, b.drift.coefficient_sigma_dps_k);
  expect_same(a.drift.temperature_c, b.drift.temperature_c);
  EXPECT_EQ(a.drift.has_temperature, b.drift.has_temperature);
  EXPECT_EQ(a.rate_stamp, b.rate_stamp);
  EXPECT_EQ(a.devices, b.devices);
  for (std::size_t gyro = 0; gyro < 2; ++gyro) {
    ASSERT_EQ(a.temperature_c[gyro].has_value(), b.temperature_c[gyro].has_value());
    expect_same<1>({a.temperature_c[gyro].value_or(0)}, {b.temperature_c[gyro].value_or(0)});
  }
}

TEST(SavedState, ComesBackBitForBit) {
  const auto back = saved_state_from(to_text(plain_state()), kWhere);
  ASSERT_TRUE(back) << back.error().message();
  expect_same(plain_state(), *back);
}

// Any mantissa, from subnormal numbers to the largest allowed ones, and both zeros.
TEST(SavedState, AnyNumbersComeBackBitForBit) {
  constexpr std::uint32_t kSeed = 20240607;
  SCOPED_TRACE(kSeed);
  std::mt19937_64 rng(kSeed);
  const auto any = [&](double limit) {
    const double value = std::ldexp(std::uniform_real_distribution<double>(0.5, 1.0)(rng),
                                    std::uniform_int_distribution<int>(-1070, 16)(rng));
    return std::min(value, limit);
  };
  const auto signed_any = [&](double limit) {
    return (rng() & 1U) != 0 ? any(limit) : -any(limit);
  };
  for (int round = 0; round < 300; ++round) {
    SavedState state = plain_state();
    state.drift.bias_dps = {signed_any(1e5), round == 0 ? -0.0 : signed_any(1e5)};
    const std::array<double, 2> variance{1e-30 + any(1e9), 1e-30 + any(1e9)};
    const double limit = std::sqrt(variance[0]) * std::sqrt(variance[1]);
    state.drift.bias_covariance = {variance[0], signed_any(0.99 * limit), variance[1]};
    state.drift.sample_variance = {any(1e9), 0.0};
    state.drift.skew_s = signed_any(10.0);
    state.drift.scale_difference = signed_any(1.0);
    double sum = 0.0;
    for (double& weight : state.drift.walk_weight)
      sum += weight = any(1.0);
    for (double& weight : state.drift.walk_weight)
      weight /= sum;
    for (double& weight : state.drift.kind_weight)
      weight = any(1.0);
    state.drift.slope_dps_s = {signed_any(1e5), signed_any(1e5)};
    state.drift.slope_sigma_dps_s = {any(1e5), 1e-9};
    state.drift.coefficient_dps_k = {signed_any(1e5), signed_any(1e5)};
    state.drift.coefficient_sigma_dps_k = {any(1e5), any(1e5)};
    state.drift.has_temperature = {true, round % 2 == 0};
    state.drift.temperature_c = {signed_any(100.0), round % 2 == 0 ? any(100.0) : 0.0};
    state.temperature_c = {signed_any(100.0), any(100.0)};
    state.rate_stamp = time_from_ns(static_cast<std::int64_t>(rng() >> 1U));
    const auto back = saved_state_from(to_text(state), kWhere);
    ASSERT_TRUE(back) << back.error().message();
    expect_same(state, *back);
  }
}

TEST(SavedState, ChecksumIsCrc32OfAllBytesBeforeIt) {
  const std::string text = to_text(plain_state());
  EXPECT_EQ(text, sealed(content_of(text)));
  EXPECT_LT(text.size(), kSavedStateBytesMax / 2);
}

TEST(SavedState, CutAnywhereIsRefused) {
  const std::string text = to_text(plain_state());
  for (std::size_t size = 0; size < text.size(); ++size)
    ASSERT_FALSE(saved_state_from(text.substr(0, size), kWhere)) << size;
}

// Every byte is changed to every other value.
TEST(SavedState, OneByteChangedIsRefused) {
  std::string text = to_text(plain_state());
  for (char& byte : text) {
    const char right = byte;
    for (int change = 1; change < 256; ++change) {
      byte = static_cast<char>(right ^ change);
      ASSERT_FALSE(saved_state_from(text, kWhere)) << &byte - text.data() << ' ' << change;
    }
    byte = right;
  }
  EXPECT_TRUE(saved_state_from(text, kWhere));
}

TEST(SavedState, BytesLostDoubledOrAddedAreRefused) {
  const std::string text = to_text(plain_state());
  for (std::size_t at = 0; at < text.size(); ++at) {
    std::string other = text;
    ASSERT_FALSE(saved_state_from(other.erase(at, 1), kWhere)) << at;
    other = text;
    ASSERT_FALSE(saved_state_from(other.insert(at, 1, text[at]), kWhere)) << at;
  }
  EXPECT_FALSE(saved_state_from(text + "\n", kWhere));
  EXPECT_FALSE(saved_state_from(text + text, kWhere));
  EXPECT_FALSE(saved_state_from(std::string(kSavedStateBytesMax + 1, 'x'), kWhere));
}

struct Forgery {
  const char* from;
  const char* to;
  const char* said;  ///< expected in the message
};

SavedState state_of_axes() {
  SavedState state = plain_state();
  SavedState x = state;
  SavedState z = state;
  z.axis = 2;
  z.drift.bias_dps = {0.25, -0.125};
  state.axes = {x, z};
  state.misalignment = {.angle_rad = {0.005, -0.004, 0.003},
                        .covariance = {1e-8, 1e-9, -1e-9, 2e-8, 3e-9, 4e-8}};
  return state;
}

// With several axes, too, every number comes back exactly.
TEST(SavedState, OfSeveralAxesComesBack) {
  const SavedState state = state_of_axes();
  const std::string text = to_text(state);
  const auto read = saved_state_from(text, kWhere);
  ASSERT_TRUE(read) << read.error().message();
  ASSERT_EQ(read->axes.size(), 2U);
  EXPECT_EQ(read->axes[1].axis, 2U);
  EXPECT_EQ(read->axes[1].drift.bias_dps, state.axes[1].drift.bias_dps);
  EXPECT_EQ(read->misalignment->angle_rad, state.misalignment->angle_rad);
  EXPECT_EQ(read->misalignment->covariance, state.misalignment->covariance);
  EXPECT_EQ(to_text(*read), text);
}

TEST(SavedState, OfSeveralAxesThatCannotBeIsRefused) {
  const std::string content = content_of(to_text(state_of_axes()));
  ASSERT_TRUE(saved_state_from(sealed(content), kWhere));
  const Forgery forgeries[] = {
      {"[axis.z]", "[axis.w]", "rate_stamp_ns is missing"},
      {"[axis.z.drift]", "[axis.z.other]", "holds no [drift]"},
      {"[misalignment]", "[tilt]", "unknown key"},
      {"angle_rad = [0.005", "angle_rad = [nan", "angle_rad is nan"},
      {"angle_rad = [0.005, ", "angle_rad = [", "not a list of 3"},
      {"covariance = [1e-08", "covariance = [1e300", "covariance is"},
  };
  for (const Forgery& forgery : forgeries) {
    SCOPED_TRACE(forgery.to);
    std::string forged = content;
    const std::size_t at = forged.find(forgery.from);
    ASSERT_NE(at, std::string::npos);
    forged.replace(at, std::string(forgery.from).size(), forgery.to);
    const auto read = saved_state_from(sealed(forged), kWhere);
    ASSERT_FALSE(read);
    EXPECT_NE(read.error().message().find(forgery.said), std::string::npos)
        << read.error().message();
  }
}

// The checksum is right, so that only the check of the contents can refuse the text.
TEST(SavedState, WhatCannotBeIsRefusedBehindARightChecksum) {
  const std::string content = content_of(to_text(plain_state()));
  ASSERT_TRUE(saved_state_from(sealed(content), kWhere));
  const Forgery forgeries[] = {
      {"format = 1", "format = 3", "a newer release has written it: only format 1"},
      {"format = 1", "format = 2", "unknown key"},
      {"format = 1", "format = \"1\"", "format 1"},
      {"format = 1", "format = 5e19", "format 1"},
      {"format = 1", "format = nan", "format 1"},
      {"[drift]", "[other]", "format 1"},
      {"bias_dps = [0.0331", "bias_dps = [nan", "bias_dps is nan"},
      {"bias_dps = [0.0331", "bias_dps = [inf", "bias_dps is inf"},
      {"bias_dps = [0.0331", "bias_dps = [1e300", "bias_dps"},
      {"bias_dps = [0.0331", "bias_dps = [\"0\"", "bias_dps"},
      {"bias_dps = [0.0331, ", "bias_dps = [", "not a list of 2"},
      {"bias_dps = [0.0331", "bias_dps = [0.0, 0.0331", "not a list of 2"},
      {"[4e-08, -1e-09, 9e-08]", "[0.0, 0.0, 9e-08]", "positive definite"},
      {"[4e-08, -1e-09, 9e-08]", "[-4e-08, 0.0, -9e-08]", "positive definite"},
      {"[4e-08, -1e-09, 9e-08]", "[4e-08, 6.1e-08, 9e-08]", "positive definite"},
      {"[4e-08, -1e-09, 9e-08]", "[4e-08, -6.1e-08, 9e-08]", "positive definite"},
      {"white_density = [6.4e-09, 0.0", "white_density = [6.4e-09, 1.0", "not a covariance"},
      {"sample_variance = [1e-06", "sample_variance = [-1e-06", "sample_variance"},
      {"walk_ratio_per_s = [0.001", "walk_ratio_per_s = [0.002", "another version"},
      {"walk_ratio_per_s = [0.001, ", "walk_ratio_per_s = [", "not a list of"},
      {"walk_weight = [", "walk_weight = [0.5, ", "walk_weight is not a list of "},
      {"walk_weight = [0.0", "walk_weight = [0.1", "add up to 1"},
      {"walk_weight = [0.0", "walk_weight = [-0.0", "walk_weight is"},
      {"scale_difference = -0.0004", "scale_difference = -1.1", "scale_difference"},
      {"scale_difference = -0.0004", "scale_differences = -0.0004", "scale_difference is missing"},
      {"scale_difference_sigma = 0.01", "scale_difference_sigma = -0.01", "scale_difference_sigma"},
      {"skew_s = 0.001", "skew_s = 11.0", "skew_s"},
      {"skew_sigma_s = 0.01", "skew_sigma_s = -1.0", "skew_sigma_s"},
      {"skew_sigma_s = 0.01", "skew_sigma_s = 0.01\nmore = 1", "more"},
      {"kind_weight = [0.5", "kind_weight = [nan", "kind_weight is nan"},
      {"kind_weight = [0.5", "kind_weight = [-0.5", "kind_weight is -0.5"},
      {"kind_weight = [0.5", "kind_weight = [1.5", "kind_weight is 1.5"},
      {"kind_weight = [0.5, ", "kind_weight = [", "kind_weight is not a list of "},
      {"kind_weight = [0.5, 0.0, 0.25, 0.125, 0.125]", "kind_weight = [0.0, 0.0, 0.0, 0.0, 0.0]",
       "kind_weight adds up to nothing"},
      {"kind_weight = [0.5, 0.0, 0.25, 0.125, 0.125]", "kind_weight = 1.0", "kind_weight"},
      {"slope_dps_s = [1.5e-06", "slope_dps_s = [inf", "slope_dps_s is inf"},
      {"slope_dps_s = [1.5e-06", "slope_dps_s = [1e9", "slope_dps_s"},
      {"slope_dps_s = [1.5e-06, -2e-07]\n", "", "slope_dps_s is not a list of 2"},
      {"slope_sigma_dps_s = [3e-07", "slope_sigma_dps_s = [-3e-07", "slope_sigma_dps_s"},
      {"slope_sigma_dps_s = [3e-07", "slope_sigma_dps_s = [nan", "slope_sigma_dps_s"},
      {"slope_sigma_dps_s = [3e-07, 4e-07]\n", "", "slope_sigma_dps_s is not a list of 2"},
      {"temperature_2_c = 31.5", "temperature_2_c = nan", "temperature_2_c"},
      {"temperature_2_c = 31.5", "temperature_2_c = -300.0", "temperature_2_c"},
      {"temperature_2_c = 31.5\n", "", "coefficient_dps_k needs a temperature"},
      {"coefficient_dps_k = [0.0", "coefficient_dps_k = [nan", "coefficient_dps_k is nan"},
      {"coefficient_dps_k = [0.0, -0.0003]\n", "", "coefficient_dps_k is not a list of 2"},
      {"coefficient_sigma_dps_k = [0.0", "coefficient_sigma_dps_k = [-0.1",
       "coefficient_sigma_dps_k is -0.1"},
      {"rate_stamp_ns = 1", "rate_stamp_ns = -1", "rate_stamp_ns"},
      {"rate_stamp_ns = 1", "rate_stamp_ns = 1.", "rate_stamp_ns"},
      {"rate_stamp_ns = 1", "rate_stamp_ns = 99", ""},
      {"rest_rate_dps = 0.0032", "rest_rate_dps = nan", "rest_rate_dps"},
      {"temperature_1_c = 25.25", "temperature_1_c = -300.0", "temperature_1_c"},
      {"temperature_1_c = 25.25", "temperature_1_c = nan", "temperature_1_c"},
      {"device_1 = \"a", "device_9 = \"a", "device_1"},
      {"device_1 = \"a", "device_1 = a\"", ""},
  };
  for (const Forgery& forgery : forgeries) {
    SCOPED_TRACE(forgery.to);
    std::string forged = content;
    const std::size_t at = forged.find(forgery.from);
    ASSERT_NE(at, std::string::npos) << forgery.from;
    forged.replace(at, std::strlen(forgery.from), forgery.to);
    const auto state = saved_state_from(sealed(forged), kWhere);
    ASSERT_FALSE(state);
    const std::string message = state.error().message();
    EXPECT_NE(message.find(forgery.said), std::string::npos) << message;
    EXPECT_EQ(message.find(kWhere), 0U) << message;
    EXPECT_FALSE(state.error().remedy.empty());
  }
}

std::string file_text(const std::string& name) {
  std::ifstream file(std::string(VGYRO_STATES_DIR "/") + name, std::ios::binary);
  EXPECT_TRUE(file) << name;
  return {std::istreambuf_iterator<char>(file), {}};
}

// A file of the release before slopes, kinds of drift and temperatures were learned.
TEST(SavedState, OfAnOlderReleaseIsReadAndWhatItDoesNotHoldIsNotKnown) {
  const std::string older = file_text("older_state.toml");
  const auto state = saved_state_from(older, kWhere);
  ASSERT_TRUE(state) << state.error().message();
  EXPECT_EQ(state->drift.bias_dps[0], 0.033002766051852594);
  const fusion::DriftMemory nothing;
  expect_same(state->drift.kind_weight, nothing.kind_weight);
  expect_same(state->drift.slope_sigma_dps_s, nothing.slope_sigma_dps_s);
  expect_same(state->drift.coefficient_sigma_dps_k, nothing.coefficient_sigma_dps_k);
  EXPECT_EQ(state->drift.has_temperature, nothing.has_temperature);
  EXPECT_EQ(to_text(*state), older) << "and written as that release did";
}

TEST(SavedState, OfThisReleaseIsReadWithWhatItHasLearned) {
  const auto state = saved_state_from(file_text("state.toml"), kWhere);
  ASSERT_TRUE(state) << state.error().message();
  expect_same(state->drift.kind_weight, {0.41, 0.17, 0.12, 0.24, 0.06});
  expect_same(state->drift.slope_dps_s, {1.3e-7, -4.2e-7});
  EXPECT_TRUE(state->drift.has_temperature[0]);
  EXPECT_FALSE(state->drift.has_temperature[1]);
  EXPECT_EQ(state->drift.temperature_c[0], 31.25);
  EXPECT_EQ(to_text(*state), file_text("state.toml"));
}

// Sums of probabilities with the rounding that the estimator causes.
TEST(SavedState, WeightsOfARoundingMoreThanOneAreRead) {
  SavedState state = plain_state();
  const double more_than_one = std::nextafter(1.0, 2.0);
  state.drift.walk_weight.fill(0.0);
  state.drift.walk_weight[40] = more_than_one;
  state.drift.kind_weight = {0.0, 0.0, more_than_one, 0.0, 0.0};
  const auto back = saved_state_from(to_text(state), kWhere);
  ASSERT_TRUE(back) << back.error().message();
  expect_same(state, *back);
}

// With the longest possible numbers in every place the text is far below its size limit.
TEST(SavedState, WithTheLongestNumbersStaysWithinItsBound) {
  SavedState state = plain_state();
  const double longest = -1.2345678901234567e-300;
  ASSERT_EQ(fmt::format("{}", longest).size(), 24U);
  state.drift.walk_weight.fill(-longest);
  state.drift.walk_weight[0] = 1.0;
  state.drift.kind_weight.fill(-longest);
  state.drift.slope_dps_s.fill(longest);
  state.drift.slope_sigma_dps_s.fill(-longest);
  state.drift.coefficient_dps_k.fill(longest);
  state.drift.coefficient_sigma_dps_k.fill(-longest);
  state.drift.temperature_c.fill(longest);
  state.drift.has_temperature.fill(true);
  const std::string text = to_text(state);
  EXPECT_LT(text.size(), kSavedStateBytesMax / 2);
  EXPECT_TRUE(saved_state_from(text, kWhere));
}

TEST(SavedState, AnyNameOfAGyroComesBack) {
  Plan plan = rig::two_gyros();
  plan.gyros[0].name = "gr\u00F6\u00DFe \"\\\n\x7F = [drift] # \U0001F600";
  SavedState state = plain_state();
  state.devices = {device_of(plan.gyros[0]), device_of(plan.gyros[1])};
  state.rest_rate_dps = plan.calibration.rate_dps;
  const auto back = saved_state_from(to_text(state), kWhere);
  ASSERT_TRUE(back) << back.error().message();
  EXPECT_TRUE(check_devices(*back, plan));
  plan.gyros[0].name[2] = '\n';
  EXPECT_FALSE(check_devices(*back, plan));
}

TEST(SavedState, DevicesAreToldApartByAllThatChangesTheBias) {
  const Plan plan = rig::two_gyros();
  SavedState state = plain_state();
  state.devices = {device_of(plan.gyros[0]), device_of(plan.gyros[1])};
  state.rest_rate_dps = plan.calibration.rate_dps;
  ASSERT_TRUE(check_devices(state, plan));
  using Change = void (*)(Plan&);
  const Change changes[] = {
      [](Plan& p) { p.gyros[0].name = "c"; },
      [](Plan& p) { p.gyros[0].bus = "can5"; },
      [](Plan& p) { p.gyros[0].taken_back = "0123abcd"; },
      [](Plan& p) { p.gyros[1].match.id = 0x105; },
      [](Plan& p) { p.gyros[1].match.extended = true; },
      [](Plan& p) { p.gyros[1].message = "OTHER"; },
      [](Plan& p) { p.gyros[1].rate.name = "RateY"; },
      [](Plan& p) { p.gyros[0].rate.scale = -1.0; },
      [](Plan& p) { p.gyros[0].rate.shift = 0.1; },
      [](Plan& p) { p.gyros[0].rate.layout = "bit 8"; },
      [](Plan& p) { p.gyros[0].sign = rig::codec_of(rig::signal_of(40, 1)); },
      [](Plan& p) { std::swap(p.gyros[0], p.gyros[1]); },
      [](Plan& p) { p.calibration.rate_dps = 0.003; },
  };
  for (const Change& change : changes) {
    Plan other = plan;
    change(other);
    const auto same = check_devices(state, other);
    ASSERT_FALSE(same) << &change - changes;
    EXPECT_FALSE(same.error().what.empty() || same.error().remedy.empty());
  }
}

}  // namespace
}  // namespace vgyro::gateway

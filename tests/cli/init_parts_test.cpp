// The parts of `vgyro init`: the frames kept from a log, the meaning of names, the fields in bytes.

#include <array>
#include <cmath>
#include <random>
#include <string>

#include <gtest/gtest.h>

#include "cli/init/candidates.h"
#include "cli/init/guess.h"
#include "cli/init/layouts.h"
#include "cli/init/traffic.h"
#include "dbc/parser.h"

namespace vgyro::cli {
namespace {

constexpr unsigned kSeed = 11;
constexpr std::int64_t kSecond_ns = 1'000'000'000;

canlog::LogRecord record(std::int64_t t_ns, std::uint32_t id, const std::vector<unsigned>& bytes,
                         bool extended = false) {
  canlog::LogRecord made;
  made.stamp = time_from_ns(t_ns);
  made.frame.id = id;
  if (extended) made.frame.flags = can::kExtended;
  made.frame.length = static_cast<std::uint8_t>(bytes.size());
  for (std::size_t i = 0; i < bytes.size(); ++i)
    made.frame.data[i] = static_cast<std::uint8_t>(bytes[i]);
  return made;
}

TEST(InitTraffic, KeepsFramesByBusIdentifierAndLength) {
  Traffic traffic;
  for (int i = 0; i < 11; ++i)
    traffic.add("can0", record(i * kSecond_ns / 10, 0x101, {1, 2, static_cast<unsigned>(i)}));
  traffic.add("can1", record(kSecond_ns, 0x101, {}));
  traffic.add("can0", record(kSecond_ns, 0x101, {9}, true));
  const auto streams = traffic.streams();
  ASSERT_EQ(streams.size(), 3U);
  EXPECT_EQ(traffic.frames(), 13U);
  EXPECT_TRUE(traffic.has("can0", 0x101));
  EXPECT_FALSE(traffic.has("can0", 0x102));
  const Stream& first = *streams[0];
  EXPECT_EQ(first.frames, 11U);
  EXPECT_NEAR(first.frames_per_s(), 10.0, 1e-9);
  EXPECT_EQ(first.payload(first.kept[7])[2], 7);
  EXPECT_EQ(streams[1]->extended, true);
  EXPECT_EQ(streams[2]->payload(streams[2]->kept[0]).size(), 0U);
}

TEST(InitTraffic, ThinsALongLogEvenlyAndCountsAllOfIt) {
  constexpr std::size_t kBytesMost = 400'000;
  Traffic traffic(kBytesMost);
  constexpr int kFrames = 100'000;
  for (int i = 0; i < kFrames; ++i)
    traffic.add("can0", record(i * kSecond_ns / 100, 0x101, {1, 2, 3, 4, 5, 6, 7, 8}));
  EXPECT_TRUE(traffic.thinned());
  EXPECT_EQ(traffic.frames(), std::uint64_t{kFrames});
  const Stream& stream = *traffic.streams()[0];
  EXPECT_EQ(stream.frames, std::uint64_t{kFrames});
  EXPECT_LE(stream.kept.size() * (sizeof(Stream::Kept) + 8), kBytesMost);
  EXPECT_GE(stream.kept.size() * (sizeof(Stream::Kept) + 8), kBytesMost / 5);
  // Complete blocks, also from the log's end.
  EXPECT_EQ(stream.kept[1].t_ns - stream.kept[0].t_ns, kSecond_ns / 100);
  EXPECT_GT(stream.kept.back().t_ns, 800 * kSecond_ns);
}

TEST(InitTraffic, BearsHostileStampsAndFloodsOfIdentifiers) {
  Traffic traffic;
  traffic.add("can0", record(INT64_MIN, 0x101, {1}));
  traffic.add("can0", record(INT64_MAX, 0x101, {1}));
  traffic.add("can0", record(0, 0x101, {1}));
  EXPECT_GT(traffic.seconds(), 0.0);
  EXPECT_GE(traffic.streams()[0]->frames_per_s(), 0.0);
  for (std::uint32_t id = 0; id < 3 * Traffic::kStreamsMost; ++id)
    traffic.add("can0", record(kSecond_ns, id, {1}, true));
  EXPECT_LE(traffic.streams().size(), Traffic::kStreamsMost);
  EXPECT_EQ(traffic.frames(), 3 + 3 * Traffic::kStreamsMost);
}

TEST(InitTraffic, KeepsTheIdentifiersThatAreNamedAlone) {
  Traffic traffic;
  traffic.only({0x102});
  traffic.add("can0", record(0, 0x101, {1}));
  traffic.add("can0", record(0, 0x102, {1}));
  EXPECT_TRUE(traffic.has("can0", 0x101)) << "its identifier is in use all the same";
  EXPECT_EQ(traffic.streams()[0]->kept.size(), 0U);
  EXPECT_EQ(traffic.streams()[1]->kept.size(), 1U);
}

TEST(InitNames, TellYawRatesFromOtherThingsThatTurn) {
  for (const char* const name : {"YawRate", "VehYawRate", "Gierrate", "RateZ", "Turn_Rate"})
    EXPECT_GT(name_score(name, "MSG"), 0.7) << name;
  for (const char* const name : {"RollRate", "PitchRate", "GyroX", "rate_y"})
    EXPECT_LT(name_score(name, "MSG"), 0.0) << name;
  for (const char* const name : {"EngineSpeed", "SteeringWheelRate", "WheelFL", "MotorRPM"})
    EXPECT_LE(name_score(name, "MSG"), -2.0) << name;
}

TEST(InitMessages, TheVeryIdentifierGoesBeforeTheParameterGroup) {
  const std::string text =
      "BO_ 2364549886 ANY: 8 X\n SG_ A : 0|16@1+ (1,0) [0|0] \"deg/s\" X\n\n"
      "BO_ 2364549850 MINE: 8 X\n SG_ A : 0|16@1+ (1,0) [0|0] \"deg/s\" X\n\n"
      "BA_DEF_ BO_ \"VFrameFormat\" ENUM \"StandardCAN\",\"ExtendedCAN\",\"reserved\","
      "\"J1939PG\";\nBA_ \"VFrameFormat\" BO_ 2364549886 3;\nBA_ \"VFrameFormat\" BO_ 2364549850 "
      "3;\n";
  const std::vector<dbc::Database> databases{dbc::parse(text, "two.dbc")};
  Traffic traffic;
  traffic.add("can0", record(0, 2364549850U & can::kExtendedIdMax, {0, 0}, true));
  traffic.add("can0", record(0, 0x0CF02AE2, {0, 0}, true));
  std::string names;
  for (const Found& found : find_messages(traffic, databases))
    names += found.message->name + " ";
  EXPECT_EQ(names, "MINE ANY ");
}

TEST(InitSeries, LeavesOutWhatIsOutOfRangeOrComesTooEarly) {
  const auto database =
      dbc::parse("BO_ 257 M: 2 X\n SG_ Rate : 0|16@1- (0.1,0) [-100|100] \"deg/s\" X\n", "one.dbc");
  Traffic traffic;
  const auto add = [&](int second, unsigned low, unsigned high) {
    traffic.add("can0", record(second * kSecond_ns, 0x101, {low, high}));
  };
  add(1, 10, 0);
  add(2, 0xFF, 0x7F);  // 3276.7
  add(1000, 20, 0);    // a stamp from nowhere
  add(3, 30, 0);
  add(4, 40, 0);
  const Found found{traffic.streams()[0], &database, &database.messages[0]};
  const auto series = series_of(found, database.messages[0].signals[0], 2.0);
  EXPECT_EQ(series.t_s, (std::vector<double>{1.0, 3.0, 4.0}));
  ASSERT_EQ(series.value.size(), 3U);
  EXPECT_DOUBLE_EQ(series.value[1], 6.0);
  EXPECT_DOUBLE_EQ(series.step, 0.2);
}

// Motorola 16 bits at byte 1; a counter in the high nibble of byte 0; the rest is random.
TEST(InitLayouts, FindTheFieldAndTheCounterAmongChance) {
  std::mt19937 random(kSeed);
  Traffic traffic;
  for (int i = 0; i < 3000; ++i) {
    const unsigned raw = static_cast<std::uint16_t>(std::lround(2500.0 * std::sin(0.02 * i)) +
                                                    static_cast<int>(random() % 9));
    traffic.add("can0", record(i * kSecond_ns / 100, 0x200,
                               {static_cast<unsigned>(i % 16) << 4U | 5U, raw >> 8U, raw & 0xFFU,
                                static_cast<unsigned>(random() % 256), 0x11, 0x22}));
  }
  const Stream& stream = *traffic.streams()[0];
  EXPECT_EQ(usual_length(stream), 6U);
  const auto fields = find_fields(stream);
  ASSERT_EQ(fields.size(), 1U);
  EXPECT_EQ(fields[0].start_bit, 15);
  EXPECT_EQ(fields[0].length_bits, 16);
  EXPECT_EQ(fields[0].byte_order, dbc::ByteOrder::kMotorola);
  EXPECT_EQ(fields[0].type, dbc::ValueType::kSigned);
  const auto counters = find_counters(stream);
  ASSERT_EQ(counters.size(), 1U);
  EXPECT_EQ(counters[0].start_bit, 4);
  EXPECT_EQ(counters[0].length_bits, 4);
}

TEST(InitTurn, IsTheIntegralLessTheRest) {
  analysis::StampedSignal series;
  for (int i = 0; i < 2000; ++i) {
    series.t_s.push_back(0.01 * i);
    series.value.push_back(0.7 + (i >= 500 && i < 1400 ? 10.0 : 0.0));  // 9 s of 10
  }
  ASSERT_TRUE(turned_angle(series));
  EXPECT_NEAR(*turned_angle(series), 90.0, 1e-6);
  series.t_s.back() += 5.0;
  EXPECT_FALSE(turned_angle(series));
  EXPECT_FALSE(turned_angle({}));
}

}  // namespace
}  // namespace vgyro::cli

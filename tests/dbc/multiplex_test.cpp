#include "dbc/multiplex.h"

#include <string>
#include <vector>

#include <fmt/core.h>
#include <gtest/gtest.h>

#include "dbc/parser.h"

namespace vgyro::dbc {
namespace {

using Bytes = std::vector<std::uint8_t>;

Database parsed(const std::string& signals) {
  return parse("BO_ 1 M: 8 E\n" + signals, "test.dbc");
}

std::string seen(const Message& message, const Bytes& payload) {
  std::string text;
  MessageCodec(message).for_each(payload, [&text](const Signal& signal, const Reading& reading) {
    text += fmt::format("{}={} ", signal.name, reading.raw);
  });
  return text;
}

std::string line(const std::string& name_and_role, unsigned start, unsigned length = 8) {
  return fmt::format(" SG_ {} : {}|{}@1+ (1,0) [0|0] \"\" E\n", name_and_role, start, length);
}

// Without multiplexing every signal is present, in the file's order.
TEST(MessageCodec, ReadsAllSignals) {
  const Database database = parsed(line("A", 8) + line("B", 0));
  EXPECT_EQ(seen(database.messages[0], {1, 2, 3, 4, 5, 6, 7, 8}), "A=2 B=1 ");
}

// The multiplexor's value selects the signals; the multiplexor itself is always present.
TEST(MessageCodec, FollowsTheMultiplexor) {
  const Database database =
      parsed(line("X M", 0) + line("A m0", 8) + line("B m1", 8) + line("C", 16));
  EXPECT_EQ(seen(database.messages[0], {0, 7, 9, 0, 0, 0, 0, 0}), "X=0 A=7 C=9 ");
  EXPECT_EQ(seen(database.messages[0], {1, 7, 9, 0, 0, 0, 0, 0}), "X=1 B=7 C=9 ");
  EXPECT_EQ(seen(database.messages[0], {2, 7, 9, 0, 0, 0, 0, 0}), "X=2 C=9 ");
}

// If a multiplexor is absent, so are its signals.
TEST(MessageCodec, FollowsMultiplexorsOfMultiplexors) {
  const Database database = parsed(line("X M", 0) + line("Y m1M", 8) + line("A m5", 16) +
                                   "SG_MUL_VAL_ 1 Y X 1-1, 3-4;\nSG_MUL_VAL_ 1 A Y 5-6;\n");
  EXPECT_EQ(seen(database.messages[0], {1, 5, 9, 0, 0, 0, 0, 0}), "X=1 Y=5 A=9 ");
  EXPECT_EQ(seen(database.messages[0], {4, 6, 9, 0, 0, 0, 0, 0}), "X=4 Y=6 A=9 ");
  EXPECT_EQ(seen(database.messages[0], {4, 7, 9, 0, 0, 0, 0, 0}), "X=4 Y=7 ");
  EXPECT_EQ(seen(database.messages[0], {2, 5, 9, 0, 0, 0, 0, 0}), "X=2 ");
}

// Presences from two readings of one file are equal; that of another page is not.
TEST(Presence, IsTheSameWhereItsConditionsAre) {
  const auto presence_of_a = [](const std::string& page, unsigned multiplexor_bit) {
    const Database database =
        parsed(line("X M", 0) + line("Y m1M", multiplexor_bit) + line("A m" + page, 32) +
               "SG_MUL_VAL_ 1 Y X 1-1, 3-4;\n" + "SG_MUL_VAL_ 1 A Y " + page + "-9;\n");
    return Presence::make(database.messages[0], database.messages[0].signals[2], "test").value();
  };
  EXPECT_EQ(presence_of_a("5", 8), presence_of_a("5", 8));
  EXPECT_FALSE(presence_of_a("5", 8) == presence_of_a("6", 8));
  EXPECT_FALSE(presence_of_a("5", 8) == presence_of_a("5", 16));
  EXPECT_EQ(Presence(), Presence());
  EXPECT_FALSE(presence_of_a("5", 8) == Presence());
}

// A multiplexor declared signed is compared by its bits.
TEST(MessageCodec, ComparesTheBitsOfASignedMultiplexor) {
  const Database database = parsed(" SG_ X M : 0|8@1- (1,0) [0|0] \"\" E\n" + line("A m255", 8));
  EXPECT_EQ(seen(database.messages[0], {255, 3, 0, 0, 0, 0, 0, 0}), "X=-1 A=3 ");
}

// With a truncated payload the signals that it holds completely are read.
TEST(MessageCodec, SkipsSignalsBeyondATruncatedPayload) {
  const Database database =
      parsed(line("A", 0) + line("B", 8, 12) + line("X M", 24) + line("C m0", 0));
  EXPECT_EQ(seen(database.messages[0], {1, 2, 3, 0}), "A=1 B=770 X=0 C=1 ");
  EXPECT_EQ(seen(database.messages[0], {1, 2, 3}), "A=1 B=770 ");
  EXPECT_EQ(seen(database.messages[0], {1, 2}), "A=1 ");
  EXPECT_EQ(seen(database.messages[0], {}), "");
}

// Multiplexors that depend on each other never hold; this is reported and the rest is read.
TEST(MessageCodec, LeavesOutCircles) {
  const Database database =
      parsed(line("A", 0) + line("B", 8) + line("C", 16) + line("D", 24) +
             "SG_MUL_VAL_ 1 A B 0-255;\nSG_MUL_VAL_ 1 B A 0-255;\nSG_MUL_VAL_ 1 C C 0-255;\n");
  EXPECT_EQ(seen(database.messages[0], Bytes(8)), "D=0 ");
  const MessageCodec codec(database.messages[0], "test.dbc");
  ASSERT_EQ(codec.left_out().size(), 3U);
  EXPECT_EQ(codec.left_out()[0].where, "test.dbc:2");
}

// A chain is followed for sixteen multiplexors and no further, in whichever order it is written.
TEST(MessageCodec, BoundsTheDepthOfChains) {
  for (const bool reversed : {false, true}) {
    std::string signals;
    std::string ranges;
    for (unsigned i = 0; i < 20; ++i) {
      const unsigned index = reversed ? 19 - i : i;
      signals += line(fmt::format("S{}", index), 0);
      if (index > 0) ranges += fmt::format("SG_MUL_VAL_ 1 S{} S{} 0-0;\n", index, index - 1);
    }
    const Database database = parsed(signals + ranges);
    const MessageCodec codec(database.messages[0]);
    EXPECT_EQ(codec.left_out().size(), 3U) << reversed;
  }
}

// A presence can be made for one signal alone, and outlives the database.
TEST(Presence, TellsOfOneSignal) {
  Expected<Presence> presence = fail("", "not made");
  Expected<Presence> always = fail("", "not made");
  {
    const Database database = parsed(line("X M", 0) + line("A m2", 8));
    const Message& message = database.messages[0];
    presence = Presence::make(message, message.signals[1], "here");
    always = Presence::make(message, message.signals[0], "here");
  }
  ASSERT_TRUE(presence);
  EXPECT_FALSE(presence->always());
  EXPECT_TRUE(presence->holds(Bytes{2, 0}));
  EXPECT_FALSE(presence->holds(Bytes{3, 0}));
  EXPECT_FALSE(presence->holds(Bytes{}));
  ASSERT_TRUE(always);
  EXPECT_TRUE(always->always());
  EXPECT_TRUE(always->holds(Bytes{}));
}

// A condition on a missing or unreadable multiplexor is an error with its place.
TEST(Presence, RefusesUnreadableMultiplexors) {
  Database database = parsed(line("X M", 60, 8) + line("A m2", 8));
  Message& message = database.messages[0];
  EXPECT_FALSE(Presence::make(message, message.signals[1], "here"));
  message.signals[1].condition->multiplexor = "Y";
  const auto missing = Presence::make(message, message.signals[1], "here");
  ASSERT_FALSE(missing);
  EXPECT_EQ(missing.error().message(), "here: message M has no multiplexor Y for signal A");
}

}  // namespace
}  // namespace vgyro::dbc

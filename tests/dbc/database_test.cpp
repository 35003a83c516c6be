#include "dbc/database.h"

#include <gtest/gtest.h>

namespace vgyro::dbc {
namespace {

Message message_of(std::uint32_t id, bool extended, bool is_j1939) {
  Message message;
  message.name = "M";
  message.id = id;
  message.extended = extended;
  message.is_j1939 = is_j1939;
  return message;
}

// A standard and an extended frame of the same number are different frames.
TEST(Message, MatchesIdentifierAndFormat) {
  const Message standard = message_of(0x123, false, false);
  EXPECT_TRUE(standard.matches(0x123, false));
  EXPECT_FALSE(standard.matches(0x123, true));
  EXPECT_FALSE(standard.matches(0x124, false));
  EXPECT_EQ(standard.id_mask(), 0x7FFU);
  const Message extended = message_of(0x123, true, false);
  EXPECT_TRUE(extended.matches(0x123, true));
  EXPECT_FALSE(extended.matches(0x10000123, true));
  EXPECT_EQ(extended.id_mask(), 0x1FFFFFFFU);
}

// Broadcast J1939 groups (PF from 240) match from any source and with any priority.
TEST(Message, MatchesBroadcastGroupFromAnySource) {
  const Message ari = message_of(0x0CF02AFE, true, true);
  EXPECT_TRUE(ari.matches(0x0CF02AE2, true));
  EXPECT_TRUE(ari.matches(0x18F02A00, true));
  EXPECT_FALSE(ari.matches(0x0CF02BE2, true));
  EXPECT_FALSE(ari.matches(0x0DF02AE2, true));
  EXPECT_FALSE(ari.matches(0x0CF02AE2, false));
  EXPECT_EQ(ari.id_mask(), 0x03FFFF00U);
}

// In addressed groups (PF below 240) the byte after PF is the destination, not part of the group.
TEST(Message, MatchesAddressedGroupToAnyDestination) {
  const Message request = message_of(0x18EAFFFE, true, true);
  EXPECT_TRUE(request.matches(0x18EA2103, true));
  EXPECT_FALSE(request.matches(0x18EB2103, true));
  EXPECT_EQ(request.id_mask(), 0x03FF0000U);
}

// Finds the first element of a name; null if there is none.
TEST(Database, FindsByName) {
  Database database;
  database.messages = {message_of(1, false, false), message_of(2, false, false)};
  database.messages[1].name = "N";
  Signal signal;
  signal.name = "Rate";
  signal.labels = {{0, "ok"}, {-1, "bad"}};
  database.messages[1].signals = {signal};
  ASSERT_NE(database.find_message("N"), nullptr);
  EXPECT_EQ(database.find_message("N")->id, 2U);
  EXPECT_EQ(database.find_message("n"), nullptr);
  EXPECT_EQ(database.message_names(), (std::vector<std::string>{"M", "N"}));
  const Message& message = *database.find_message("N");
  EXPECT_EQ(message.signal_names(), (std::vector<std::string>{"Rate"}));
  EXPECT_EQ(message.find_signal("rate"), nullptr);
  const Signal* const found = message.find_signal("Rate");
  ASSERT_NE(found, nullptr);
  ASSERT_NE(found->label(-1), nullptr);
  EXPECT_EQ(*found->label(-1), "bad");
  EXPECT_EQ(found->label(7), nullptr);
}

// The sender is the last byte; in addressed groups the receiver precedes it.
TEST(Message, KnowsTheSameSenderWhateverItsPriority) {
  EXPECT_TRUE(same_sender(0x0CF02A13, 0x18F02A13));
  EXPECT_FALSE(same_sender(0x0CF02A13, 0x0CF02A14));
  EXPECT_FALSE(same_sender(0x0CF02A13, 0x0CF02B13));
  EXPECT_FALSE(same_sender(0x18EA2103, 0x18EA2203));
}

}  // namespace
}  // namespace vgyro::dbc

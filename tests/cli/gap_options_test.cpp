#include <gtest/gtest.h>

#include "cli/gap/accept.h"
#include "cli/output/progress.h"

namespace vgyro::cli {
namespace {

using model::Kind;

TEST(AcceptOption, NamesAGyroAKindOrBoth) {
  const auto gyro = acceptance_from("gyro=2");
  ASSERT_TRUE(gyro);
  EXPECT_EQ(gyro->gyro, 1U);
  EXPECT_FALSE(gyro->kind);
  const auto both = acceptance_from("kind=delay,gyro=1");
  ASSERT_TRUE(both);
  EXPECT_EQ(both->gyro, 0U);
  EXPECT_EQ(both->kind, Kind::kDelay);
  const auto likeliest = acceptance_from("likeliest");
  ASSERT_TRUE(likeliest);
  EXPECT_FALSE(likeliest->gyro || likeliest->kind);
}

TEST(AcceptOption, SaysWhatIsWrongAndWhatWouldBeRight) {
  for (const char* word :
       {"", "2", "gyro", "gyro=", "gyro=0", "gyro=3", "gyro=1,", ",gyro=1", "GYRO=1"}) {
    const auto wrong = acceptance_from(word);
    ASSERT_FALSE(wrong) << word;
    EXPECT_NE(wrong.error().message().find("gyro=1 or gyro=2"), std::string::npos) << word;
  }
  const auto kind = acceptance_from("kind=scale_facter");
  ASSERT_FALSE(kind);
  EXPECT_NE(kind.error().message().find("did you mean \"scale_factor\"?"), std::string::npos);
}

TEST(Progress, TellsWhatIsLeftOnceThatIsNoGuess) {
  EXPECT_EQ(remaining_text(1.0, 0.5), "") << "too soon";
  EXPECT_EQ(remaining_text(10.0, 0.01), "") << "too little of it is done";
  EXPECT_EQ(remaining_text(10.0, 0.5), ", some 10 s left");
  EXPECT_EQ(remaining_text(90.0, 0.1), ", some 14 min left");
  EXPECT_EQ(remaining_text(10.0, 1.0), "");
}

}  // namespace
}  // namespace vgyro::cli

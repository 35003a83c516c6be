// Messages to systemd while it reads, while it does not, and when it reads again.

#include "daemon/service.h"

#include <array>
#include <string>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>
#include <vector>

#include <gtest/gtest.h>

#include "scratch.h"

namespace vgyro::daemon {
namespace {

/// A service manager's end of the socket.
class Manager {
 public:
  explicit Manager(const std::string& path)
      : fd_(::socket(AF_UNIX, SOCK_DGRAM | SOCK_NONBLOCK | SOCK_CLOEXEC, 0)) {
    sockaddr_un own{};
    own.sun_family = AF_UNIX;
    path.copy(own.sun_path, sizeof(own.sun_path) - 1);
    EXPECT_EQ(::bind(fd_, reinterpret_cast<const sockaddr*>(&own), sizeof(own)), 0);
  }
  Manager(const Manager&) = delete;
  Manager& operator=(const Manager&) = delete;
  ~Manager() { ::close(fd_); }

  std::vector<std::string> heard() const {
    std::vector<std::string> messages;
    std::array<char, 4096> block{};
    for (;;) {
      const ssize_t count = ::recv(fd_, block.data(), block.size(), 0);
      if (count < 0) return messages;
      messages.emplace_back(block.data(), static_cast<std::size_t>(count));
    }
  }

 private:
  int fd_;
};

class NotifierTest : public testing::Test {
 protected:
  void fill() {
    while (notifier.failures() == 0)
      notifier.status("running");
  }

  Scratch scratch;
  Manager manager{scratch.path("notify")};
  Notifier notifier{scratch.path("notify")};
};

TEST_F(NotifierTest, TellsTheManagerInItsWords) {
  notifier.ready("waiting");
  notifier.alive();
  notifier.status("running");
  notifier.stopping();
  EXPECT_EQ(manager.heard(),
            (std::vector<std::string>{"READY=1\nSTATUS=waiting", "WATCHDOG=1", "STATUS=running",
                                      "STOPPING=1\nSTATUS=stopping"}));
  EXPECT_EQ(notifier.failures(), 0U);
}

TEST_F(NotifierTest, AManagerThatDoesNotReadHoldsNobodyUpAndIsCounted) {
  fill();
  EXPECT_GE(notifier.failures(), 1U);
}

TEST_F(NotifierTest, WhatTheManagerMustKnowComesAgainInItsOrder) {
  fill();
  notifier.reloading();
  notifier.ready("with the new configuration");
  manager.heard();
  notifier.alive();
  const std::vector<std::string> heard = manager.heard();
  ASSERT_EQ(heard.size(), 3U);
  EXPECT_EQ(heard[0].substr(0, 12), "RELOADING=1\n");
  EXPECT_EQ(heard[1], "READY=1\nSTATUS=with the new configuration");
  EXPECT_EQ(heard[2], "WATCHDOG=1");
}

TEST_F(NotifierTest, WhatIsOwedIsBounded) {
  fill();
  for (int i = 0; i < 1000; ++i)
    notifier.ready(std::to_string(i));
  manager.heard();
  notifier.alive();
  const std::vector<std::string> heard = manager.heard();
  ASSERT_EQ(heard.size(), 5U);
  EXPECT_EQ(heard[3], "READY=1\nSTATUS=999");
}

TEST(Notifier, WithoutAManagerNothingFails) {
  Notifier nobody{std::string()};
  nobody.ready("waiting");
  nobody.alive();
  EXPECT_EQ(nobody.failures(), 0U);
}

}  // namespace
}  // namespace vgyro::daemon

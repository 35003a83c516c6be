#include "base/bounded_file.h"

#include <cstdio>
#include <filesystem>
#include <fstream>
#include <string>
#include <sys/stat.h>
#include <unistd.h>

#include <gtest/gtest.h>

namespace vgyro {
namespace {

class ReadRegularFile : public ::testing::Test {
 protected:
  static constexpr std::size_t kMost = 4096;

  ReadRegularFile() {
    std::string pattern = ::testing::TempDir() + "vgyro_bounded_XXXXXX";
    folder_ = ::mkdtemp(pattern.data());
    path_ = folder_ + "/file";
  }
  ~ReadRegularFile() override { std::filesystem::remove_all(folder_); }

  void write(const std::string& bytes) const { std::ofstream(path_, std::ios::binary) << bytes; }

  std::string folder_;
  std::string path_;
};

TEST_F(ReadRegularFile, GivesEveryByteUpToTheBound) {
  for (const std::size_t size : {std::size_t{0}, std::size_t{1}, kMost}) {
    const std::string bytes(size, '\0');
    write(bytes);
    EXPECT_EQ(read_regular_file(path_, kMost).value(), bytes);
  }
}

TEST_F(ReadRegularFile, RefusesWhatIsLargerThanItsBound) {
  write(std::string(kMost + 1, 'x'));
  const auto large = read_regular_file(path_, kMost);
  ASSERT_FALSE(large);
  EXPECT_EQ(large.error().message().find(path_ + ": is larger than 4 KiB; "), 0U)
      << large.error().message();
}

TEST_F(ReadRegularFile, DoesNotWaitForAPipe) {
  ASSERT_EQ(::mkfifo(path_.c_str(), 0600), 0);
  const auto pipe = read_regular_file(path_, kMost);
  ASSERT_FALSE(pipe);
  EXPECT_EQ(pipe.error().what, "is a pipe, a socket or a device");
}

TEST_F(ReadRegularFile, RefusesADeviceAlsoBehindALink) {
  std::filesystem::create_symlink("/dev/zero", path_);
  EXPECT_EQ(read_regular_file(path_, kMost).error().what, "is a pipe, a socket or a device");
}

TEST_F(ReadRegularFile, SaysWhatElseIsInTheWay) {
  EXPECT_EQ(read_regular_file(path_, kMost).error().what,
            "cannot be read: No such file or directory");
  EXPECT_EQ(read_regular_file(folder_, kMost).error().what, "is a directory, not a file");
}

// A file in /proc reports size 0.
TEST_F(ReadRegularFile, BelievesTheBytesAndNotTheSizeThatTheFileTells) {
  const auto status = read_regular_file("/proc/self/status", 65'536);
  ASSERT_TRUE(status);
  EXPECT_NE(status->find("VmRSS"), std::string::npos);
  EXPECT_FALSE(read_regular_file("/proc/self/status", 100));
}

}  // namespace
}  // namespace vgyro

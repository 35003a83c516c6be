#include "base/file.h"

#include <array>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <string>
#include <unistd.h>

#include <gtest/gtest.h>

namespace vgyro {
namespace {

class ReadFile : public ::testing::Test {
 protected:
  ReadFile() {
    std::string pattern = ::testing::TempDir() + "vgyro_file_XXXXXX";
    folder_ = ::mkdtemp(pattern.data());
  }
  ~ReadFile() override { std::filesystem::remove_all(folder_); }

  std::string file_with(const std::string& bytes) {
    const std::string path = folder_ + "/file";
    std::ofstream(path, std::ios::binary) << bytes;
    return path;
  }

  std::string folder_;
};

// DBC files contain any bytes: none is translated, dropped or taken for an end.
TEST_F(ReadFile, ReturnsTheBytesAsTheyAre) {
  std::string bytes;
  for (int i = 0; i < 100'000; ++i)
    bytes += static_cast<char>(i * 7 % 256);
  bytes += "\r\n\x1A last line without an end";
  EXPECT_EQ(read_file(file_with(bytes)).value(), bytes);
}

// An empty file is a file with nothing in it, not an error.
TEST_F(ReadFile, ReadsAnEmptyFile) {
  EXPECT_EQ(read_file(file_with("")).value(), "");
}

// For a mistyped path the error names the path and the cause.
TEST_F(ReadFile, NamesTheFileThatIsMissing) {
  const std::string path = folder_ + "/missing.toml";
  const auto missing = read_file(path);
  ASSERT_FALSE(missing);
  EXPECT_EQ(missing.error().message(), path + ": cannot be read: No such file or directory");
}

// Opening a directory succeeds on Linux; its "bytes" would be a confusing error later.
TEST_F(ReadFile, RefusesADirectory) {
  const auto directory = read_file(folder_);
  ASSERT_FALSE(directory);
  EXPECT_EQ(directory.error().message(), folder_ + ": is a directory, not a file");
}

// The first pages of a process's memory are unmapped: the system opens the file and then fails in
// the middle of it. The bytes read until then are not the file.
TEST_F(ReadFile, TakesNoErrorForTheEnd) {
  const auto broken = read_file("/proc/self/mem");
  ASSERT_FALSE(broken);
  EXPECT_EQ(broken.error().message(),
            "/proc/self/mem: cannot be read to its end: Input/output error");
}

// `vgyro check <(generate)`: a file without a size is read to its end, but not beyond the limit.
TEST_F(ReadFile, ReadsPipesAndRefusesEndlessOnes) {
  std::array<int, 2> ends{};
  ASSERT_EQ(::pipe(ends.data()), 0);
  const std::string bytes(50'000, 'x');
  ASSERT_EQ(::write(ends[1], bytes.data(), bytes.size()), static_cast<ssize_t>(bytes.size()));
  ::close(ends[1]);
  EXPECT_EQ(read_file("/proc/self/fd/" + std::to_string(ends[0])).value(), bytes);
  ::close(ends[0]);
  const auto endless = read_file("/dev/zero");
  ASSERT_FALSE(endless);
  EXPECT_EQ(endless.error().message(), "/dev/zero: is larger than 64 MiB");
}

// A recording given by mistake instead of a configuration must not fill the memory.
TEST_F(ReadFile, RefusesMoreThan64MiBAndTakesExactlyThat) {
  constexpr std::uintmax_t kLimit = 64U << 20U;
  const std::string path = file_with("");
  std::filesystem::resize_file(path, kLimit + 1);
  const auto large = read_file(path);
  ASSERT_FALSE(large);
  EXPECT_EQ(large.error().message(), path + ": is larger than 64 MiB");
  std::filesystem::resize_file(path, kLimit);
  const auto just = read_file(path);
  ASSERT_TRUE(just) << just.error().message();
  EXPECT_EQ(just->size(), kLimit);
}

}  // namespace
}  // namespace vgyro

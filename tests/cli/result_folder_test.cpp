#include "cli/output/result_folder.h"

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>

#include <gtest/gtest.h>

#include "base/file.h"

namespace vgyro::cli {
namespace {

namespace fs = std::filesystem;

class ResultFolderTest : public testing::Test {
 protected:
  ResultFolderTest() {
    std::string name = testing::TempDir() + "vgyro-folder-XXXXXX";
    EXPECT_NE(::mkdtemp(name.data()), nullptr);
    root_ = name;
  }
  ~ResultFolderTest() override { fs::remove_all(root_); }

  [[nodiscard]] std::string at(const std::string& name) const { return root_ / name; }
  void put(const std::string& name, const std::string& text) const {
    std::ofstream(root_ / name) << text;
  }
  [[nodiscard]] std::ptrdiff_t entries() const {
    return std::distance(fs::directory_iterator(root_), fs::directory_iterator());
  }

  fs::path root_;
  const std::vector<ResultFile> files_{{"a.json", "{}"}, {"b.toml", "x = 1\n"}};
};

TEST_F(ResultFolderTest, WritesAllFilesAndLeavesNothingBeside) {
  // Parent folders are made; a trailing slash changes nothing.
  ASSERT_TRUE(write_result_folder(at("new/out/"), files_));
  EXPECT_EQ(read_file(at("new/out/a.json")).value(), "{}");
  EXPECT_EQ(read_file(at("new/out/b.toml")).value(), "x = 1\n");
  EXPECT_EQ(std::distance(fs::directory_iterator(root_ / "new"), fs::directory_iterator()), 1);
}

TEST_F(ResultFolderTest, ReplacesAnEarlierResultWhole) {
  // No file of an earlier result stays among those of the new one.
  ASSERT_TRUE(write_result_folder(at("out"), files_));
  ASSERT_TRUE(write_result_folder(at("out"), {{"a.json", "[]"}, {"b.toml", ""}}));
  EXPECT_EQ(read_file(at("out/a.json")).value(), "[]");
  EXPECT_EQ(read_file(at("out/b.toml")).value(), "");
  EXPECT_EQ(entries(), 1);
}

TEST_F(ResultFolderTest, TakesAnEmptyFolderAndFollowsALink) {
  fs::create_directory(at("real"));
  fs::create_directory_symlink("real", at("link"));
  ASSERT_TRUE(write_result_folder(at("link"), files_));
  EXPECT_TRUE(fs::is_symlink(at("link")));
  EXPECT_TRUE(fs::exists(at("real/a.json")));
}

TEST_F(ResultFolderTest, KeepsAFolderThatHoldsAnythingElse) {
  // The folder may contain a user's measurements.
  fs::create_directory(at("out"));
  put("out/a.json", "old");
  put("out/precious.log", "data");
  for (const auto& done : {check_result_folder(at("out"), {"a.json", "b.toml"}),
                           write_result_folder(at("out"), files_)}) {
    ASSERT_FALSE(done);
    EXPECT_NE(done.error().message().find("precious.log"), std::string::npos);
  }
  EXPECT_EQ(read_file(at("out/a.json")).value(), "old");
  EXPECT_EQ(read_file(at("out/precious.log")).value(), "data");
  EXPECT_EQ(entries(), 1);
}

TEST_F(ResultFolderTest, RefusesAFileAndAnEmptyName) {
  put("out", "a file");
  EXPECT_FALSE(check_result_folder(at("out"), {"a.json"}));
  EXPECT_FALSE(check_result_folder("", {"a.json"}));
  EXPECT_FALSE(check_result_folder(at("out/below/deeper"), {"a.json"}));
  EXPECT_FALSE(write_result_folder(at("out/below"), files_));
  EXPECT_TRUE(check_result_folder(at("not/there/yet"), {"a.json"}));
  EXPECT_EQ(read_file(at("out")).value(), "a file");
}

TEST_F(ResultFolderTest, LeavesNothingWhenAFileCannotBeWritten) {
  // An incomplete result would look complete.
  ASSERT_FALSE(write_result_folder(at("out"), {{"a.json", "{}"}, {"a.json/below", "x"}}));
  EXPECT_EQ(entries(), 0);
}

}  // namespace
}  // namespace vgyro::cli

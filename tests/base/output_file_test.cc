
#include <gtest/gtest.h>
#include <sys/resource.h>
#include <sys/stat.h>

#include <csignal>
#include <filesystem>
#include <fstream>

#include "base/text_file.h"

namespace joulecast {
namespace {

namespace fs = std::filesystem;

class OutputFileTest : public ::testing::Test {
 protected:
  OutputFileTest() {
    std::string pattern = (fs::temp_directory_path() / "joulecast-XXXXXX").string();
    folder_ = mkdtemp(pattern.data());
  }
  ~OutputFileTest() override { fs::remove_all(folder_); }

  std::string path(const char* name) const { return folder_ / name; }
  std::size_t files() const {
    return static_cast<std::size_t>(std::distance(fs::directory_iterator(folder_), fs::directory_iterator()));
  }

  fs::path folder_;
};

TEST_F(OutputFileTest, ReplacesFilesOnlyOnRequest) {
  EXPECT_TRUE(write_text_file(path("a"), "one", Existing::refuse));
  const auto refused = write_text_file(path("a"), "two", Existing::refuse);
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().fault, Fault::conflict);
  EXPECT_EQ(read_text_file(path("a")).value(), "one");
  chmod(path("a").c_str(), 0600);
  EXPECT_TRUE(write_text_file(path("a"), "three", Existing::replace));
  EXPECT_EQ(read_text_file(path("a")).value(), "three");
  EXPECT_EQ(fs::status(path("a")).permissions(), fs::perms(0600));
  EXPECT_EQ(files(), 1u);
}

TEST_F(OutputFileTest, LinksAreNotFollowed) {
  std::ofstream(path("victim")) << "victim";
  fs::create_symlink("victim", path("link"));
  fs::create_symlink("absent", path("dangling"));
  for (const char* link : {"link", "dangling"}) {
    const auto refused = write_text_file(path(link), "mine", Existing::refuse);
    ASSERT_FALSE(refused);
    EXPECT_EQ(refused.error().fault, Fault::conflict);
    EXPECT_NE(refused.error().message.find("symbolic link"), std::string::npos);
    EXPECT_TRUE(write_text_file(path(link), "mine", Existing::replace));
    EXPECT_FALSE(fs::is_symlink(path(link)));
    EXPECT_EQ(read_text_file(path(link)).value(), "mine");
  }
  EXPECT_EQ(read_text_file(path("victim")).value(), "victim");
  EXPECT_FALSE(fs::exists(path("absent")));
}

TEST_F(OutputFileTest, KeepsFilesThatAppear) {
  auto file = OutputFile::create(path("a"), Existing::refuse);
  ASSERT_TRUE(file);
  EXPECT_TRUE(file->write("mine"));
  EXPECT_FALSE(fs::exists(path("a")));
  std::ofstream(path("a")) << "theirs";
  const auto refused = file->commit();
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().fault, Fault::conflict);
  EXPECT_EQ(read_text_file(path("a")).value(), "theirs");
  EXPECT_EQ(files(), 1u);
}

TEST_F(OutputFileTest, IncompleteWritesKeepOldFile) {
  std::ofstream(path("a")) << "old";
  { EXPECT_TRUE(OutputFile::create(path("a"), Existing::replace)->write("given up")); }
  std::signal(SIGXFSZ, SIG_IGN);
  rlimit before{};
  getrlimit(RLIMIT_FSIZE, &before);
  const rlimit small{1000, before.rlim_max};
  setrlimit(RLIMIT_FSIZE, &small);
  const auto written = write_text_file(path("a"), std::string(5000, 'x'), Existing::replace);
  setrlimit(RLIMIT_FSIZE, &before);
  ASSERT_FALSE(written);
  EXPECT_EQ(written.error().fault, Fault::unavailable);
  EXPECT_EQ(read_text_file(path("a")).value(), "old");
  EXPECT_EQ(files(), 1u);
  EXPECT_EQ(write_text_file(path("no/such/folder"), "x", Existing::refuse).error().fault, Fault::unavailable);
}

TEST_F(OutputFileTest, DevicesAreWrittenDirectly) {
  EXPECT_TRUE(write_text_file("/dev/null", "x", Existing::refuse));
  EXPECT_TRUE(fs::is_character_file("/dev/null"));
  const auto full = write_text_file("/dev/full", "x", Existing::refuse);
  ASSERT_FALSE(full);
  EXPECT_EQ(full.error().fault, Fault::unavailable);
}

}  // namespace
}  // namespace joulecast

#include "base/text_file.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>

namespace joulecast {
namespace {

class TextFile : public ::testing::Test {
 protected:
  TextFile() { std::filesystem::create_directory(folder_); }
  ~TextFile() override { std::filesystem::remove_all(folder_); }

  std::filesystem::path folder_ =
      std::filesystem::temp_directory_path() / ("joulecast-text-file-" + std::to_string(::getpid()));
};

TEST_F(TextFile, IsReadByteForByte) {
  const std::string text("a\0b\r\n", 5);
  std::ofstream(folder_ / "file", std::ios::binary) << text;
  std::ofstream(folder_ / "empty", std::ios::binary).flush();
  EXPECT_EQ(read_text_file(folder_ / "file").value(), text);
  EXPECT_EQ(read_text_file(folder_ / "empty").value(), "");
}

TEST_F(TextFile, DistinguishesAbsentFromUnreadable) {
  EXPECT_EQ(read_text_file(folder_ / "absent").error().fault, Fault::not_found);
  EXPECT_EQ(read_text_file(folder_).error().fault, Fault::invalid);
  std::filesystem::create_symlink("itself", folder_ / "itself");
  const auto endless = read_text_file(folder_ / "itself");
  ASSERT_FALSE(endless);
  EXPECT_EQ(endless.error().fault, Fault::unavailable);
  EXPECT_NE(endless.error().message.find("cannot be opened: "), std::string::npos);
}

TEST_F(TextFile, RejectsLargeAndEndlessFiles) {
  std::ofstream(folder_ / "file", std::ios::binary) << std::string(1 << 20, 'x');
  EXPECT_EQ(read_text_file(folder_ / "file", 1 << 20).value().size(), std::size_t{1} << 20);
  EXPECT_EQ(read_text_file(folder_ / "file", (1 << 20) - 1).error().fault, Fault::too_large);
  EXPECT_EQ(read_text_file("/dev/zero").error().fault, Fault::too_large);
}

}  // namespace
}  // namespace joulecast

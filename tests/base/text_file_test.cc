#include "base/text_file.h"

#include <gtest/gtest.h>
#include <sys/stat.h>
#include <unistd.h>

#include <filesystem>
#include <fstream>
#include <optional>

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

TEST_F(TextFile, RejectsPipesWithoutWaiting) {
  ASSERT_EQ(mkfifo((folder_ / "pipe").c_str(), 0600), 0);
  EXPECT_EQ(read_text_file(folder_ / "pipe").error().fault, Fault::invalid);
}

TEST_F(TextFile, LimitsLengthOfLines) {
  constexpr std::size_t most = 100'000;  // more than one block of reading
  const auto fault_of = [&](const std::string& text) {
    std::ofstream(folder_ / "file", std::ios::binary) << text;
    const auto read = read_text_file(folder_ / "file", max_text_file_bytes, most);
    EXPECT_EQ(read.value_or(text), text);
    return read ? std::nullopt : std::optional(read.error().fault);
  };
  std::string lines;
  for (int k = 0; k < 5; ++k) lines.append(most - 1, 'x').append(1, '\n');
  EXPECT_EQ(fault_of(lines), std::nullopt);
  EXPECT_EQ(fault_of(lines.append(3 * most, 'x')), Fault::too_large);
  EXPECT_EQ(read_text_file("/dev/zero", max_text_file_bytes, most).error().fault, Fault::too_large);
}

}  // namespace
}  // namespace joulecast

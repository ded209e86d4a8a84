#include "client/progress.h"

#include <gtest/gtest.h>

namespace joulecast::client {
namespace {

TEST(ProgressLine, ShowsBarAndRemainingTime) {
  const auto line = progress_line("replaying", "messages", 250, 1000, 10, 200);
  EXPECT_EQ(line, "replaying [======                  ]  25 %  250 of 1000 messages, 30 s left");
  EXPECT_EQ(progress_line("diagnosing", "%", 25, 100, 10, 200),
            "diagnosing [======                  ]  25 %, 30 s left");
}

TEST(ProgressLine, ShowsRateWithoutTotal) {
  EXPECT_EQ(progress_line("importing", "rows", 5000, 0, 2, 200), "importing 5000 rows, 2500 a second");
}

TEST(ProgressLine, PrintsMinutesAndHours) {
  EXPECT_NE(progress_line("w", "u", 50, 100, 90, 200).find("1:30 min left"), std::string::npos);
  EXPECT_NE(progress_line("w", "u", 50, 100, 7260, 200).find("2:01 h left"), std::string::npos);
}

TEST(ProgressLine, NeverFillsTheLastColumn) {
  EXPECT_EQ(progress_line("replaying", "messages", 250, 1000, 10, 20).size(), 19U);
}

TEST(ProgressLine, StopsAtTheTotal) {
  const auto line = progress_line("w", "u", 120, 100, 10, 200);
  EXPECT_NE(line.find("100 %"), std::string::npos);
  EXPECT_EQ(line.find("left"), std::string::npos);
}

}  // namespace
}  // namespace joulecast::client

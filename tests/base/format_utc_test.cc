#include "base/format_utc.h"

#include <gtest/gtest.h>

namespace joulecast {
namespace {

TEST(FormatUtc, IsTheDateOfTheSecondThatHasBegun) {
  EXPECT_EQ(format_utc(0), "1970-01-01 00:00");
  EXPECT_EQ(format_utc(1'795'365'900'000'000), "2026-11-22 16:45");
  EXPECT_EQ(format_utc(1'795'365'959'999'999, "%y%m%d-%H%M%S"), "261122-164559");
  EXPECT_EQ(format_utc(-1, "%Y-%m-%d %H:%M:%S"), "1969-12-31 23:59:59");
}

}  // namespace
}  // namespace joulecast

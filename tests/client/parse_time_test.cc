#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "client/commands/option.h"

namespace joulecast::client {
namespace {

using ::testing::HasSubstr;

constexpr std::int64_t hour_us = 3'600'000'000, day_us = 24 * hour_us;
constexpr std::int64_t midnight_us = 1'795'132'800'000'000;  // of 2026-11-20, by date(1)

TEST(ParseTime, ParsesDatesTimesAndMicroseconds) {
  EXPECT_EQ(parse_time("2026-11-20", "--from").value(), midnight_us);
  EXPECT_EQ(parse_time("2026-11-20T01:00:00Z", "--from").value(), midnight_us + hour_us);
  EXPECT_EQ(parse_time("17", "--from").value(), 17);
}

TEST(ParseTime, EndDayIsIncluded) {
  EXPECT_EQ(parse_end_time("2026-11-20", "--to").value(), midnight_us + day_us);
  EXPECT_EQ(parse_end_time("2026-11-20T00:00:00Z", "--to").value(), midnight_us);
  EXPECT_EQ(parse_end_time("1795132800000000", "--to").value(), midnight_us);
}

TEST(ParseTime, RejectsInvalidTimes) {
  EXPECT_EQ(describe(parse_time("2026-02-30", "--from").error()), "--from: there is no day 2026-02-30");
  EXPECT_EQ(describe(parse_time("2026-13-01T00:00:00Z", "--from").error()),
            "--from: there is no day 2026-13-01");
  EXPECT_THAT(describe(parse_end_time("2026-11-20 25:00", "--to").error()),
              HasSubstr("a time with its zone"));
}

}  // namespace
}  // namespace joulecast::client

#include "base/utc_time.h"

#include <gtest/gtest.h>

namespace joulecast {
namespace {

constexpr std::int64_t at = 1'795'365'900'000'000;  // 2026-11-22T16:45:00Z

TEST(UtcTime, ReadsItsForms) {
  constexpr std::int64_t midnight = at - (16 * 60 + 45) * 60'000'000LL;
  EXPECT_EQ(parse_utc("2026-11-22"), midnight);
  EXPECT_EQ(parse_utc("2026-11-22T16:45Z"), at);
  EXPECT_EQ(parse_utc("2026-11-22T16:45:00Z"), at);
  EXPECT_EQ(parse_utc("2026-11-22T16:45:00.25Z"), at + 250'000);
  EXPECT_EQ(parse_utc("2026-11-22T16:45:00.0000019Z"), at + 1);
  EXPECT_EQ(parse_utc("2026-11-22T17:45:00+01:00"), at);
  EXPECT_EQ(parse_utc("2026-11-22T11:15:00-05:30"), at);
  EXPECT_EQ(parse_utc("1970-01-01"), 0);
  EXPECT_EQ(parse_utc("1969-12-31T23:59:59Z"), -1'000'000);
}

TEST(UtcTime, EndOfDateIncludesDay) {
  EXPECT_EQ(parse_utc_end("2026-11-22"), parse_utc("2026-11-23"));
  EXPECT_EQ(parse_utc_end("2026-11-22T16:45Z"), at);
  EXPECT_EQ(parse_utc_end("yesterday"), std::nullopt);
}

TEST(UtcTime, RejectsOtherForms) {
  for (const char* text :
       {"", "2026", "2026-11", "2026-13-01", "2026-02-30", "2026-11-22T", "2026-11-22T16:45",
        "2026-11-22 16:45Z", "2026-11-22T24:00Z", "2026-11-22T16:45:00", "2026-11-22T16:45:00.Z",
        "2026-11-22T16:45:00ZZ", "2026-11-22T16:45:00+1", "-026-11-22", "1795365900000000", "yesterday"})
    EXPECT_EQ(parse_utc(text), std::nullopt) << text;
}

TEST(UtcTime, TextReadsBack) {
  EXPECT_EQ(utc_text(at), "2026-11-22T16:45:00Z");
  EXPECT_EQ(utc_text(at + 250'000), "2026-11-22T16:45:00.25Z");
  EXPECT_EQ(utc_text(0), "1970-01-01T00:00:00Z");
  for (const std::int64_t t : {at + 1, std::int64_t{-1}, std::int64_t{10}, at + 999'990})
    EXPECT_EQ(parse_utc(utc_text(t)), t) << utc_text(t);
}

TEST(UtcTime, RoundsDownToSeconds) {
  EXPECT_EQ(format_utc(0), "1970-01-01 00:00");
  EXPECT_EQ(format_utc(1'795'365'900'000'000), "2026-11-22 16:45");
  EXPECT_EQ(format_utc(1'795'365'959'999'999, "%y%m%d-%H%M%S"), "261122-164559");
  EXPECT_EQ(format_utc(-1, "%Y-%m-%d %H:%M:%S"), "1969-12-31 23:59:59");
}

}  // namespace
}  // namespace joulecast

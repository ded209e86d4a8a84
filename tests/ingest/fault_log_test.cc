#include <gtest/gtest.h>

#include "ingest/robot_session.h"

namespace joulecast::ingest {
namespace {

TEST(FaultLog, LogsKindsEveryTenMinutes) {
  FaultLog log;
  const std::int64_t start_us = 1'700'000'000'000'000, minute_us = 60'000'000;
  EXPECT_EQ(log.add(IngestFault::late, 2, "came late", start_us), "late: came late (2 so far)");
  EXPECT_EQ(log.add(IngestFault::gap, 1, "nothing came", start_us), "gap: nothing came (1 so far)");
  EXPECT_EQ(log.add(IngestFault::late, 3, "came late", start_us + 9 * minute_us), std::nullopt);
  EXPECT_EQ(log.add(IngestFault::late, 1, "came late", start_us + 10 * minute_us),
            "late: came late (4 since this was last logged)");
}

}  // namespace
}  // namespace joulecast::ingest

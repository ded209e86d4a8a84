#include <gtest/gtest.h>

#include "ingest/robot_session.h"

namespace joulecast::ingest {
namespace {

constexpr std::int64_t allowance_start_us = 1'700'000'000'000'000, second_us = 1'000'000;

int spent_at_once(EventAllowance& allowance, std::int64_t utime_us) {
  int spent = 0;
  while (allowance.spend(utime_us)) ++spent;
  return spent;
}

TEST(EventAllowance, AllowsBurstThenRate) {
  EventAllowance allowance(5);
  EXPECT_EQ(spent_at_once(allowance, allowance_start_us), 100);
  EXPECT_EQ(spent_at_once(allowance, allowance_start_us + second_us), 5);
  EXPECT_EQ(spent_at_once(allowance, allowance_start_us + 1000 * second_us), 100);
}

TEST(EventAllowance, IsEarnedBySamplesToo) {
  EventAllowance allowance(5);
  (void)spent_at_once(allowance, allowance_start_us);
  for (int sample = 0; sample < 51; ++sample) allowance.earn_by_sample();
  EXPECT_EQ(spent_at_once(allowance, allowance_start_us), 10);
}

TEST(EventAllowance, ClockStepBackEarnsNothing) {
  EventAllowance allowance(5);
  (void)spent_at_once(allowance, allowance_start_us);
  EXPECT_FALSE(allowance.spend(allowance_start_us - 10 * second_us));
}

}  // namespace
}  // namespace joulecast::ingest

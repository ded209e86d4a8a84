#include <gtest/gtest.h>

#include <cmath>

#include "ingest/open_mission.h"

namespace joulecast::ingest {
namespace {

energy::MeterPoint point(std::int64_t utime_us, double interval_s, double power_w) {
  energy::MeterPoint p;
  p.sample.utime_us = utime_us;
  p.interval_s = interval_s;
  p.measured_power_w = power_w;
  p.modelled_power_w = 2 * power_w;
  p.speed_m_s = 0.5;
  return p;
}

TEST(TraceBuilder, WeighsTheMeanByTime) {
  TraceBuilder trace;
  trace.begin();
  trace.add(point(5'000'000, 0, 10), {}, 0.5);
  trace.add(point(5'100'000, 0.1, 20), {}, 0.5);
  trace.add(point(5'400'000, 0.3, 40), {}, 0.5);
  const auto buckets = trace.take();
  ASSERT_EQ(buckets.size(), 1u);
  EXPECT_EQ(buckets[0].start_utime_us, 5'000'000);
  EXPECT_DOUBLE_EQ(buckets[0].covered_s, 0.4);
  EXPECT_DOUBLE_EQ(buckets[0].measured_power_w.mean, (20 * 0.1 + 40 * 0.3) / 0.4);
  EXPECT_DOUBLE_EQ(buckets[0].measured_power_w.min, 10);
  EXPECT_DOUBLE_EQ(buckets[0].measured_power_w.max, 40);
  EXPECT_TRUE(std::isnan(buckets[0].x_m));
  EXPECT_EQ(buckets[0].state_of_charge, 0.5);
}

TEST(TraceBuilder, ReturnsGrownBucketsAgain) {
  TraceBuilder trace;
  trace.begin();
  trace.add(point(1'000'000, 0, 1), {}, 0.5);
  EXPECT_EQ(trace.take().size(), 1u);
  EXPECT_TRUE(trace.take().empty());
  trace.add(point(1'500'000, 0.5, 3), {}, 0.5);
  trace.add(point(2'000'000, 0.5, 5), {}, 0.5);
  const auto buckets = trace.take();
  ASSERT_EQ(buckets.size(), 2u);
  EXPECT_DOUBLE_EQ(buckets[0].covered_s, 0.5);
  EXPECT_EQ(buckets[1].start_utime_us, 2'000'000);
}

}  // namespace
}  // namespace joulecast::ingest

#include "history/trace_merge.h"

#include <gtest/gtest.h>
#include <rapidcheck/gtest.h>

#include <cmath>
#include <limits>

namespace joulecast::history {
namespace {

TraceBucket bucket(std::int64_t second, double covered_s, Band power_w) {
  TraceBucket b;
  b.start_utime_us = second * trace_bucket_us;
  b.covered_s = covered_s;
  b.measured_power_w = power_w;
  return b;
}

TEST(TraceMerge, MergesLeastMeanAndGreatest) {
  TraceMerger merger(10 * trace_bucket_us, 2 * trace_bucket_us);
  merger.add(bucket(10, 1.0, {1, 2, 3}));
  merger.add(bucket(11, 0.25, {-5, 7, 9}));
  merger.add(bucket(12, 1.0, {4, 4, 4}));
  const Trace trace = merger.finish();
  EXPECT_EQ(trace.width_us, 2 * trace_bucket_us);
  ASSERT_EQ(trace.buckets.size(), 2U);
  EXPECT_EQ(trace.buckets[0].start_utime_us, 10 * trace_bucket_us);
  EXPECT_EQ(trace.buckets[0].covered_s, 1.25);
  EXPECT_EQ(trace.buckets[0].measured_power_w.min, -5);
  EXPECT_EQ(trace.buckets[0].measured_power_w.max, 9);
  // Exact: all numbers are dyadic.
  EXPECT_EQ(trace.buckets[0].measured_power_w.mean, (1.0 * 2 + 0.25 * 7) / 1.25);
  EXPECT_EQ(trace.buckets[1].start_utime_us, 12 * trace_bucket_us);
  EXPECT_EQ(trace.buckets[1].measured_power_w.mean, 4);
}

TEST(TraceMerge, SkipsUnmeasuredValues) {
  TraceMerger merger(0, 4 * trace_bucket_us);
  TraceBucket known = bucket(0, 1.0, {1, 2, 3});
  known.state_of_charge = 0.5;
  known.measured_j = 100;
  merger.add(known);
  merger.add(bucket(1, 1.0, {}));
  const Trace trace = merger.finish();
  ASSERT_EQ(trace.buckets.size(), 1U);
  const TraceBucket& b = trace.buckets[0];
  EXPECT_EQ(b.measured_power_w.mean, 2);
  EXPECT_EQ(b.state_of_charge, 0.5);
  EXPECT_EQ(b.measured_j, 100);
  EXPECT_TRUE(std::isnan(b.speed_m_s.min) && std::isnan(b.speed_m_s.mean) && std::isnan(b.speed_m_s.max));
  EXPECT_TRUE(std::isnan(b.x_m));
}

TEST(TraceMerge, ShowsBucketsWithoutDuration) {
  TraceMerger merger(0, trace_bucket_us);
  merger.add(bucket(0, 0.0, {5, 5, 5}));
  const Trace trace = merger.finish();
  ASSERT_EQ(trace.buckets.size(), 1U);
  EXPECT_EQ(trace.buckets[0].covered_s, 0.0);
  EXPECT_DOUBLE_EQ(trace.buckets[0].measured_power_w.mean, 5);
}

TEST(TraceMerge, GivesNothingForNothing) {
  EXPECT_TRUE(TraceMerger(0, trace_bucket_us).finish().buckets.empty());
}

RC_GTEST_PROP(TraceMerge, KeepsEnergyAndExtremes, ()) {
  const auto seconds = *rc::gen::inRange<std::int64_t>(1, 300);
  const auto points = *rc::gen::inRange<std::int64_t>(1, 50);
  const std::int64_t first = *rc::gen::inRange<std::int64_t>(-1000, 1000) * trace_bucket_us;
  TraceMerger merger(first, merged_width_us(first, first + seconds * trace_bucket_us, points));
  double energy_j = 0;
  double greatest_w = -std::numeric_limits<double>::infinity();
  for (std::int64_t s = 0; s < seconds; ++s) {
    const double power_w = *rc::gen::inRange(-500, 500);
    const double covered_s = *rc::gen::inRange(1, 9) / 8.0;
    energy_j += power_w * covered_s;
    greatest_w = std::max(greatest_w, power_w + 1);
    merger.add(bucket(first / trace_bucket_us + s, covered_s, {power_w - 1, power_w, power_w + 1}));
  }
  const Trace trace = merger.finish();
  RC_ASSERT(static_cast<std::int64_t>(trace.buckets.size()) <= points);
  double merged_j = 0;
  double merged_greatest_w = -std::numeric_limits<double>::infinity();
  for (const TraceBucket& b : trace.buckets) {
    merged_j += b.measured_power_w.mean * b.covered_s;
    merged_greatest_w = std::max(merged_greatest_w, b.measured_power_w.max);
  }
  // Every sum is exact (eighths below 2^53); only the division and the product back round, each by half an
  // ulp of at most 500 W * 300 s.
  const double rounding_j =
      static_cast<double>(trace.buckets.size()) * 4 * std::numeric_limits<double>::epsilon() * 500 * 300;
  RC_ASSERT(std::abs(merged_j - energy_j) <= rounding_j);
  RC_ASSERT(merged_greatest_w == greatest_w);
}

TEST(TraceMerge, ChoosesTheLeastWidth) {
  EXPECT_EQ(merged_width_us(0, 1, 1), trace_bucket_us);
  EXPECT_EQ(merged_width_us(0, 10 * trace_bucket_us, 10), trace_bucket_us);
  EXPECT_EQ(merged_width_us(0, 10 * trace_bucket_us + 1, 10), 2 * trace_bucket_us);
  EXPECT_EQ(merged_width_us(-5 * trace_bucket_us, 5 * trace_bucket_us, 3), 4 * trace_bucket_us);
  EXPECT_GT(
      merged_width_us(std::numeric_limits<std::int64_t>::min(), std::numeric_limits<std::int64_t>::max(), 4),
      0);
}

}  // namespace
}  // namespace joulecast::history

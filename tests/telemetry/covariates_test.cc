#include <gtest/gtest.h>

#include <cmath>

#include "telemetry/codec.h"
#include "telemetry/covariate_tracker.h"
#include "telemetry/log_recordings.h"
#include "telemetry/validation.h"
#include "temporary_file.h"

namespace joulecast::telemetry {
namespace {

using Verdict = CovariateTracker::Verdict;

Verdict take(CovariateTracker& tracker, std::int64_t utime_us, const std::string& name, double value) {
  signals::CovariateChange change;
  return tracker.take(utime_us, {name, value}, change);
}

TEST(Covariates, ReportsOnlyChanges) {
  CovariateTracker tracker;
  signals::CovariateChange change;
  EXPECT_EQ(tracker.take(10, {"load", 0.5}, change), Verdict::news);
  EXPECT_EQ(change.utime_us, 10);
  EXPECT_EQ(change.name, "load");
  EXPECT_EQ(change.value, 0.5);
  EXPECT_EQ(take(tracker, 20, "load", 0.5), Verdict::repeat);
  EXPECT_EQ(take(tracker, 15, "load", 0.7), Verdict::late);  // 0.5 was repeated at 20
  EXPECT_EQ(take(tracker, 20, "load", 0.7), Verdict::late);
  EXPECT_EQ(take(tracker, 30, "load", signals::unmeasured), Verdict::news);
  EXPECT_EQ(take(tracker, 40, "load", signals::unmeasured), Verdict::repeat);
  EXPECT_EQ(take(tracker, 40, "heater", signals::unmeasured), Verdict::repeat);  // it had no value
  EXPECT_EQ(take(tracker, 50, "load", 0.7), Verdict::news);
}

TEST(Covariates, EarlierClockIsNotLate) {
  CovariateTracker tracker;
  EXPECT_EQ(take(tracker, 3'600'000'000, "load", 0.5), Verdict::news);
  EXPECT_EQ(take(tracker, 3'596'000'000, "load", 0.6), Verdict::late);
  EXPECT_EQ(take(tracker, 1'000'000, "load", 0.7), Verdict::news);
  EXPECT_EQ(take(tracker, 2'000'000, "load", 0.8), Verdict::news);
}

TEST(Covariates, PersistAcrossMissions) {
  CovariateTracker tracker;
  take(tracker, 10, "load", 0.5);
  take(tracker, 10, "floor=ice", 1);
  take(tracker, 10, "floor=grip", 0);
  take(tracker, 10, "heater", 3);
  take(tracker, 20, "heater", signals::unmeasured);
  const auto held = tracker.begin_mission(100);
  ASSERT_EQ(held.size(), 2u);  // unknown values and inactive labels are discarded
  EXPECT_EQ(held[0].name, "floor=ice");
  EXPECT_EQ(held[1].name, "load");
  EXPECT_EQ(held[1].value, 0.5);
  EXPECT_EQ(held[1].utime_us, 100);
  // Late values from before the start take effect at the start.
  signals::CovariateChange change;
  EXPECT_EQ(tracker.take(50, {"load", 0.6}, change), Verdict::news);
  EXPECT_EQ(change.utime_us, 100);
}

TEST(Covariates, NewestLabelOfQuantityHolds) {
  CovariateTracker tracker;
  EXPECT_EQ(tracker.label_of("map"), "");
  take(tracker, 10, "map=yard", 1);
  take(tracker, 10, "mapping=on", 1);
  EXPECT_EQ(tracker.label_of("map"), "yard");
  take(tracker, 20, "map=hall", 1);
  EXPECT_EQ(tracker.label_of("map"), "hall");
  take(tracker, 30, "map=hall", 0);
  EXPECT_EQ(tracker.label_of("map"), "yard");
  take(tracker, 40, "map=yard", signals::unmeasured);
  EXPECT_EQ(tracker.label_of("map"), "");
}

TEST(Covariates, BoundsNames) {
  CovariateTracker tracker;
  for (std::size_t k = 0; k < signals::max_covariates; ++k)
    EXPECT_EQ(take(tracker, 1, "c" + std::to_string(k), 1), Verdict::news);
  EXPECT_EQ(take(tracker, 1, "more", 1), Verdict::no_room);
  EXPECT_EQ(take(tracker, 2, "c0", 2), Verdict::news);
  EXPECT_EQ(take(tracker, 3, "c0", signals::unmeasured), Verdict::news);
  EXPECT_EQ(take(tracker, 4, "more", 1), Verdict::no_room);  // c0 counts in this mission
  tracker.begin_mission(5);
  EXPECT_EQ(take(tracker, 6, "more", 1), Verdict::news);
}

TEST(Covariates, ContinueAfterRestart) {
  CovariateTracker tracker;
  tracker.resume(100, std::vector<signals::CovariateChange>{{150, "load", 0.5}});
  EXPECT_EQ(take(tracker, 160, "load", 0.5), Verdict::repeat);
  EXPECT_EQ(take(tracker, 170, "load", 0.6), Verdict::news);
  signals::CovariateChange change;
  EXPECT_EQ(tracker.take(90, {"heater", 1}, change), Verdict::news);
  EXPECT_EQ(change.utime_us, 100);
}

TEST(Covariates, AcceptsFiniteNumbersAndLabels) {
  EXPECT_FALSE(check_plausible(signals::Covariate{"load", -1e300}));
  EXPECT_FALSE(check_plausible(signals::Covariate{"load", signals::unmeasured}));
  EXPECT_EQ(check_plausible(signals::Covariate{"load", INFINITY})->why, Implausibility::infinite);
  EXPECT_FALSE(check_plausible(signals::Covariate{"floor=ice", 0}));
  EXPECT_FALSE(check_plausible(signals::Covariate{"floor=ice", 1}));
  EXPECT_FALSE(check_plausible(signals::Covariate{"floor=ice", signals::unmeasured}));
  const auto half = check_plausible(signals::Covariate{"floor=ice", 0.5});
  ASSERT_TRUE(half);
  EXPECT_EQ(half->why, Implausibility::out_of_range);
  EXPECT_EQ(describe(*half), "value of a label is neither 0 nor 1");
  EXPECT_EQ(check_plausible(signals::CovariateMessage{-1, {}})->why, Implausibility::bad_clock);
}

Recording with_covariates(const std::string& mission, std::int64_t start_utime_us,
                          std::vector<signals::CovariateSeries> covariates) {
  Recording made{"a", mission, signals::unmeasured, {}};
  for (int k = 0; k < 5; ++k) {
    made.samples.emplace_back();
    made.samples.back().utime_us = start_utime_us + 100'000 * k;
    made.samples.back().sequence = k;
  }
  made.covariates = std::move(covariates);
  return made;
}

TEST(Covariates, RecordingRoundTripsThroughLog) {
  const test::TemporaryFile file;
  auto log = EventLogWriter::create(file.path());
  ASSERT_TRUE(log);
  const std::vector<Recording> written{
      with_covariates(
          "m-1", 1'000'000,
          {{"load", {1'000'000, 1'150'000, 1'400'000}, {0.5, 0.75, 1.5}}, {"floor=ice", {1'200'000}, {1}}}),
      with_covariates("m-2", 2'000'000, {{"load", {2'200'000}, {1.5}}}),
      with_covariates("m-3", 3'000'000, {})};
  for (const Recording& r : written) ASSERT_TRUE(write_recording(*log, r));
  ASSERT_TRUE(log->close());

  const auto read = read_recordings({&file.path(), 1});
  ASSERT_TRUE(read) << describe(read.error());
  EXPECT_EQ(read->unreadable, 0u);
  ASSERT_EQ(read->recordings.size(), written.size());
  for (std::size_t k = 0; k < written.size(); ++k) {
    const auto &a = read->recordings[k].covariates, &b = written[k].covariates;
    ASSERT_EQ(a.size(), b.size()) << k;
    for (std::size_t i = 0; i < a.size(); ++i) {
      EXPECT_EQ(a[i].name, b[i].name);
      EXPECT_EQ(a[i].utime_us, b[i].utime_us);
      EXPECT_EQ(a[i].value, b[i].value);
    }
  }
}

TEST(Covariates, CountsInvalidCovariatesInLogs) {
  const test::TemporaryFile file;
  auto log = EventLogWriter::create(file.path());
  ASSERT_TRUE(log);
  const Recording recording = with_covariates("m-1", 1'000'000, {});
  const auto put = [&](std::int64_t utime_us, std::vector<signals::Covariate> covariates) {
    const auto bytes = encode_covariates("a", {utime_us, std::move(covariates)});
    ASSERT_TRUE(bytes);
    ASSERT_TRUE(log->write(utime_us, channel_of(Subject::covariates, "a"), *bytes));
  };
  put(900'000, {{"load", 0.5}});  // before the mission: it stays in force
  ASSERT_TRUE(log->write(0, "ROBOT_COVARIATES.a", std::vector<std::uint8_t>{1, 2, 3}));
  put(950'000, {{"load", 0.6}, {"floor=ice", 0.5}, {"heater", INFINITY}});
  put(940'000, {{"load", 0.7}});
  ASSERT_TRUE(write_recording(*log, recording));
  ASSERT_TRUE(log->close());
  const auto read = read_recordings({&file.path(), 1});
  ASSERT_TRUE(read);
  EXPECT_EQ(read->unreadable, 4u);
  ASSERT_EQ(read->recordings.size(), 1u);
  ASSERT_EQ(read->recordings[0].covariates.size(), 1u);
  EXPECT_EQ(read->recordings[0].covariates[0].value, std::vector<double>{0.6});
  EXPECT_EQ(read->recordings[0].covariates[0].utime_us, std::vector<std::int64_t>{1'000'000});
}

}  // namespace
}  // namespace joulecast::telemetry

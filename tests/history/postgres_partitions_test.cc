// Partitions by time: made ahead of need, dropped when they are past, and no sample is without a place.

#include "history/postgres_partitions.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "history/mission_days.h"
#include "history/postgres.h"
#include "history/postgres_store.h"
#include "postgres_server.h"

namespace joulecast::history {
namespace {

using ::testing::ElementsAre;

constexpr std::int64_t second_us = 1'000'000;

class PostgresPartitionsTest : public ::testing::Test {
 protected:
  void SetUp() override { reopen(); }
  void reopen() {
    store_.reset();
    PostgresOptions options;
    options.url = postgres_url(folder_);
    options.now_utime_us = [this] { return now_utime_us_; };
    store_ = need(open_postgres_store(options));
  }
  Outcome apply(const Command& command) { return apply_one(*store_, command); }
  std::string ask(const std::string& sql) const { return as_administrator(folder_, sql); }

  std::vector<std::string> partitions(const std::string& table) const {
    PostgresDatabase database(postgres_url(folder_), "test");
    const auto select = database.prepare(
        "SELECT relname::text FROM pg_class JOIN pg_inherits ON inhrelid = oid WHERE inhparent = "
        "to_regclass(?) "
        "AND relname ~ '[0-9]$' ORDER BY 1");
    Rows rows(*select);
    rows.bind(table);
    std::vector<std::string> all;
    while (rows.next()) all.push_back(rows.text());
    return all;
  }

  // An ended mission of that time with a trace of five seconds and one sealed chunk.
  Mission add_mission(const std::string& name, std::int64_t start_utime_us) {
    Mission m = start_mission(*store_, "amr-1", name, start_utime_us);
    m.state = MissionState::finished;
    m.end_utime_us = start_utime_us + 5 * second_us;
    std::vector<TraceBucket> trace(5);
    for (std::size_t k = 0; k < trace.size(); ++k)
      trace[k].start_utime_us = start_utime_us + static_cast<std::int64_t>(k) * second_us;
    need(apply(CheckpointMission{m, trace, some_samples(start_utime_us, 0, 10), {}}));
    return m;
  }

  TemporaryFolder folder_;
  std::int64_t now_utime_us_ = 20'650 * day_us + 5 * 3600 * second_us;  // 2026-07-16, a Thursday
  std::unique_ptr<Store> store_;
};

TEST_F(PostgresPartitionsTest, AreMadeAheadOfNeed) {
  EXPECT_THAT(partitions("telemetry_chunk"),
              ElementsAre("telemetry_chunk_20260716", "telemetry_chunk_20260717", "telemetry_chunk_20260718",
                          "telemetry_chunk_20260719"));
  EXPECT_THAT(partitions("trace"), ElementsAre("trace_20260716"));
  // By the daemon as it writes, also after a leap of the clock.
  now_utime_us_ += 2 * day_us;
  need(apply(AppendEvent{{0, 1, "", "test", "{}"}}));
  EXPECT_EQ(partitions("telemetry_chunk").back(), "telemetry_chunk_20260721");
  now_utime_us_ += 30 * day_us;
  add_mission("m", now_utime_us_);
  EXPECT_EQ(partitions("telemetry_chunk").back(), "telemetry_chunk_20260820");
  EXPECT_EQ(ask("SELECT count(*)::text FROM trace_20260813"), "5");
  EXPECT_EQ(ask("SELECT count(*)::text FROM telemetry_chunk_20260817"), "1");
}

TEST_F(PostgresPartitionsTest, StoresSamplesWithOddTimes) {
  for (const std::int64_t odd :
       {std::int64_t{0}, -40 * day_us, 60'000 * day_us, now_utime_us_ - 400 * day_us}) {
    const Mission m = add_mission("at " + std::to_string(odd), odd);
    EXPECT_EQ(need(store_->trace(m.key, {}, 100)).buckets.size(), 5u);
    EXPECT_EQ(need(store_->telemetry(m.key, {}, {100, {}})).samples.size(), 10u);
  }
  EXPECT_EQ(ask("SELECT count(*)::text FROM trace_other"), "20");
  // The daemon's own clock may be off as well.
  now_utime_us_ = -day_us;
  add_mission("before 1970", 0);
  EXPECT_EQ(ask("SELECT count(*)::text FROM telemetry_chunk_other"), "1");
}

TEST_F(PostgresPartitionsTest, MovesRowsToTheirPartition) {
  const Mission m = add_mission("ahead", now_utime_us_ + 20 * day_us);
  EXPECT_EQ(ask("SELECT count(*)::text FROM trace_other"), "5");
  now_utime_us_ += 18 * day_us;
  need(apply(AppendEvent{{0, 1, "", "test", "{}"}}));
  EXPECT_EQ(ask("SELECT count(*)::text FROM trace_other"), "0");
  EXPECT_EQ(ask("SELECT count(*)::text FROM trace_20260730"), "5");
  EXPECT_EQ(need(store_->trace(m.key, {}, 100)).buckets.size(), 5u);
}

TEST_F(PostgresPartitionsTest, OldChunksAreDroppedByPartition) {
  std::vector<Mission> missions;
  for (int day = 0; day < 12; ++day) {
    missions.push_back(add_mission("m" + std::to_string(day), now_utime_us_));
    now_utime_us_ += day_us;
  }
  ASSERT_EQ(partitions("telemetry_chunk").front(), "telemetry_chunk_20260716");
  // Twelve days later those of the first four are past as a whole: of the fifth, an hour is left.
  now_utime_us_ += 4 * 3600 * second_us;
  const Prune week{{8 * day_us, {}}, 3};
  EXPECT_EQ(apply(week), 3);
  EXPECT_EQ(partitions("telemetry_chunk").front(), "telemetry_chunk_20260719");
  EXPECT_EQ(apply(week), 1);
  EXPECT_EQ(apply(week), 0);
  EXPECT_EQ(partitions("telemetry_chunk").front(), "telemetry_chunk_20260720");
  for (std::size_t k = 0; k < missions.size(); ++k) {
    EXPECT_EQ(need(store_->telemetry(missions[k].key, {}, {100, {}})).samples.size(), k < 4 ? 0u : 10u) << k;
    EXPECT_EQ(need(store_->mission(missions[k].key)).mission_id, missions[k].mission_id);
  }
  EXPECT_EQ(need(store_->size()).telemetry_chunks, 8);
  // A shorter age goes by the row, as elsewhere.
  EXPECT_EQ(apply(Prune{{3 * day_us, {}}, 1000}), 6);
}

TEST_F(PostgresPartitionsTest, LargePartitionIsPrunedByRows) {
  for (int k = 0; k < 5; ++k) add_mission("m" + std::to_string(k), now_utime_us_ + k * second_us);
  now_utime_us_ += 30 * day_us;
  EXPECT_EQ(apply(Prune{{10 * day_us, {}}, 3}), 3) << "a wrong clock must not delete everything";
  EXPECT_EQ(need(store_->size()).telemetry_chunks, 2);
  EXPECT_EQ(partitions("telemetry_chunk").front(), "telemetry_chunk_20260716");
  EXPECT_EQ(apply(Prune{{10 * day_us, {}}, 3}), 2);
  EXPECT_EQ(partitions("telemetry_chunk").front(), "telemetry_chunk_20260815");
}

TEST_F(PostgresPartitionsTest, TracesAreDroppedByWeek) {
  for (int k = 0; k < 3; ++k) add_mission("old " + std::to_string(k), now_utime_us_ + k * second_us);
  const Mission young = add_mission("young", now_utime_us_ + 6 * day_us);
  now_utime_us_ += 40 * day_us;
  reopen();
  const std::int64_t living = now_utime_us_ - young.end_utime_us + second_us;
  EXPECT_EQ(apply(PruneMissions{living, 10}), 3) << "by the row: the week has one that stays";
  EXPECT_EQ(partitions("trace").front(), "trace_20260716");
  EXPECT_EQ(need(store_->totals({})).missions, 1);
  EXPECT_EQ(apply(PruneMissions{10 * day_us, 10}), 1);
  EXPECT_EQ(partitions("trace").front(), "trace_20260820");
  EXPECT_EQ(ask("SELECT count(*)::text FROM trace"), "0");
  EXPECT_EQ(need(store_->size()).missions, 0);
  EXPECT_EQ(need(store_->totals({})).missions, 0);
}

// The sums of days equal the sums over the missions after every kind of change.
TEST_F(PostgresPartitionsTest, DaySumsFollowEveryChange) {
  const auto expect_sums = [&](std::int64_t missions, double measured_j) {
    const Totals totals = need(store_->totals({}));
    EXPECT_EQ(totals.missions, missions);
    if (missions > 0) {
      EXPECT_EQ(totals.accounts.measured_j, measured_j);
    }
    std::int64_t grouped = 0;
    for (const TotalsGroup& group : need(store_->grouped_totals({}, Grouping::day, 0)))
      grouped += group.totals.missions;
    EXPECT_EQ(grouped, missions);
    // Of half a day: parts of days are summed up from missions.
    MissionFilter half;
    half.start_from_utime_us = now_utime_us_ - second_us;
    half.start_to_utime_us = now_utime_us_ + second_us;
    EXPECT_EQ(need(store_->totals(half)).missions, std::min<std::int64_t>(missions, 1));
  };
  Mission m = start_mission(*store_, "amr-1", "m", now_utime_us_);
  m.accounts.measured_j = 7;
  m.accounts.measured_s = 1;
  need(apply(CheckpointMission{m, {}, {}, {}}));
  expect_sums(1, 7);
  m.state = MissionState::finished;
  m.accounts.measured_j = 11;
  need(apply(CheckpointMission{m, {}, {}, {}}));
  expect_sums(1, 11);
  m.accounts.measured_j = 12;
  need(apply(CheckpointMission{m, {}, {}, {}}));
  expect_sums(1, 12);
  m.state = MissionState::open;  // taken up again
  m.accounts.measured_j = 13;
  need(apply(CheckpointMission{m, {}, {}, {}}));
  expect_sums(1, 13);
  need(apply(RemoveRobot{"amr-1", false}));  // interrupts it
  expect_sums(1, 13);
  const Mission other = add_mission("other", now_utime_us_ + 2 * day_us);
  EXPECT_EQ(need(store_->totals({})).missions, 2);
  need(apply(StartMission{other}));  // restarted
  EXPECT_EQ(need(store_->totals({})).missions, 2);
  need(apply(RemoveRobot{"amr-1", true}));
  expect_sums(0, 0);
}

}  // namespace
}  // namespace joulecast::history

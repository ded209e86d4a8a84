// Questions of the past at a standby of the server: a real one, that follows, falls behind and goes.

#include "history/postgres_standby.h"

#include <gtest/gtest.h>
#include <sys/wait.h>

#include <chrono>
#include <cstdlib>
#include <thread>

#include "history/open_store.h"
#include "history/postgres.h"
#include "temporary_store.h"

namespace joulecast::history {
namespace {

using namespace std::chrono_literals;

int tell(const std::string& what) {
  return std::system((JOULECAST_SOURCE_DIR "/tests/support/postgresql.sh " + what).c_str());
}

class PostgresStandbyTest : public ::testing::Test {
 protected:
  static void SetUpTestSuite() {
    primary_ = new TemporaryFolder;
    standby_ = new TemporaryFolder;
    ASSERT_EQ(tell("start " + primary_->file("")), 0);
    ASSERT_EQ(tell("standby " + primary_->file("") + " " + standby_->file("")), 0);
    // Commits do not wait for it.
    administer(*primary_, "ALTER SYSTEM RESET synchronous_standby_names");
    administer(*primary_, "SELECT pg_reload_conf()");
  }
  static void TearDownTestSuite() {
    tell("stop " + standby_->file(""));
    tell("stop " + primary_->file(""));
    delete standby_;
    delete primary_;
  }

  void SetUp() override {
    const std::string name = ::testing::UnitTest::GetInstance()->current_test_info()->name();
    administer(*primary_, "CREATE SCHEMA " + name);
    const std::string schema = "&options=-csearch_path%3D" + name;
    store_ =
        need(open_store(url(*primary_) + schema, {.standby = {url(*standby_) + schema, max_staleness_s}}));
  }

  static std::string url(const TemporaryFolder& folder) {
    return "postgresql://joulecast@/postgres?host=" + folder.file("");
  }
  static void administer(const TemporaryFolder& folder, const std::string& sql) {
    PostgresDatabase(url(folder), "test", "any").execute(sql);
  }
  StandbyStatus need_status() const { return store_->standby().value(); }
  bool uses_standby(bool wanted) const {
    for (int tries = 0; tries < 1200; ++tries, std::this_thread::sleep_for(25ms))
      if (store_->past().staleness_s.has_value() == wanted) return true;
    return false;
  }

  // Waits until the standby is used and shows this number of missions.
  bool standby_shows(std::int64_t missions) const {
    for (int tries = 0; tries < 1200; ++tries, std::this_thread::sleep_for(25ms)) {
      const Past past = store_->past();
      if (past.staleness_s && need(past.history.totals({})).missions == missions) return true;
    }
    return false;
  }

  static constexpr double max_staleness_s = 5;
  static TemporaryFolder *primary_, *standby_;
  std::unique_ptr<Store> store_;
};

TemporaryFolder *PostgresStandbyTest::primary_, *PostgresStandbyTest::standby_;

TEST_F(PostgresStandbyTest, AnswersAndReportsItsStaleness) {
  const Mission m = start_mission(*store_, "amr-1", "m", 1'000'000);
  need(apply_one(*store_, CheckpointMission{m, {}, some_samples(0, 0, 20), {}}));
  ASSERT_TRUE(standby_shows(1));
  const Past past = store_->past();
  ASSERT_TRUE(past.staleness_s);
  EXPECT_GE(*past.staleness_s, 0);
  EXPECT_LE(*past.staleness_s, max_staleness_s);
  EXPECT_NE(&past.history, static_cast<const History*>(store_.get()));
  const std::uint64_t before = need_status().answered;
  EXPECT_EQ(need(past.history.missions({}, {10, {}}, {})).missions.size(), 1u);
  EXPECT_EQ(need(past.history.totals({})).missions, 1);
  EXPECT_EQ(need(past.history.grouped_totals({}, Grouping::day, 0)).size(), 1u);
  EXPECT_EQ(need(past.history.telemetry(m.key, {}, {100, {}})).samples.size(), 20u);
  EXPECT_TRUE(need(past.history.trace(m.key, {}, 10)).buckets.empty());
  EXPECT_TRUE(need(past.history.covariates(m.key, {}, {100, {}})).changes.empty());
  MissionFilter impossible;
  impossible.payload_min_kg = 2;
  impossible.payload_max_kg = 1;
  EXPECT_EQ(past.history.totals(impossible).error().fault, Fault::invalid);
  EXPECT_EQ(need_status().answered, before + 7);
}

TEST_F(PostgresStandbyTest, LaggingStandbyIsSkipped) {
  start_mission(*store_, "amr-1", "first", 1'000'000);
  ASSERT_TRUE(standby_shows(1));
  administer(*standby_, "SELECT pg_wal_replay_pause()");
  const Mission second = start_mission(*store_, "amr-1", "second", 2'000'000);
  {
    // While it is used, it shows the past state and reports its staleness; the store itself answers queries
    // of missions that the standby lacks.
    const Past past = store_->past();
    ASSERT_TRUE(past.staleness_s);
    EXPECT_EQ(need(past.history.totals({})).missions, 1);
    EXPECT_TRUE(past.history.trace(second.key, {}, 10));
    EXPECT_EQ(past.history.trace(99'999, {}, 10).error().fault, Fault::not_found);
  }
  ASSERT_TRUE(uses_standby(false));
  EXPECT_FALSE(need_status().in_use);
  EXPECT_GT(need_status().staleness_s.value_or(0), max_staleness_s);
  EXPECT_EQ(need(store_->past().history.totals({})).missions, 2);
  administer(*standby_, "SELECT pg_wal_replay_resume()");
  ASSERT_TRUE(uses_standby(true));
  EXPECT_EQ(need(store_->past().history.totals({})).missions, 2);
}

TEST_F(PostgresStandbyTest, MissingStandbyIsSkipped) {
  start_mission(*store_, "amr-1", "m", 1'000'000);
  ASSERT_TRUE(standby_shows(1));
  const Past past = store_->past();
  ASSERT_EQ(tell("stop " + standby_->file("")), 0);
  EXPECT_EQ(need(past.history.totals({})).missions, 1) << "queried while it stops";
  ASSERT_TRUE(uses_standby(false));
  EXPECT_FALSE(need_status().why_not.empty());
  EXPECT_EQ(need(store_->past().history.totals({})).missions, 1);
  ASSERT_EQ(tell("start " + standby_->file("")), 0);
  EXPECT_TRUE(uses_standby(true));
}

TEST_F(PostgresStandbyTest, IgnoresPrimaryAsStandby) {
  const std::string schema = "&options=-csearch_path%3Dno_standby";
  administer(*primary_, "CREATE SCHEMA no_standby");
  const auto store = need(open_store(url(*primary_) + schema, {.standby = {url(*primary_) + schema}}));
  for (int tries = 0; tries < 200 && store->standby()->why_not.empty(); ++tries)
    std::this_thread::sleep_for(25ms);
  EXPECT_NE(store->standby()->why_not.find("no standby"), std::string::npos) << store->standby()->why_not;
  EXPECT_FALSE(store->past().staleness_s);
}

}  // namespace
}  // namespace joulecast::history

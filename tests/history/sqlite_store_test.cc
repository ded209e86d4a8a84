// Properties of the store's files in SQLite only.

#include <gtest/gtest.h>
#include <signal.h>
#include <sys/resource.h>
#include <unistd.h>

#include <chrono>
#include <cmath>
#include <filesystem>
#include <fstream>

#include "history/open_store.h"
#include "history/schema.h"
#include "history/sqlite.h"
#include "temporary_store.h"

namespace joulecast::history {
namespace {

class SqliteStoreTest : public ::testing::Test {
 protected:
  Result<std::unique_ptr<Store>> open() const { return open_store(path_, {.busy_timeout_ms = 50}); }

  TemporaryFolder folder_;
  const std::string path_ = folder_.file("store.db");
};

TEST_F(SqliteStoreTest, SynchronizesEachCommitByDefault) {
  EXPECT_EQ(need(open_sqlite_tables(path_, {}))->integer("PRAGMA synchronous"), 2);
  EXPECT_EQ(
      need(open_sqlite_tables(path_, {.durability = Durability::process_end}))->integer("PRAGMA synchronous"),
      1);
}

TEST_F(SqliteStoreTest, WritesAheadWithForeignKeys) {
  auto store = need(open());
  SqliteDatabase other(path_, OpenMode::read_only, 50);
  EXPECT_EQ(other.text("PRAGMA journal_mode"), "wal");
  // Rejected by the foreign key.
  Mission m = new_mission(*store, "amr-1", "m", 0);
  m.model_version = 1;
  const Outcome outcome = apply_one(*store, StartMission{m});
  ASSERT_FALSE(outcome);
  EXPECT_NE(outcome.error().message.find("FOREIGN KEY"), std::string::npos);
}

TEST_F(SqliteStoreTest, RejectsNewerSchemaUnchanged) {
  {
    SqliteDatabase database(path_, OpenMode::read_write_create, 50);
    ASSERT_TRUE(bring_to_schema(database, store_schema()));
    database.execute("PRAGMA user_version = 1000");
  }
  const auto before = std::filesystem::last_write_time(path_);
  const auto store = open();
  ASSERT_FALSE(store);
  EXPECT_EQ(store.error().fault, Fault::conflict);
  EXPECT_NE(describe(store.error()).find("newer"), std::string::npos);
  EXPECT_EQ(std::filesystem::last_write_time(path_), before);
}

TEST_F(SqliteStoreTest, RejectsOtherFiles) {
  std::ofstream(path_) << std::string(10'000, 'x');
  const auto store = open();
  ASSERT_FALSE(store);
  EXPECT_EQ(store.error().fault, Fault::corrupt);
}

TEST_F(SqliteStoreTest, ReportsMissingFolder) {
  const auto store = open_store(folder_.file("absent/store.db"));
  ASSERT_FALSE(store);
  EXPECT_EQ(store.error().fault, Fault::unavailable);
}

TEST_F(SqliteStoreTest, IsLockedByOneProgram) {
  auto store = need(open());
  const auto second = open();
  ASSERT_FALSE(second);
  EXPECT_EQ(second.error().fault, Fault::conflict);
  const std::string holder = "process " + std::to_string(getpid());
  EXPECT_NE(describe(second.error()).find(holder), std::string::npos) << describe(second.error());
  store.reset();
  EXPECT_TRUE(open());
}

TEST_F(SqliteStoreTest, LockSurvivesDeletedLockFile) {
  const auto store = need(open());
  std::filesystem::remove(path_ + ".lock");
  const auto second = open();
  ASSERT_FALSE(second);
  EXPECT_EQ(second.error().fault, Fault::conflict);
}

TEST_F(SqliteStoreTest, FailsAfterFileIsReplaced) {
  for (const bool replaced : {false, true}) {
    for (const char* suffix : {"", "-wal"}) {
      auto store = need(open());
      EXPECT_TRUE(store->check());
      EXPECT_TRUE(apply_one(*store, AppendEvent{{0, 1, "", "test", "{}"}}));
      std::filesystem::rename(path_ + suffix, path_ + ".moved");
      if (replaced) std::filesystem::copy_file(path_ + ".moved", path_ + suffix);
      const std::string what = path_ + suffix + (replaced ? " was replaced" : " was deleted");
      const auto found = store->check();
      ASSERT_FALSE(found) << what;
      EXPECT_EQ(found.error().fault, Fault::unavailable);
      EXPECT_NE(found.error().message.find(what), std::string::npos) << found.error().message;
      EXPECT_FALSE(apply_one(*store, AppendEvent{{0, 2, "", "test", "{}"}}));
      // The file may be put back, but it may have been written meanwhile by another program.
      std::filesystem::rename(path_ + ".moved", path_ + suffix);
      EXPECT_FALSE(store->check());
      store.reset();
      EXPECT_TRUE(need(open())->check());
    }
  }
}

TEST_F(SqliteStoreTest, ReportsPagesOverwrittenByOthers) {
  MissionKey key = 0;
  {
    auto store = need(open());
    Mission m = start_mission(*store, "amr-1", "m", 0);
    key = m.key;
    m.state = MissionState::finished;
    need(apply_one(*store, CheckpointMission{m, {}, some_samples(0, 0, 20'000), {}}));
  }
  ASSERT_FALSE(std::filesystem::exists(path_ + "-wal"));
  const auto size = std::filesystem::file_size(path_);
  {
    // Everything behind the first pages, which hold the schema.
    std::fstream file(path_, std::ios::in | std::ios::out | std::ios::binary);
    file.seekp(static_cast<std::streamoff>(size / 2));
    file << std::string(size - size / 2, '\xa5');
  }
  const auto store = open();
  if (!store) {
    EXPECT_EQ(store.error().fault, Fault::corrupt);
    return;
  }
  const auto page = (*store)->telemetry(key, {}, {100'000, {}});
  ASSERT_FALSE(page);
  EXPECT_EQ(page.error().fault, Fault::corrupt);
}

// While it exists, no file of this process grows beyond the size: SQLite sees a full disk.
class FileSizeLimit {
 public:
  explicit FileSizeLimit(rlim_t bytes) {
    handler_ = signal(SIGXFSZ, SIG_IGN);
    getrlimit(RLIMIT_FSIZE, &before_);
    rlimit limit = before_;
    limit.rlim_cur = bytes;
    setrlimit(RLIMIT_FSIZE, &limit);
  }
  ~FileSizeLimit() {
    setrlimit(RLIMIT_FSIZE, &before_);
    signal(SIGXFSZ, handler_);
  }
  FileSizeLimit(const FileSizeLimit&) = delete;
  FileSizeLimit& operator=(const FileSizeLimit&) = delete;

 private:
  rlimit before_{};
  sighandler_t handler_ = nullptr;
};

TEST_F(SqliteStoreTest, FullDiskFailsTheWholeBatch) {
  auto store = need(open());
  Mission m = start_mission(*store, "amr-1", "m", 0);
  std::vector<Command> batch;
  for (int i = 0; i < 50; ++i) batch.push_back(CheckpointMission{m, {}, some_samples(0, 1024 * i, 1024), {}});
  {
    // Room for a few of the batch's pages.
    const FileSizeLimit full(std::filesystem::file_size(path_ + "-wal") + 20'000);
    const auto outcomes = store->apply(batch);
    ASSERT_FALSE(outcomes);
    EXPECT_EQ(outcomes.error().fault, Fault::unavailable) << describe(outcomes.error());
    EXPECT_TRUE(need(store->telemetry(m.key, {}, {})).items.empty());
  }
  for (const Outcome& outcome : need(store->apply(batch))) EXPECT_TRUE(outcome);
  EXPECT_EQ(need(store->telemetry(m.key, {}, {max_telemetry_samples, {}})).items.size(), 50U * 1024);
  EXPECT_EQ(SqliteDatabase(path_, OpenMode::read_only, 50).text("PRAGMA integrity_check"), "ok");
}

TEST_F(SqliteStoreTest, DamagedTailAcceptsNewSamples) {
  MissionKey key = 0;
  {
    auto store = need(open());
    const Mission m = start_mission(*store, "amr-1", "m", 0);
    key = m.key;
    need(apply_one(*store, CheckpointMission{m, {}, some_samples(0, 0, 10), {}}));
  }
  {
    SqliteDatabase database(path_, OpenMode::read_write_create, 50);
    database.execute("UPDATE telemetry_chunk SET body = zeroblob(5), bytes = 5");
  }
  auto store = need(open());
  Mission m = need(store->mission(key));
  need(apply_one(*store, CheckpointMission{m, {}, some_samples(1'000'000, 10, 3000), {}}));
  m.state = MissionState::finished;
  need(apply_one(*store, CheckpointMission{m, {}, {}, {}}));
  EXPECT_EQ(store->telemetry(key, {}, {100, {}}).error().fault, Fault::corrupt);
  const TelemetryPage later = need(store->telemetry(key, {1'000'000, whole_future}, {100'000, {}}));
  ASSERT_EQ(later.items.size(), 3000U);
  EXPECT_EQ(later.items.front().sequence, 10);
}

TEST_F(SqliteStoreTest, MergesSmallChunks) {
  auto store = need(open());
  Mission m = start_mission(*store, "amr-1", "m", 0);
  SqliteDatabase other(path_, OpenMode::read_only, 50);
  for (int i = 0; i < 250; ++i)
    need(apply_one(*store, CheckpointMission{m, {}, some_samples(100'000 * i, 10 * i, 10), {}}));
  // 2500 samples: two full chunks, and the tail of small ones.
  EXPECT_EQ(other.integer("SELECT count(*) FROM telemetry_chunk WHERE sealed = 1"), 2);
  EXPECT_EQ(other.integer("SELECT sum(samples) FROM telemetry_chunk WHERE sealed = 1"), 2048);
  m.state = MissionState::finished;
  need(apply_one(*store, CheckpointMission{m, {}, {}, {}}));
  EXPECT_EQ(other.integer("SELECT count(*) FROM telemetry_chunk"), 3);
  EXPECT_EQ(other.integer("SELECT count(*) FROM telemetry_chunk WHERE sealed = 0"), 0);
}

TEST_F(SqliteStoreTest, MissionPagesUseAnIndex) {
  auto store = need(open());
  SqliteDatabase other(path_, OpenMode::read_only, 50);
  const auto plan = [&](const std::string& sql) {
    Rows rows(other.statement("EXPLAIN QUERY PLAN " + sql));
    std::string text;
    while (rows.next()) {
      (void)rows.integer();
      (void)rows.integer();
      (void)rows.integer();
      text += rows.text() + "\n";
    }
    return text;
  };
  for (const std::string filter : {"", "robot_id = 'amr-1' AND "}) {
    const std::string text = plan("SELECT * FROM mission WHERE " + filter +
                                  "(start_utime_us, mission_key) < (1, 2) ORDER BY start_utime_us DESC, "
                                  "mission_key DESC LIMIT 50");
    EXPECT_NE(text.find("USING INDEX mission_by_"), std::string::npos) << text;
    EXPECT_EQ(text.find("TEMP B-TREE"), std::string::npos) << text;
  }
}

TEST_F(SqliteStoreTest, OpensLargeStoresQuickly) {
  constexpr int missions = 50;
  constexpr int seconds = 20'000;
  MissionKey last = 0;
  {
    auto store = need(open());
    for (int k = 0; k < missions; ++k) {
      Mission m = start_mission(*store, "amr-" + std::to_string(k), "long", 0);
      last = m.key;
      std::vector<TraceBucket> trace(seconds);
      for (int s = 0; s < seconds; ++s) {
        trace[static_cast<std::size_t>(s)].start_utime_us = s * trace_bucket_us;
        trace[static_cast<std::size_t>(s)].covered_s = 1;
        trace[static_cast<std::size_t>(s)].measured_power_w = {1.0 * s, 1.5 * s, 2.0 * s};
      }
      need(apply_one(*store, CheckpointMission{m, std::move(trace), {}, {}}));
    }
  }
  const auto begin = std::chrono::steady_clock::now();
  auto store = need(open());
  ASSERT_EQ(need(store->recover()).size(), static_cast<std::size_t>(missions));
  ASSERT_EQ(need(store->missions({}, {50, {}})).missions.size(), static_cast<std::size_t>(missions));
  const std::chrono::duration<double> open_s = std::chrono::steady_clock::now() - begin;
  // The project's bound for restart to ready.
  EXPECT_LT(open_s.count(), 1.0);
  RecordProperty("open_s", std::to_string(open_s.count()));
  const Trace trace = need(store->trace(last, {}, 500));
  EXPECT_EQ(trace.buckets.size(), 500U);
  EXPECT_EQ(trace.buckets.back().measured_power_w.max, 2.0 * (seconds - 1));
}

}  // namespace
}  // namespace joulecast::history

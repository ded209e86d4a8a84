#include "history/store_care.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sqlite3.h>
#include <sys/stat.h>
#include <unistd.h>

#include <fstream>

#include "base/text_file.h"
#include "temporary_store.h"

namespace joulecast::history {
namespace {

namespace fs = std::filesystem;

class StoreCare : public ::testing::Test {
 protected:
  StoreCare() : path_(folder_.file("store.db")) { open(); }

  void open() { store_ = need(open_store(path_)); }

  // Adds this number of missions of a robot with a model, of 1,000 samples each.
  void fill(int missions, const std::string& robot_id = "amr-1") {
    need(apply_one(*store_, AddModel{robot_id, 5, ModelOrigin::http, "", R"({"a": 1})", {}}));
    for (int k = 0; k < missions; ++k) {
      Mission m = start_mission(*store_, robot_id, "m" + std::to_string(k), 1'000'000'000LL * (k + 1));
      m.state = MissionState::finished;
      m.model_version = 1;
      m.samples = 1000;
      m.accounts.battery_j = 30;
      m.accounts.ledger[signals::Term::copper] = 40;
      m.accounts.ledger[signals::Term::recovered] = 10;
      need(apply_one(*store_, CheckpointMission{m, {}, some_samples(m.start_utime_us, 0, 1000), {}}));
    }
  }

  std::int64_t missions_of(const std::string& path) {
    const auto check = check_store(path);
    EXPECT_TRUE(check) << describe(check.error());
    EXPECT_TRUE(check && check->faults.empty()) << check->faults.front();
    return check ? check->missions : -1;
  }

  // Past the store's own means.
  void write(const std::string& sql) {
    sqlite3* database = nullptr;
    ASSERT_EQ(sqlite3_open(path_.c_str(), &database), SQLITE_OK);
    EXPECT_EQ(sqlite3_exec(database, sql.c_str(), nullptr, nullptr, nullptr), SQLITE_OK)
        << sqlite3_errmsg(database);
    sqlite3_close(database);
  }

  static std::int64_t integer(const std::string& path, const std::string& sql) {
    sqlite3* database = nullptr;
    sqlite3_stmt* row = nullptr;
    sqlite3_open(path.c_str(), &database);
    sqlite3_prepare_v2(database, sql.c_str(), -1, &row, nullptr);
    const std::int64_t value = sqlite3_step(row) == SQLITE_ROW ? sqlite3_column_int64(row, 0) : -1;
    sqlite3_finalize(row);
    sqlite3_close(database);
    return value;
  }

  // The beginning of the page of the first such text in the file.
  void overwrite_page(const std::string& text, const std::string& with) {
    const std::size_t at = need(read_text_file(path_)).find(text);
    ASSERT_NE(at, std::string::npos);
    std::fstream file(path_, std::ios::binary | std::ios::in | std::ios::out);
    file.seekp(static_cast<std::streamoff>(at / 4096 * 4096));
    file << with;
  }

  // As much of it as is surely on one page.
  std::string body_of_chunk(int key) {
    sqlite3* database = nullptr;
    sqlite3_stmt* row = nullptr;
    sqlite3_open(path_.c_str(), &database);
    sqlite3_prepare_v2(database, "SELECT substr(body, 20, 32) FROM telemetry_chunk WHERE chunk_key = ?", -1,
                       &row, nullptr);
    sqlite3_bind_int(row, 1, key);
    std::string body;
    if (sqlite3_step(row) == SQLITE_ROW)
      body.assign(static_cast<const char*>(sqlite3_column_blob(row, 0)), 32);
    sqlite3_finalize(row);
    sqlite3_close(database);
    return body;
  }

  TemporaryFolder folder_;
  std::string path_;
  std::unique_ptr<Store> store_;
};

TEST_F(StoreCare, ChecksAStoreInUse) {
  fill(3);
  const auto check = need(check_store(path_));
  EXPECT_TRUE(check.faults.empty());
  EXPECT_EQ(check.missions, 3);
  EXPECT_EQ(check.chunks, 3);
}

TEST_F(StoreCare, RejectsOtherFiles) {
  EXPECT_EQ(check_store(folder_.file("absent")).error().fault, Fault::not_found);
  std::ofstream(folder_.file("text")) << std::string(10'000, 'x');
  EXPECT_EQ(check_store(folder_.file("text")).error().fault, Fault::corrupt);
  store_.reset();
  write("PRAGMA user_version = 1");
  EXPECT_EQ(check_store(path_).error().fault, Fault::conflict);
}

TEST_F(StoreCare, ChecksLedgersReferencesAndChunks) {
  fill(3);
  store_.reset();
  const auto fault_after = [&](const std::string& sql) {
    write(sql);
    const auto check = need(check_store(path_));
    return check.faults.empty() ? std::string() : check.faults.back();
  };
  EXPECT_EQ(fault_after("UPDATE mission SET ledger_copper_j = 40.00001 WHERE mission_key = 1"), "");
  EXPECT_NE(fault_after("UPDATE mission SET ledger_copper_j = 41 WHERE mission_key = 1")
                .find("mission 1: its ledger adds up to "),
            std::string::npos);
  EXPECT_NE(fault_after("UPDATE telemetry_chunk SET body = zeroblob(bytes) WHERE chunk_key = 2")
                .find("telemetry_chunk 2 of mission 2"),
            std::string::npos);
  EXPECT_NE(fault_after("UPDATE telemetry_chunk SET samples = 7 WHERE chunk_key = 3")
                .find("holds other samples than its row states"),
            std::string::npos);
  write("UPDATE mission SET ledger_copper_j = 40; DELETE FROM telemetry_chunk");
  EXPECT_NE(fault_after("PRAGMA foreign_keys = OFF; DELETE FROM model").find("refers to nothing in model"),
            std::string::npos);
}

TEST_F(StoreCare, BacksUpAStoreInUse) {
  fill(3);
  const std::string copy = folder_.file("copy.db");
  EXPECT_EQ(need(back_up_store(path_, copy)).missions, 3);
  EXPECT_EQ(back_up_store(path_, copy).error().fault, Fault::conflict);
  need(apply_one(*store_, RemoveRobot{"amr-1", true}));
  EXPECT_EQ(restore_store(copy, path_).error().fault, Fault::conflict) << "the store is open";
  store_.reset();
  const std::string before = need(restore_store(copy, path_));
  EXPECT_EQ(missions_of(path_), 3);
  EXPECT_EQ(missions_of(before), 0);
  EXPECT_EQ(missions_of(copy), 3);
  open();
  EXPECT_EQ(need(store_->totals({})).missions, 3);
  store_.reset();
  EXPECT_EQ(restore_store(path_, path_).error().fault, Fault::invalid);
  EXPECT_EQ(need(restore_store(copy, folder_.file("new.db"))), "");
  EXPECT_EQ(missions_of(folder_.file("new.db")), 3);
}

TEST_F(StoreCare, RootRestoresForTheDaemonsUser) {
  if (geteuid() != 0) GTEST_SKIP() << "only root gives files away";
  constexpr uid_t daemon = 4711;
  fill(1);
  const std::string copy = folder_.file("copy.db");
  need(back_up_store(path_, copy));
  store_.reset();
  const auto owner_of = [](const std::string& path) {
    struct stat file {};
    return stat(path.c_str(), &file) == 0 ? file.st_uid : uid_t{0};
  };
  ASSERT_EQ(chown(path_.c_str(), daemon, daemon), 0);
  need(restore_store(copy, path_));
  EXPECT_EQ(owner_of(path_), daemon) << "as the one before";
  ASSERT_EQ(chown(folder_.file("").c_str(), daemon, daemon), 0);
  need(restore_store(copy, folder_.file("new.db")));
  EXPECT_EQ(owner_of(folder_.file("new.db")), daemon) << "as its directory";
}

// SQLite reports a full disk where a page refers to one beyond its largest file.
TEST_F(StoreCare, RejectsBackupOfBrokenChain) {
  const std::string model = R"({"a": ")" + std::string(20'000, 'x') + "\"}";
  need(apply_one(*store_, AddModel{"amr-1", 5, ModelOrigin::http, "", model, {}}));
  store_.reset();
  write("PRAGMA wal_checkpoint(TRUNCATE)");
  overwrite_page(std::string(4000, 'x'), "\xa5\xa5\xa5\xa5");
  const Error error = back_up_store(path_, folder_.file("copy.db")).error();
  EXPECT_EQ(error.fault, Fault::corrupt) << describe(error);
  EXPECT_EQ(error.field, path_);
}

TEST_F(StoreCare, SalvagesUndamagedPages) {
  fill(60);
  fill(2, "amr-2");
  store_.reset();
  write("PRAGMA wal_checkpoint(TRUNCATE)");
  // The page that holds a chunk of telemetry.
  overwrite_page(body_of_chunk(30), std::string(4096, '\xa5'));
  const auto check = need(check_store(path_));
  EXPECT_FALSE(check.faults.empty());
  const std::string copy = folder_.file("copy.db"), whole = folder_.file("whole.db");
  EXPECT_EQ(back_up_store(path_, copy).error().fault, Fault::corrupt);
  EXPECT_FALSE(fs::exists(copy));
  EXPECT_EQ(restore_store(path_, copy).error().fault, Fault::corrupt);
  EXPECT_FALSE(fs::exists(copy));

  const Salvage salvage = need(salvage_store(path_, whole));
  EXPECT_GT(salvage.rows, 100);
  EXPECT_FALSE(salvage.losses.empty());
  EXPECT_EQ(missions_of(whole), 62);
  const auto sound = need(check_store(whole));
  EXPECT_LT(sound.chunks, 62);
  EXPECT_GE(sound.chunks, 55);
  EXPECT_EQ(salvage_store(path_, whole).error().fault, Fault::conflict);
  EXPECT_NE(need(restore_store(whole, path_)), "");
  open();
  EXPECT_EQ(need(store_->robots()).size(), 2u);
}

// A page of missions that reads as empty: no query fails, and the recordings of those missions are readable.
TEST_F(StoreCare, SalvageReportsLossesAndRows) {
  fill(3);
  store_.reset();
  const std::int64_t page = integer(path_, "SELECT rootpage FROM sqlite_schema WHERE name = 'mission'");
  {
    std::fstream file(path_, std::ios::binary | std::ios::in | std::ios::out);
    file.seekp(static_cast<std::streamoff>((page - 1) * 4096 + 3));
    file.write("\0\0", 2);  // cells
  }
  const std::string whole = folder_.file("whole.db");
  const Salvage salvage = need(salvage_store(path_, whole));
  EXPECT_THAT(salvage.losses, ::testing::Contains(::testing::HasSubstr("telemetry_chunk: ")));
  EXPECT_EQ(missions_of(whole), 0);
  std::int64_t rows = 0;
  for (const char* table :
       {"robot", "model", "mission", "trace", "telemetry_chunk", "covariate_chunk", "event", "energy_state",
        "learned", "audit", "diagnosis", "diagnosis_report", "proposal"})
    rows += integer(whole, "SELECT count(*) FROM " + std::string(table));
  EXPECT_EQ(salvage.rows, rows);
}

TEST_F(StoreCare, ReportsChangedSchema) {
  fill(1);
  store_.reset();
  write(
      "DROP TRIGGER audit_keeps_entries; CREATE TRIGGER eats AFTER INSERT ON event BEGIN DELETE FROM "
      "mission; END");
  EXPECT_THAT(
      need(check_store(path_)).faults,
      ::testing::UnorderedElementsAre("trigger audit_keeps_entries is missing", "trigger eats was added"));
  open();
  EXPECT_EQ(missions_of(path_), 1);
}

// Of an earlier version, with a view that never ends in the place of a table.
TEST_F(StoreCare, SalvagesEarlierVersions) {
  fill(3);
  store_.reset();
  write(
      "PRAGMA foreign_keys = OFF; ALTER TABLE mission DROP COLUMN covariates_json; DROP TABLE "
      "request_answer; "
      "DROP TABLE energy_state; CREATE VIEW energy_state AS WITH RECURSIVE n (k) AS (SELECT 1 UNION ALL "
      "SELECT "
      "k + 1 FROM n) SELECT k FROM n; PRAGMA user_version = 5");
  const std::string whole = folder_.file("whole.db");
  const Salvage salvage = need(salvage_store(path_, whole));
  EXPECT_EQ(missions_of(whole), 3);
  EXPECT_EQ(integer(whole, "SELECT count(*) FROM telemetry_chunk"), 3);
  write("PRAGMA user_version = 1000");
  EXPECT_EQ(salvage_store(path_, folder_.file("newer.db")).error().fault, Fault::conflict);
}

TEST_F(StoreCare, PurgeShrinksTheFile) {
  fill(200);
  const auto before = need(store_->size()).database_bytes;
  need(apply_one(*store_, RemoveRobot{"amr-1", true}));
  EXPECT_LT(need(store_->size()).database_bytes, before / 2);
}

}  // namespace
}  // namespace joulecast::history

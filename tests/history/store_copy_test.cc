#include "history/store_copy.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>
#include <stdexcept>

#include "history/audit.h"
#include "history/open_store.h"
#include "history/sqlite.h"
#include "postgres_server.h"

namespace joulecast::history {
namespace {

const TableProgress quietly = [](std::string_view, std::int64_t, std::int64_t) {};

class StoreCopyTest : public ::testing::Test {
 protected:
  // Something in every table, and every kind of value.
  void SetUp() override {
    auto store = need(open_store("sqlite:" + source_));
    need(apply_one(*store,
                   AddModel{"amr-1", 1, ModelOrigin::file, "größer", R"({"a": 1})", {}, R"({"why": 2})"}));
    need(apply_one(*store, AddModel{"amr-1", 2, ModelOrigin::http, "", R"({"a": 2})", {}}));
    need(apply_one(*store, AddModel{"Amr-0", 3, ModelOrigin::http, "", R"({"a": 3})", {}}));
    need(apply_one(*store, ActivateModel{"amr-1", 1}));
    for (int k = 0; k < 3; ++k) {
      Mission m = start_mission(*store, "amr-1", "m" + std::to_string(k), 1000 * k);
      m.model_version = 2;
      m.state = k == 2 ? MissionState::open : MissionState::finished;
      m.accounts.measured_j = signals::unmeasured;
      m.accounts.battery_j = 3.5;
      m.accounts.ledger[signals::Term::copper] = 0.1 + 0.2;
      m.accounts.ledger[signals::Term::drag] = -0.0;
      m.accounts.ledger[signals::Term::unexplained] = 3.5 - (0.1 + 0.2);
      m.sample_faults = {{"late", 3}};
      std::vector<TraceBucket> trace(3000);
      for (std::size_t i = 0; i < trace.size(); ++i) {
        trace[i].start_utime_us = static_cast<std::int64_t>(i) * trace_bucket_us;
        trace[i].covered_s = 1e-300;
      }
      need(apply_one(*store, CheckpointMission{m,
                                               trace,
                                               some_samples(0, 0, 3000),
                                               ResumeState{"amr-1", 1, 2, 0.5, {}},
                                               {{5, "cpu_load", 0.25}}}));
    }
    need(apply_one(*store, PutLearned{{"amr-1", "charge", 5, R"({"a":1})"}}));
    for (int k = 0; k < 5; ++k)
      need(apply_one(*store, AppendEvent{{0, k, k % 2 ? "amr-1" : "", "kind", "{}"}}));
    DiagnosisRecord d;
    d.robot_id = "amr-1";
    d.request_json = "{}";
    d.id = need(apply_one(*store, AddDiagnosis{d}));
    need(apply_one(*store, UpdateDiagnosis{d, "<html>"}));
    Proposal p;
    p.robot_id = "amr-1";
    p.kind = "calibration";
    p.model_json = p.detail_json = "{}";
    need(apply_one(*store, AddProposal{p}));
    for (int k = 0; k < 3; ++k)
      need(apply_one(*store, AppendAudit{{0, k, "größer", "::1", "r", "putRobot", "{}", ""}}));
    need(apply_one(*store, KeepAnswer{{"planner", "key-1", "print", 5, 201, "/v1/diagnoses/1", "{}"}}));
    need(apply_one(
        *store,
        PutFloorPlan{
            {"hall", "1", 5, 0.05, -3, 4, 0.1, {{1, 2}}, "image/png", std::string("\x89PNG\0\xff", 6)}}));
  }

  std::shared_ptr<Database> tables(const std::string& url) const { return need(open_tables(url, false)); }
  CopyReport copy(const std::string& from, const std::string& to) const {
    return need(copy_tables(*tables(from), *tables(to), quietly));
  }

  TemporaryFolder folder_;
  const std::string source_ = folder_.file("source.db"), back_ = folder_.file("back.db");
  const std::string postgres_ = postgres_url(folder_);
};

TEST_F(StoreCopyTest, ListsEveryTable) {
  SqliteDatabase database(source_, OpenMode::read_only, 100);
  std::vector<std::string> stored;
  Rows rows(
      // A copy is a store of its own identity, with spools of its own.
      database.statement("SELECT name FROM sqlite_schema WHERE type = 'table' AND name NOT LIKE 'sqlite_%' "
                         "AND name NOT IN ('joulecast_store', 'taken_spool')"));
  while (rows.next()) stored.push_back(rows.text());
  std::vector<std::string> copied;
  for (const TableSummary& table : need(summarize_tables(database, quietly))) copied.push_back(table.table);
  EXPECT_THAT(copied, testing::UnorderedElementsAreArray(stored));
}

TEST_F(StoreCopyTest, RoundTripThroughPostgresIsExact) {
  const CopyReport there = copy(source_, postgres_);
  const CopyReport back = copy(postgres_, back_);
  EXPECT_EQ(there.rows_found, 0);
  EXPECT_EQ(there.tables, back.tables);
  EXPECT_EQ(there.tables, need(summarize_tables(*tables(source_), quietly)));
  for (const TableSummary& table : there.tables) EXPECT_GT(table.rows, 0) << table.table;
  // Both are stores that go on: new numbers are none of the old.
  for (const std::string& url : {postgres_, back_}) {
    auto store = need(open_store(url));
    EXPECT_EQ(need(store->recover()).size(), 1U);
    EXPECT_EQ(need(store->model("amr-1")).version, 1);
    EXPECT_EQ(need(store->robots()).front().robot_id, "Amr-0");
    EXPECT_GT(need(apply_one(*store, AppendEvent{{0, 9, "", "kind", "{}"}})), 5);
    Mission m = need(store->recover()).front();
    need(apply_one(*store, CheckpointMission{m, {}, some_samples(0, 3000, 3000), {}}));
    EXPECT_EQ(need(store->telemetry(m.key, {}, {10'000, {}})).items.size(), 6000U);
    EXPECT_GT(start_mission(*store, "amr-1", "new", 5).key, m.key);
    // The chain of the audit is whole and goes on.
    const std::string head = need(verify_audit(source_)).head;
    EXPECT_EQ(apply_one(*store, AppendAudit{{0, 9, "", "", "", "putRobot", "{}", ""}}), 4);
    EXPECT_EQ(need(verify_audit(url, head)).entries, 4);
  }
}

TEST_F(StoreCopyTest, ContinuesInterruptedCopies) {
  for (const std::string_view where : {"robot", "mission", "trace", "telemetry_chunk", "proposal"}) {
    const TemporaryFolder folder;
    const std::string to = where == "trace" ? postgres_ : folder.file("to.db");
    const auto cut =
        copy_tables(*tables(source_), *tables(to), [&](std::string_view table, std::int64_t, std::int64_t) {
          if (table == where) throw std::runtime_error("cut off");
        });
    ASSERT_FALSE(cut);
    const CopyReport whole = copy(source_, to);
    EXPECT_GT(whole.rows_found, 0);
    EXPECT_EQ(whole.tables, need(summarize_tables(*tables(source_), quietly)));
  }
}

TEST_F(StoreCopyTest, RejectsDestinationsWithOtherRows) {
  need(apply_one(*need(open_store(back_)), AddModel{"amr-1", 7, ModelOrigin::file, "", "{}", {}}));
  const auto refused = copy_tables(*tables(source_), *tables(back_), quietly);
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().fault, Fault::conflict);
}

TEST_F(StoreCopyTest, RejectsMissingStores) {
  EXPECT_EQ(open_tables(folder_.file("absent.db"), true).error().fault, Fault::not_found);
  std::ofstream(folder_.file("empty.db")).close();
  EXPECT_EQ(open_tables(folder_.file("empty.db"), true).error().fault, Fault::corrupt);
  EXPECT_EQ(open_tables(postgres_, true).error().fault, Fault::corrupt);
}

TEST_F(StoreCopyTest, VerifiesLedgersAndChunks) {
  copy(source_, postgres_);
  for (const std::string& url : {"sqlite:" + source_, postgres_}) {
    const VerifyReport sound = need(verify_tables(*tables(url), quietly));
    EXPECT_EQ(sound.fault_count, 0) << sound.faults.front();
    EXPECT_EQ(sound.missions, 3);
    EXPECT_EQ(sound.ledgers, 3);
    EXPECT_LT(sound.worst_residual_j, 1e-12);
    EXPECT_GE(sound.chunks, 6);
    tables(url)->execute("UPDATE mission SET battery_j = 9 WHERE mission_id = 'm1'");
    tables(url)->execute("UPDATE telemetry_chunk SET samples = samples + 1 WHERE first_ordinal = 0");
    tables(url)->execute("UPDATE mission SET sample_faults = '[]' WHERE mission_id = 'm2'");
    const VerifyReport damaged = need(verify_tables(*tables(url), quietly));
    EXPECT_EQ(damaged.fault_count, 5);  // a ledger, a record and the first chunk of each mission
    EXPECT_EQ(damaged.faults.size(), 5U);
    EXPECT_THROW(tables(url)->execute("UPDATE audit SET actor = 'mallory' WHERE audit_id = 2"), SqlError);
    EXPECT_THROW(tables(url)->execute("DELETE FROM audit WHERE audit_id = 3"), SqlError);
    const char* on_table = is_postgres_url(url) ? " ON audit" : "";
    tables(url)->execute(std::string("DROP TRIGGER audit_keeps_content") + on_table +
                         "; UPDATE audit SET actor = 'mallory' WHERE audit_id = 2");
    const VerifyReport forged = need(verify_tables(*tables(url), quietly));
    ASSERT_EQ(forged.fault_count, 6);
    EXPECT_NE(forged.faults.back().find("at entry 2"), std::string::npos) << forged.faults.back();
  }
}

}  // namespace
}  // namespace joulecast::history

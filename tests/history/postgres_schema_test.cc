// The tables in PostgreSQL according to its catalogue: migration from older versions, and Citus' requirements
// on tables that are distributed by robot.

#include "history/postgres_schema.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <iterator>
#include <span>
#include <thread>

#include "history/open_store.h"
#include "history/postgres.h"
#include "history/postgres_store.h"
#include "history/telemetry_chunk.h"
#include "postgres_server.h"

namespace joulecast::history {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;

class PostgresSchemaTest : public ::testing::Test {
 protected:
  std::string url() const { return postgres_url(folder_); }
  std::string ask(const std::string& sql) const { return as_administrator(folder_, sql); }

  // The first column of all rows, in order.
  static std::vector<std::string> column(const std::string& url, const std::string& sql) {
    PostgresDatabase database(url, "test");
    std::vector<std::string> all;
    const auto statement = database.prepare(sql);
    for (Rows rows(*statement); rows.next();) all.push_back(rows.text());
    return all;
  }
  std::vector<std::string> column(const std::string& sql) const { return column(url(), sql); }

  TemporaryFolder folder_;
};

// A store of version 2 with a finished mission of two days ago and an open one of now, both with traces and
// telemetry, and one row of each other table with a changed key.
void fill_version_2(const std::string& url, std::int64_t old_start, std::int64_t new_start) {
  PostgresDatabase database(url, "test");
  database.execute("INSERT INTO robot VALUES ('amr-1', 1, NULL)");
  database.execute("INSERT INTO model VALUES ('amr-1', 1, 1, 'file', '', NULL, '{}')");
  database.execute("UPDATE robot SET active_version = 1");
  for (const auto& [key, start, state] :
       {std::tuple(7, old_start, "'finished'"), std::tuple(8, new_start, "'open'")}) {
    const std::string k = std::to_string(key), at = std::to_string(start);
    database.execute(
        "INSERT INTO mission (mission_key, robot_id, mission_id, start_utime_us, end_utime_us, state, "
        "implicit, "
        "incomplete, incomplete_reason, note, model_version, samples, sample_faults, gap_count, measured_j, "
        "measured_s, telemetry_samples) VALUES (" +
        k + ", 'amr-1', 'm" + k + "', " + at + ", " + at + " + 5000000, " + state +
        ", 0, 0, '', '', 1, 30, '{}', 0, 100, 5, 30)");
    database.execute("INSERT INTO trace (mission_key, start_utime_us, measured_j) SELECT " + k + ", " + at +
                     " + 1000000 * n, n FROM generate_series(0, 4) AS n");
    const std::vector<std::byte> body = encode_chunk(some_samples(start, 0, 30), 1);
    Rows(
        database.statement(
            "INSERT INTO telemetry_chunk (mission_key, first_ordinal, samples, start_utime_us, end_utime_us, "
            "stored_utime_us, sealed, bytes, body) VALUES (?, 0, 30, ?, ?, ?, ?, ?, ?)"))
        .bind(std::int64_t{key})
        .bind(start)
        .bind(start + 290'000)
        .bind(start)
        .bind(key == 7)
        .bind(static_cast<std::int64_t>(body.size()))
        .bind(std::span<const std::byte>(body))
        .run();
  }
  database.execute(
      "INSERT INTO diagnosis (robot_id, created_utime_us, state, cause, request_json, fitted_on, held_back, "
      "error) VALUES ('amr-1', 5, 'done', 'request', '{}', '[7]', '[]', '')");
  database.execute("INSERT INTO diagnosis_report VALUES (1, '<html>')");
  database.execute(
      "INSERT INTO proposal (robot_id, created_utime_us, kind, state, note, fitted_on, model_json, "
      "detail_json) "
      "VALUES ('amr-1', 5, 'refinement', 'open', '', '[7]', '{}', '{}')");
}

constexpr std::int64_t day_us = 86'400'000'000, now_utime_us = 20'000 * day_us + 3'600'000'000;

TEST_F(PostgresSchemaTest, MigrationFromVersionTwoKeepsEverything) {
  make_store_of_version_2(folder_);
  fill_version_2(url(), now_utime_us - 2 * day_us, now_utime_us);
  PostgresOptions options;
  options.url = url();
  options.now_utime_us = [] { return now_utime_us; };
  const auto store = need(open_postgres_store(options));
  for (const MissionKey key : {7, 8}) {
    const Mission mission = need(store->mission(key));
    EXPECT_EQ(mission.robot_id, "amr-1");
    EXPECT_EQ(mission.samples, 30);
    const Trace trace = need(store->trace(key, {}, 100));
    ASSERT_EQ(trace.buckets.size(), 5u);
    EXPECT_EQ(trace.buckets.back().measured_j, 4);
    const TelemetryPage page = need(store->telemetry(key, {}, {100, {}}));
    ASSERT_EQ(page.samples.size(), 30u);
    EXPECT_EQ(page.samples.back().sequence, 29);
  }
  EXPECT_EQ(need(store->totals({})).missions, 2);
  EXPECT_EQ(need(store->totals({})).accounts.measured_j, 200);
  EXPECT_EQ(need(store->diagnosis_report(1)), "<html>");
  EXPECT_EQ(need(store->proposal(1)).kind, "refinement");
  // New rows continue after the end of the old tables.
  Mission open = need(store->mission(8));
  open.state = MissionState::finished;
  need(apply_one(*store, CheckpointMission{open, {}, some_samples(now_utime_us + 300'000, 30, 5), {}}));
  EXPECT_EQ(need(store->telemetry(8, {}, {100, {}})).samples.size(), 35u);
  EXPECT_EQ(new_mission(*store, "amr-1", "next", now_utime_us).key, 9);
  DiagnosisRecord diagnosis;
  diagnosis.robot_id = "amr-1";
  diagnosis.request_json = "{}";
  EXPECT_EQ(need(apply_one(*store, AddDiagnosis{diagnosis})), 2);
  EXPECT_EQ(ask("SELECT count(*)::text FROM trace_other"), "0")
      << "partitions were created for the existing rows";
  EXPECT_EQ(ask("SELECT count(*)::text FROM telemetry_chunk_other"), "0");
}

// Everything except partitions that depend on the time, and the order of columns.
std::vector<std::string> description(const std::string& url) {
  PostgresDatabase database(url, "test");
  std::vector<std::string> all;
  for (const char* sql :
       {"SELECT c.relname || '.' || attname || ' ' || format_type(atttypid, atttypmod) || ' ' || attnotnull "
        "|| "
        "attidentity::text || attstorage::text || coalesce(pg_get_expr(adbin, adrelid), '') FROM "
        "pg_attribute JOIN "
        "pg_class c "
        "ON c.oid = attrelid LEFT JOIN pg_attrdef ON adrelid = attrelid AND adnum = attnum WHERE "
        "relnamespace = "
        "current_schema()::regnamespace AND relkind IN ('r', 'p') AND attnum > 0 AND NOT attisdropped",
        "SELECT c.relname || ' ' || coalesce(pg_get_partkeydef(c.oid), '') || "
        "coalesce(pg_get_expr(relpartbound, "
        "c.oid), '') || coalesce(array_to_string(reloptions, ','), '') FROM pg_class c WHERE relnamespace = "
        "current_schema()::regnamespace AND relkind IN ('r', 'p', 'S')",
        "SELECT regexp_replace(indexdef, current_schema() || '\\.', '', 'g') FROM pg_indexes WHERE "
        "schemaname = "
        "current_schema()",
        "SELECT conrelid::regclass::text || ' ' || conname || ' ' || pg_get_constraintdef(oid) FROM "
        "pg_constraint "
        "WHERE connamespace = current_schema()::regnamespace",
        "SELECT tgrelid::regclass::text || ' ' || tgname FROM pg_trigger WHERE NOT tgisinternal AND tgrelid "
        "IN "
        "(SELECT oid FROM pg_class WHERE relnamespace = current_schema()::regnamespace)"}) {
    const auto statement = database.prepare(sql);
    for (Rows rows(*statement); rows.next();) {
      std::string line = rows.text();
      if (line.find("_1970") == std::string::npos) all.push_back(std::move(line));
    }
  }
  std::sort(all.begin(), all.end());
  return all;
}

TEST_F(PostgresSchemaTest, MigratedTablesEqualNewOnes) {
  make_store_of_version_2(folder_);
  const TemporaryFolder other;
  for (const std::string& one : {url(), postgres_url(other)}) {
    PostgresOptions options;
    options.url = one;
    options.now_utime_us = [] { return 0; };
    need(open_postgres_store(options)).reset();
  }
  const auto migrated = description(url()), made = description(postgres_url(other));
  std::vector<std::string> missing, superfluous;
  std::ranges::set_difference(made, migrated, std::back_inserter(missing));
  std::ranges::set_difference(migrated, made, std::back_inserter(superfluous));
  EXPECT_THAT(missing, IsEmpty());
  EXPECT_THAT(superfluous, IsEmpty());
}

TEST_F(PostgresSchemaTest, OneOfTwoDaemonsMigrates) {
  make_store_of_version_2(folder_);
  fill_version_2(url(), now_utime_us - 2 * day_us, now_utime_us);
  std::vector<std::thread> daemons;
  std::vector<Result<std::unique_ptr<Store>>> stores(2);
  for (auto& store : stores)
    daemons.emplace_back([&] { store = open_shared_store(url(), new_writer_name(), {}); });
  for (std::thread& daemon : daemons) daemon.join();
  for (auto& store : stores) {
    ASSERT_TRUE(store) << describe(store.error());
    EXPECT_EQ(need((*store)->telemetry(7, {}, {100, {}})).samples.size(), 30u);
  }
  EXPECT_EQ(ask("SELECT count(*)::text FROM trace"), "10");
  EXPECT_EQ(ask("SELECT schema_version::text FROM joulecast_store"), std::to_string(postgres_schema_version));
}

TEST_F(PostgresSchemaTest, FailedMigrationKeepsOldTables) {
  make_store_of_version_2(folder_);
  fill_version_2(url(), now_utime_us - 2 * day_us, now_utime_us);
  ask("CREATE TABLE mission_day (something BIGINT)");
  EXPECT_FALSE(open_store(url()));
  EXPECT_EQ(ask("SELECT schema_version::text FROM joulecast_store"), "2");
  EXPECT_EQ(ask("SELECT count(*)::text FROM trace"), "10");
  ask("DROP TABLE mission_day");
  EXPECT_TRUE(open_store(url()));
}

// Citus' documentation of create_distributed_table(): "Creating and Modifying Distributed Objects", "SQL
// Support and Workarounds". Each query returns the violations of a rule.
class CitusRules : public PostgresSchemaTest {
 protected:
  void SetUp() override { need(open_store(url())).reset(); }

  static constexpr const char* with_tables =
      "WITH tables AS (SELECT oid, relname::text, relkind, relispartition, EXISTS (SELECT 1 FROM "
      "pg_attribute "
      "WHERE attrelid = pg_class.oid AND attname = 'robot_id') AND relname NOT IN ('event', 'cluster_hears', "
      "'cluster_lease', 'cluster_live') AS distributed FROM pg_class WHERE relnamespace = "
      "current_schema()::regnamespace AND relkind IN ('r', 'p')) ";
  std::vector<std::string> broken(const std::string& sql) const { return column(with_tables + sql); }
};

TEST_F(CitusRules, TablesAreDistributedOrLocal) {
  EXPECT_THAT(
      broken("SELECT relname FROM tables WHERE distributed AND NOT relispartition ORDER BY 1"),
      ElementsAre("covariate_chunk", "diagnosis", "diagnosis_report", "energy_state", "learned", "mission",
                  "mission_day", "model", "proposal", "robot", "telemetry_chunk", "trace"));
  EXPECT_THAT(
      broken("SELECT relname FROM tables WHERE NOT distributed ORDER BY 1"),
      ElementsAre("audit", "cluster_hears", "cluster_job", "cluster_lease", "cluster_live", "cluster_node",
                  "cluster_writer", "event", "joulecast_store", "request_answer", "taken_spool"));
}

TEST_F(CitusRules, RobotColumnsHaveOneType) {
  EXPECT_THAT(
      broken("SELECT relname FROM tables JOIN pg_attribute ON attrelid = tables.oid WHERE distributed AND "
             "attname = 'robot_id' AND NOT (attnotnull AND atttypid = 'text'::regtype AND attcollation = "
             "(SELECT oid FROM pg_collation WHERE collname = 'C'))"),
      IsEmpty());
}

TEST_F(CitusRules, KeysBeginWithTheRobot) {
  const std::string first =
      "(SELECT attname FROM pg_attribute WHERE attrelid = indrelid AND attnum = indkey[0])";
  EXPECT_THAT(
      broken("SELECT relname FROM tables WHERE distributed AND NOT EXISTS (SELECT 1 FROM pg_index WHERE "
             "indrelid = tables.oid AND indisprimary AND " +
             first + " = 'robot_id')"),
      IsEmpty());
  EXPECT_THAT(
      broken("SELECT indexrelid::regclass::text FROM pg_index JOIN tables ON indrelid = tables.oid WHERE "
             "distributed AND indisunique AND " +
             first + " <> 'robot_id'"),
      IsEmpty());
  EXPECT_THAT(broken("SELECT conname::text FROM pg_constraint JOIN tables ON conrelid = tables.oid WHERE "
                     "distributed AND contype = 'x'"),
              IsEmpty());
}

TEST_F(CitusRules, ReferencesIncludeTheRobot) {
  EXPECT_THAT(
      broken("SELECT conname::text FROM pg_constraint JOIN tables AS a ON a.oid = conrelid JOIN tables AS b "
             "ON b.oid = confrelid WHERE contype = 'f' AND (a.distributed <> b.distributed OR a.distributed "
             "AND NOT EXISTS (SELECT 1 FROM generate_subscripts(conkey, 1) AS k JOIN pg_attribute AS x ON "
             "x.attrelid = conrelid AND x.attnum = conkey[k] JOIN pg_attribute AS y ON y.attrelid = "
             "confrelid AND y.attnum = confkey[k] WHERE x.attname = 'robot_id' AND y.attname = "
             "'robot_id'))"),
      IsEmpty());
  EXPECT_THAT(
      broken("SELECT conname::text FROM pg_constraint JOIN tables ON conrelid = tables.oid WHERE contype = "
             "'f' AND distributed AND (confdeltype IN ('n', 'd') OR confupdtype <> 'a')"),
      IsEmpty());
}

TEST_F(CitusRules, PartitionsAndIdentitiesAreSupported) {
  EXPECT_THAT(broken("SELECT relname FROM tables WHERE relispartition AND relkind = 'p'"), IsEmpty());
  EXPECT_THAT(
      broken("SELECT relname FROM tables JOIN pg_attribute ON attrelid = tables.oid WHERE distributed AND "
             "attidentity <> '' AND atttypid <> 'bigint'::regtype"),
      IsEmpty());
}

// See deploy/documents/postgresql.md for this one.
TEST_F(CitusRules, OneTriggerMustBeAllowed) {
  EXPECT_THAT(
      broken("SELECT tgname::text FROM pg_trigger JOIN tables ON tgrelid = tables.oid WHERE distributed AND "
             "NOT tgisinternal"),
      ElementsAre("model_is_immutable"));
}

}  // namespace
}  // namespace joulecast::history

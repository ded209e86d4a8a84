// The tables in PostgreSQL according to its catalogue: creation, migration to a next version, and Citus'
// requirements on tables that are distributed by robot.

#include "history/postgres_schema.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <thread>

#include "history/open_store.h"
#include "history/postgres.h"
#include "history/postgres_store.h"
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

// The next version of the tables, of one more column.
std::vector<Migration> next_version(std::string_view sql) {
  return {{postgres_schema().version, sql}};
}

TEST_F(PostgresSchemaTest, NextVersionKeepsTheTables) {
  need(open_store(url())).reset();
  ask("INSERT INTO robot VALUES ('amr-1', 1, NULL)");
  const auto steps = next_version("ALTER TABLE robot ADD COLUMN colour TEXT");
  PostgresDatabase database(url(), "test");
  const Schema next{postgres_schema().version + 1, {}, steps};
  for (int start = 0; start < 2; ++start) {
    const auto brought = bring_to_postgres_schema(database, next);
    ASSERT_TRUE(brought) << describe(brought.error());
    EXPECT_EQ(ask("SELECT schema_version::text FROM joulecast_store"), std::to_string(next.version));
    EXPECT_EQ(ask("SELECT robot_id FROM robot WHERE colour IS NULL"), "amr-1");
  }
  EXPECT_FALSE(open_store(url())) << "the tables are newer than this program";
}

TEST_F(PostgresSchemaTest, FailedMigrationKeepsOldTables) {
  need(open_store(url())).reset();
  ask("INSERT INTO robot VALUES ('amr-1', 1, NULL)");
  const auto steps = next_version("DELETE FROM robot; ALTER TABLE nowhere ADD COLUMN x TEXT");
  PostgresDatabase database(url(), "test");
  EXPECT_THROW((void)bring_to_postgres_schema(database, Schema{postgres_schema().version + 1, {}, steps}),
               SqlError);
  EXPECT_EQ(ask("SELECT schema_version::text FROM joulecast_store"),
            std::to_string(postgres_schema().version));
  EXPECT_EQ(ask("SELECT robot_id FROM robot"), "amr-1");
  EXPECT_TRUE(open_store(url()));
}

TEST_F(PostgresSchemaTest, RejectsTablesOfDevelopmentVersions) {
  need(open_store(url())).reset();
  ask("UPDATE joulecast_store SET schema_version = 4");
  const auto opened = open_store(url());
  ASSERT_FALSE(opened);
  EXPECT_EQ(opened.error().fault, Fault::conflict);
  EXPECT_EQ(opened.error().message, "store of a development version: copy it with the build that wrote it");
  EXPECT_EQ(ask("SELECT schema_version::text FROM joulecast_store"), "4");
}

TEST_F(PostgresSchemaTest, OneOfTwoDaemonsCreates) {
  std::vector<std::thread> daemons;
  std::vector<Result<std::unique_ptr<Store>>> stores(2);
  const std::string url = this->url();
  for (auto& store : stores)
    daemons.emplace_back([&] { store = open_shared_store(url, new_writer_name(), {}); });
  for (std::thread& daemon : daemons) daemon.join();
  for (auto& store : stores) EXPECT_TRUE(store) << describe(store.error());
  EXPECT_EQ(ask("SELECT count(*)::text FROM joulecast_store"), "1");
  EXPECT_EQ(ask("SELECT schema_version::text FROM joulecast_store"),
            std::to_string(postgres_schema().version));
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
  EXPECT_THAT(broken("SELECT relname FROM tables WHERE NOT distributed ORDER BY 1"),
              ElementsAre("audit", "cluster_hears", "cluster_job", "cluster_lease", "cluster_live",
                          "cluster_node", "cluster_writer", "event", "floor_plan", "joulecast_store",
                          "request_answer", "taken_spool"));
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

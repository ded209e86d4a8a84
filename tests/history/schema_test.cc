#include "history/schema.h"

#include <gtest/gtest.h>

#include <fstream>
#include <sstream>
#include <vector>

#include "history/sqlite.h"
#include "temporary_store.h"

namespace joulecast::history {
namespace {

const Migration steps[] = {
    {0, "CREATE TABLE colour (name TEXT NOT NULL) STRICT; INSERT INTO colour VALUES ('red');"},
    {1, "ALTER TABLE colour ADD COLUMN hue_deg REAL; UPDATE colour SET hue_deg = 0;"},
    {2, "UPDATE colour SET name = upper(name);"},
};
const Schema third{3, "CREATE TABLE colour (name TEXT NOT NULL, hue_deg REAL) STRICT;", steps};

class SchemaTest : public ::testing::Test {
 protected:
  SqliteDatabase open() const { return {folder_.file("test.db"), OpenMode::read_write_create, 100}; }

  TemporaryFolder folder_;
};

// A store's file at an older version, as the program of that time left it.
void make_old(Database& database, std::int64_t version) {
  for (std::int64_t k = 0; k < version; ++k) database.execute(std::string(steps[k].sql));
  database.execute("PRAGMA application_id = " + std::to_string(store_application_id));
  database.execute("PRAGMA user_version = " + std::to_string(version));
}

TEST_F(SchemaTest, CreatesTheNewestVersion) {
  SqliteDatabase database = open();
  ASSERT_TRUE(bring_to_schema(database, third));
  EXPECT_EQ(database.integer("PRAGMA user_version"), 3);
  EXPECT_EQ(database.integer("PRAGMA application_id"), store_application_id);
  EXPECT_EQ(database.integer("SELECT count(*) FROM colour"), 0);
  ASSERT_TRUE(bring_to_schema(database, third));
}

TEST_F(SchemaTest, MigratesFromEveryOlderVersion) {
  for (std::int64_t version = 0; version < 3; ++version) {
    const TemporaryFolder folder;
    SqliteDatabase database(folder.file("old.db"), OpenMode::read_write_create, 100);
    make_old(database, version);
    const auto brought = bring_to_schema(database, third);
    ASSERT_TRUE(brought) << version << describe(brought.error());
    EXPECT_EQ(database.integer("PRAGMA user_version"), 3);
    EXPECT_EQ(database.text("SELECT name || hue_deg FROM colour"), "RED0.0");
  }
}

TEST_F(SchemaTest, AFailingMigrationChangesNothing) {
  const Migration broken[] = {steps[0], steps[1], {2, "DELETE FROM colour; UPDATE nowhere SET x = 1;"}};
  SqliteDatabase database = open();
  make_old(database, 1);
  EXPECT_THROW((void)bring_to_schema(database, Schema{3, third.sql, broken}), SqlError);
  EXPECT_FALSE(database.in_transaction());
  EXPECT_EQ(database.integer("PRAGMA user_version"), 1);
  EXPECT_EQ(database.integer("SELECT count(*) FROM colour"), 1);
  EXPECT_EQ(database.integer("SELECT count(*) FROM pragma_table_info('colour')"), 1);
  EXPECT_TRUE(bring_to_schema(database, third));
}

TEST_F(SchemaTest, RejectsNewerFilesNamingVersions) {
  SqliteDatabase database = open();
  make_old(database, 1);
  database.execute("PRAGMA user_version = 4");
  const auto brought = bring_to_schema(database, third);
  ASSERT_FALSE(brought);
  EXPECT_EQ(brought.error().fault, Fault::conflict);
  EXPECT_NE(brought.error().message.find("version 4 is newer than version 3"), std::string::npos);
  EXPECT_EQ(database.integer("PRAGMA user_version"), 4);
}

TEST_F(SchemaTest, RejectsFilesBeforeTheList) {
  SqliteDatabase database = open();
  make_old(database, 1);
  const auto brought = bring_to_schema(database, Schema{3, third.sql, std::span(steps).subspan(2)});
  ASSERT_FALSE(brought);
  EXPECT_EQ(brought.error().fault, Fault::conflict);
  EXPECT_EQ(database.integer("PRAGMA user_version"), 1);
}

TEST_F(SchemaTest, RejectsForeignDatabases) {
  SqliteDatabase database = open();
  database.execute("CREATE TABLE something (x)");
  const auto brought = bring_to_schema(database, third);
  ASSERT_FALSE(brought);
  EXPECT_EQ(brought.error().fault, Fault::corrupt);
  EXPECT_EQ(database.integer("PRAGMA application_id"), 0);
}

TEST_F(SchemaTest, MigrationsReachTheVersion) {
  std::int64_t next =
      store_schema().migrations.empty() ? store_schema().version : store_schema().migrations.front().from;
  for (const Migration& migration : store_schema().migrations) EXPECT_EQ(migration.from, next++);
  EXPECT_EQ(next, store_schema().version);
}

std::string column_list(Database& database) {
  return database.text(
      "SELECT group_concat(line, '; ') FROM (SELECT t.name || '.' || c.name || ' ' || c.type || ' ' || "
      "c.\"notnull\" || ' ' || c.pk AS line FROM pragma_table_list t JOIN pragma_table_info(t.name) c WHERE "
      "t.schema = 'main' AND t.name NOT LIKE 'sqlite_%' ORDER BY t.name, c.name)");
}

TEST_F(SchemaTest, MigratedSchemaEqualsNewOne) {
  std::ifstream file(JOULECAST_SOURCE_DIR "/tests/history/store_v1.sql");
  std::stringstream text;
  text << file.rdbuf();
  SqliteDatabase old = open();
  old.execute(text.str());
  old.execute(
      "INSERT INTO robot VALUES ('amr-1', 1, NULL); INSERT INTO model VALUES ('amr-1', 1, 1, 'file', '', "
      "NULL, '{}'); UPDATE robot SET active_version = 1;");
  old.execute("PRAGMA application_id = " + std::to_string(store_application_id));
  old.execute("PRAGMA user_version = 1");
  const auto brought = bring_to_schema(old, store_schema());
  ASSERT_TRUE(brought) << describe(brought.error());
  SqliteDatabase fresh(folder_.file("fresh.db"), OpenMode::read_write_create, 100);
  ASSERT_TRUE(bring_to_schema(fresh, store_schema()));
  EXPECT_EQ(column_list(old), column_list(fresh));
  EXPECT_EQ(old.text("SELECT group_concat(name) FROM (SELECT name FROM sqlite_schema WHERE type <> 'table' "
                     "ORDER BY name)"),
            fresh.text("SELECT group_concat(name) FROM (SELECT name FROM sqlite_schema WHERE type <> 'table' "
                       "ORDER BY name)"));
  EXPECT_EQ(old.integer("SELECT evidence_json IS NULL FROM model"), 1);
  EXPECT_TRUE(schema_differences(old, store_schema()).empty())
      << schema_differences(old, store_schema()).front();
  EXPECT_EQ(old.integer("SELECT count(*) FROM audit"), 0);
}

TEST_F(SchemaTest, RestoresTriggersAndIndexes) {
  SqliteDatabase database = open();
  ASSERT_TRUE(bring_to_schema(database, store_schema()));
  EXPECT_TRUE(schema_differences(database, store_schema()).empty());
  database.execute(
      "DROP TRIGGER audit_keeps_entries; DROP TRIGGER audit_keeps_content; DROP INDEX diagnosis_by_robot; "
      "CREATE TRIGGER audit_keeps_content BEFORE UPDATE ON audit BEGIN SELECT 1; END; "
      "CREATE TRIGGER \"eats \"\"telemetry\" AFTER INSERT ON event BEGIN DELETE FROM telemetry_chunk; END; "
      "CREATE INDEX own ON event (utime_us)");
  EXPECT_EQ(schema_differences(database, store_schema()),
            (std::vector<std::string>{
                "index diagnosis_by_robot is missing", "trigger audit_keeps_content was changed",
                "trigger audit_keeps_entries is missing", "trigger eats \"telemetry was added"}));
  ASSERT_TRUE(bring_to_schema(database, store_schema()));
  EXPECT_TRUE(schema_differences(database, store_schema()).empty());
  EXPECT_EQ(database.integer("SELECT count(*) FROM sqlite_schema WHERE name = 'own'"), 1);
  EXPECT_EQ(database.text("SELECT action FROM audit"), "schema_restored");
  EXPECT_NE(database.text("SELECT detail_json FROM audit").find("audit_keeps_entries is missing"),
            std::string::npos);
  EXPECT_THROW(database.execute("DELETE FROM audit"), SqlError);
  ASSERT_TRUE(bring_to_schema(database, store_schema()));
  EXPECT_EQ(database.integer("SELECT count(*) FROM audit"), 1);
}

TEST_F(SchemaTest, VersionFourDiagnosesGetSummaries) {
  std::ifstream file(JOULECAST_SOURCE_DIR "/tests/history/store_v1.sql");
  std::stringstream text;
  text << file.rdbuf();
  SqliteDatabase database = open();
  database.execute(text.str());
  database.execute("PRAGMA application_id = " + std::to_string(store_application_id));
  database.execute("PRAGMA user_version = 1");
  ASSERT_TRUE(bring_to_schema(database, Schema{4, {}, store_schema().migrations.first(3)}));
  ASSERT_EQ(database.integer("PRAGMA user_version"), 4);
  database.execute(
      "INSERT INTO robot VALUES ('amr-1', 1, NULL);"
      "INSERT INTO diagnosis (diagnosis_id, robot_id, created_utime_us, state, cause, request_json, "
      "fitted_on, "
      "held_back, error, result_json) VALUES "
      "(1, 'amr-1', 1, 'done', 'request', '{}', '[]', '[]', '', '{\"verdict\": \"effects\", \"gap\": {\"a\": "
      "0.5}, "
      "\"effects\": [{\"id\": \"drag\", \"probability\": 0.75, \"share\": null, \"more\": [1, 2]}], "
      "\"shrinkage\": null, \"long\": [1, 2, 3]}'),"
      "(2, 'amr-1', 1, 'failed', 'request', '{}', '[]', '[]', 'x', NULL)");
  const auto brought = bring_to_schema(database, store_schema());
  ASSERT_TRUE(brought) << describe(brought.error());
  EXPECT_EQ(database.text("SELECT summary_json FROM diagnosis WHERE diagnosis_id = 1"),
            R"({"effects":[{"id":"drag","probability":0.75,"share":null}],"gap":{"a":0.5},)"
            R"("shrinkage":null,"verdict":"effects"})");
  EXPECT_EQ(database.integer("SELECT summary_json IS NULL FROM diagnosis WHERE diagnosis_id = 2"), 1);
}

TEST_F(SchemaTest, VersionFiveMissionsHaveNoCovariates) {
  std::ifstream file(JOULECAST_SOURCE_DIR "/tests/history/store_v1.sql");
  std::stringstream text;
  text << file.rdbuf();
  SqliteDatabase database = open();
  database.execute(text.str());
  database.execute("PRAGMA application_id = " + std::to_string(store_application_id));
  database.execute("PRAGMA user_version = 1");
  ASSERT_TRUE(bring_to_schema(database, Schema{5, {}, store_schema().migrations.first(4)}));
  database.execute(
      "INSERT INTO robot VALUES ('amr-1', 1, NULL);"
      "INSERT INTO mission (mission_key, robot_id, mission_id, start_utime_us, end_utime_us, state, "
      "implicit, "
      "incomplete, incomplete_reason, note, samples, sample_faults, gap_count) VALUES (3, 'amr-1', 'm', 1, "
      "2, "
      "'open', 0, 0, '', '', 0, '{}', 0)");
  const auto brought = bring_to_schema(database, store_schema());
  ASSERT_TRUE(brought) << describe(brought.error());
  EXPECT_EQ(database.integer("SELECT covariates_json IS NULL FROM mission"), 1);
  EXPECT_EQ(database.integer("SELECT covariate_changes FROM mission"), 0);
  EXPECT_EQ(database.integer("SELECT count(*) FROM covariate_chunk"), 0);
}

TEST_F(SchemaTest, EmbedsTheSchemaFile) {
  std::ifstream file(JOULECAST_SOURCE_DIR "/schemas/store.sql");
  std::stringstream text;
  text << file.rdbuf();
  ASSERT_FALSE(text.str().empty());
  EXPECT_EQ(store_schema().sql, text.str());
}

TEST_F(SchemaTest, EveryTableIsStrict) {
  SqliteDatabase database = open();
  ASSERT_TRUE(bring_to_schema(database, store_schema()));
  EXPECT_GT(database.integer("SELECT count(*) FROM pragma_table_list WHERE schema = 'main'"), 5);
  EXPECT_EQ(database.text("SELECT group_concat(name) FROM pragma_table_list WHERE schema = 'main' AND "
                          "type = 'table' AND NOT strict AND name NOT LIKE 'sqlite_%'"),
            "");
}

}  // namespace
}  // namespace joulecast::history

#include "history/schema.h"

#include <gtest/gtest.h>

#include <fstream>
#include <sstream>
#include <vector>

#include "history/sqlite.h"
#include "temporary_store.h"

namespace joulecast::history {
namespace {

const std::vector<Migration> steps{
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
  for (std::int64_t k = 0; k < version; ++k) database.execute(steps[k].sql);
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
  const std::vector<Migration> broken{
      steps[0], steps[1], {2, "DELETE FROM colour; UPDATE nowhere SET x = 1;"}};
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
  const auto brought = bring_to_schema(database, Schema{3, third.sql, {steps[2]}});
  ASSERT_FALSE(brought);
  EXPECT_EQ(brought.error().fault, Fault::conflict);
  EXPECT_EQ(brought.error().message, "store of a development version: copy it with the build that wrote it");
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

// The next version of the store, of one more column.
TEST_F(SchemaTest, NextVersionKeepsTheStore) {
  const std::vector<Migration> next{{store_schema().version, "ALTER TABLE robot ADD COLUMN colour TEXT;"}};
  SqliteDatabase database = open();
  ASSERT_TRUE(bring_to_schema(database, store_schema()));
  database.execute(
      "INSERT INTO robot VALUES ('amr-1', 1, NULL); INSERT INTO model VALUES ('amr-1', 1, 1, 'file', '', "
      "NULL, '{}', NULL); UPDATE robot SET active_version = 1;");
  const std::string sql = std::string(store_schema().sql).append(next[0].sql);
  const auto brought = bring_to_schema(database, Schema{store_schema().version + 1, sql, next});
  ASSERT_TRUE(brought) << describe(brought.error());
  EXPECT_EQ(database.integer("PRAGMA user_version"), store_schema().version + 1);
  EXPECT_TRUE(schema_differences(database, {0, sql, {}}).empty());
  EXPECT_EQ(database.integer("SELECT active_version FROM robot WHERE colour IS NULL"), 1);
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

TEST_F(SchemaTest, RejectsStoresOfDevelopmentVersions) {
  SqliteDatabase database = open();
  ASSERT_TRUE(bring_to_schema(database, store_schema()));
  database.execute("PRAGMA user_version = 8");
  const auto brought = bring_to_schema(database, store_schema());
  ASSERT_FALSE(brought);
  EXPECT_EQ(brought.error().fault, Fault::conflict);
  EXPECT_EQ(brought.error().message, "store of a development version: copy it with the build that wrote it");
  EXPECT_EQ(database.integer("PRAGMA user_version"), 8);
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

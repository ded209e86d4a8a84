// The tables in PostgreSQL: creation, the translation of the common schema, and migration to a next version.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <thread>

#include "history/open_store.h"
#include "history/postgres.h"
#include "history/schema.h"
#include "history/sqlite.h"
#include "postgres_server.h"

namespace joulecast::history {
namespace {

class PostgresSchemaTest : public ::testing::Test {
 protected:
  std::string url() const { return postgres_url(folder_); }
  std::string ask(const std::string& sql) const { return as_administrator(folder_, sql); }

  TemporaryFolder folder_;
};

// The next version of the tables, of one more column.
std::vector<Migration> next_version(std::string_view sql) {
  return {{postgres_schema().version, std::string(sql)}};
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

// Of every table of the schema that both databases share: its columns with their types, and its key.
TEST_F(PostgresSchemaTest, TablesAreTheSameAsInSqlite) {
  need(open_store(url())).reset();
  SqliteDatabase file(":memory:", OpenMode::read_write_create, 0);
  file.execute(std::string(store_schema().sql));
  PostgresDatabase server(url(), "test");
  const auto lines = [](Database& database, const char* sql) {
    std::vector<std::string> all;
    for (Rows rows(database.statement(sql)); rows.next();) all.push_back(rows.text());
    return all;
  };
  const auto columns = lines(
      file,
      "SELECT t.name || '.' || c.name || ' ' || CASE c.type WHEN 'INTEGER' THEN 'bigint' WHEN 'REAL' THEN "
      "'double precision' WHEN 'BLOB' THEN 'bytea' ELSE 'text C' END || CASE c.\"notnull\" WHEN 1 THEN ' NOT "
      "NULL' ELSE '' END || CASE c.pk WHEN 0 THEN '' ELSE ' key ' || c.pk END FROM pragma_table_list AS t, "
      "pragma_table_info(t.name) AS c WHERE t.name NOT LIKE 'sqlite_%' ORDER BY 1");
  EXPECT_GT(columns.size(), 150u);
  EXPECT_EQ(
      lines(
          server,
          "SELECT relname || '.' || attname || ' ' || format_type(atttypid, atttypmod) || coalesce(' ' || "
          "collname, '') || CASE WHEN attnotnull THEN ' NOT NULL' ELSE '' END || coalesce(' key ' || "
          "array_position(conkey, attnum), '') FROM pg_class JOIN pg_attribute ON attrelid = pg_class.oid "
          "LEFT JOIN pg_constraint ON conrelid = pg_class.oid AND contype = 'p' LEFT JOIN pg_collation ON "
          "pg_collation.oid = attcollation WHERE relkind = 'r' AND relnamespace = "
          "current_schema()::regnamespace AND attnum > 0 AND relname NOT LIKE 'cluster\\_%' AND relname <> "
          "'mission_day' AND attname <> 'schema_version' ORDER BY (relname || '.' || attname || ' ') COLLATE "
          "\"C\""),
      columns);
  const auto indexes = "SELECT name FROM sqlite_schema WHERE type = 'index' AND sql IS NOT NULL ORDER BY 1";
  EXPECT_EQ(lines(server,
                  "SELECT relname::text FROM pg_class JOIN pg_index ON indexrelid = pg_class.oid WHERE "
                  "relnamespace = current_schema()::regnamespace AND NOT indisunique AND relname <> "
                  "'mission_day_by_day' ORDER BY relname COLLATE \"C\""),
            lines(file, indexes));
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
    daemons.emplace_back([&] { store = open_store(url, {.shared_writer = new_writer_name()}); });
  for (std::thread& daemon : daemons) daemon.join();
  for (auto& store : stores) EXPECT_TRUE(store) << describe(store.error());
  EXPECT_EQ(ask("SELECT count(*)::text FROM joulecast_store"), "1");
  EXPECT_EQ(ask("SELECT schema_version::text FROM joulecast_store"),
            std::to_string(postgres_schema().version));
}

}  // namespace
}  // namespace joulecast::history

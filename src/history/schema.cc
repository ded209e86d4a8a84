#include "history/schema.h"

#include <re2/re2.h>

#include <boost/algorithm/string/replace.hpp>
#include <map>
#include <sstream>

#include "base/host_clock.h"
#include "base/json_writer.h"
#include "base/try.h"
#include "history/audit.h"
#include "history/mission_days.h"
#include "history/sql_rows.h"
#include "history/sqlite.h"

namespace joulecast::history {
namespace {

// A schema's parts by kind and name: of tables the columns, else the statement without blanks and comments.
std::map<std::string, std::string> objects_of(Database& database) {
  std::map<std::string, std::string> objects;
  Rows rows(database,
            "SELECT type || ' ' || s.name, type = 'table', coalesce(CASE type WHEN 'table' THEN (SELECT "
            "group_concat(name) FROM (SELECT c.name FROM pragma_table_info(s.name) AS c ORDER BY c.name)) "
            "ELSE sql END, '') FROM sqlite_schema AS s WHERE s.name NOT LIKE 'sqlite_%'");
  while (rows.next()) {
    const std::string name = rows.text();
    const bool table = rows.boolean();
    static const RE2 ignored("--[^\n]*|\\s+");
    std::string& object = objects[name] = rows.text();
    if (!table) RE2::GlobalReplace(&object, ignored, "");
  }
  return objects;
}

// Makes triggers and indexes those of the schema. Others are another program's; the audit records it.
void restore_objects(Database& database, const Schema& schema) {
  std::vector<std::string> differences = schema_differences(database, schema);
  std::erase_if(differences, [](const std::string& difference) {
    return !difference.starts_with("trigger ") &&
           !(difference.starts_with("index ") && difference.ends_with(" is missing"));
  });
  if (differences.empty()) return;
  const auto names = [](Database& of, const char* type) {
    Rows rows(of, "SELECT name, sql FROM sqlite_schema WHERE sql IS NOT NULL AND type = ?", type);
    return read_by_name<std::map<std::string, std::string>>(rows);
  };
  SqliteDatabase made(":memory:", OpenMode::read_write_create, 0);
  made.execute(std::string(schema.sql));
  for (const auto& [name, sql] : names(database, "trigger"))
    database.execute("DROP TRIGGER \"" + boost::replace_all_copy(name, "\"", "\"\"") + "\"");
  for (const auto& [name, sql] : names(made, "trigger")) database.execute(sql);
  const auto indexes = names(database, "index");
  for (const auto& [name, sql] : names(made, "index"))
    if (!indexes.contains(name)) database.execute(sql);
  if (!database.has_table("audit")) return;
  JsonWriter detail;
  detail.begin_object().array("differences", differences).end_object();
  append_audit(database, {0, host_utime_us(), "", "", "", "schema_restored", detail.take(), ""});
}

// The schema of a database whose version before these changes is `version`.
Schema with_changes(
    std::int64_t version, std::string_view sql,
    std::string (*in_dialect)(std::string) = [](std::string change) { return change; }) {
  // Changes of schemas/store.sql since the first release, in its dialect. Each makes the next version.
  const std::vector<std::string> changes{};
  Schema schema{version, sql, {}};
  for (const std::string& change : changes)
    schema.migrations.push_back({schema.version++, in_dialect(change)});
  return schema;
}

}  // namespace

extern const std::string_view store_sql;  // schemas/store.sql, embedded at build

const Schema& store_schema() {
  static const Schema schema = with_changes(10, store_sql);
  return schema;
}

const std::vector<Table>& store_tables() {
  static const std::vector<Table> tables = [] {
    std::vector<Table> all;
    const RE2 table("CREATE TABLE (\\w+) \\("), column("  (\\w+) (TEXT|INTEGER|REAL|BLOB)\\b.*"),
        key("  PRIMARY KEY \\((.*)\\),?");
    std::istringstream lines{std::string(store_sql)};
    for (std::string line, name, type; std::getline(lines, line);) {
      if (RE2::FullMatch(line, table, &name)) all.emplace_back().name = name;
      if (RE2::FullMatch(line, key, &name)) all.back().key = column_names(name);
      if (!RE2::FullMatch(line, column, &name, &type)) continue;
      all.back().columns.emplace_back(name, type);
      if (line.find(" PRIMARY KEY") != std::string::npos) all.back().key = {name};
    }
    return all;
  }();
  return tables;
}

std::vector<std::string> schema_differences(Database& database, const Schema& schema) {
  SqliteDatabase made(":memory:", OpenMode::read_write_create, 0);
  made.execute(std::string(schema.sql));
  const auto expected = objects_of(made), found = objects_of(database);
  std::vector<std::string> differences;
  for (const auto& [name, content] : expected) {
    const auto same = found.find(name);
    if (same == found.end()) differences.push_back(name + " is missing");
    if (same != found.end() && same->second != content) differences.push_back(name + " was changed");
  }
  for (const auto& [name, content] : found)
    if (!expected.contains(name) && (name.starts_with("trigger ") || name.starts_with("view ")))
      differences.push_back(name + " was added");
  return differences;
}

Result<void> check_older(const Schema& schema, std::int64_t version) {
  if (!schema.migrations.empty() && version >= schema.migrations.front().from) return {};
  return fail(Fault::conflict, "database",
              "store of a development version: copy it with the build that wrote it");
}

Result<void> migrate(Database& database, const Schema& schema, std::int64_t version) {
  if (version > schema.version)
    return fail(Fault::conflict, "database",
                "schema version " + std::to_string(version) + " is newer than version " +
                    std::to_string(schema.version) + ", the newest that this program supports");
  if (version == schema.version) return {};
  TRY(check_older(schema, version));
  for (const Migration& migration : schema.migrations)
    if (migration.from >= version) database.execute(migration.sql);
  return {};
}

Result<void> bring_to_schema(Database& database, const Schema& schema) {
  Transaction transaction(database, Database::Access::write);
  const std::int64_t version = database.integer("PRAGMA user_version");
  const std::int64_t application = database.integer("PRAGMA application_id");
  const bool empty = database.integer("SELECT count(*) FROM sqlite_schema") == 0;
  if (empty && version == 0 && application == 0) {
    database.execute(std::string(schema.sql));
    database.execute("PRAGMA application_id = " + std::to_string(store_application_id));
  } else if (application != store_application_id) {
    return fail(Fault::corrupt, "database", "the file is an SQLite database, but not a joulecast store");
  } else {
    TRY(migrate(database, schema, version));
    if (version < schema.version && database.integer("SELECT count(*) FROM pragma_foreign_key_check") != 0)
      return fail(Fault::corrupt, "database", "a reference does not hold after migration");
  }
  restore_objects(database, schema);
  database.execute("PRAGMA user_version = " + std::to_string(schema.version));
  transaction.commit();
  return {};
}

extern const std::string_view postgres_store_sql;    // schemas/store.postgresql.sql
extern const std::string_view postgres_cluster_sql;  // schemas/cluster.postgresql.sql

std::string in_postgres(std::string sql) {
  static const std::pair<const char*, const char*> words[] = {
      {"CREATE TRIGGER [^;]*;\\s*END;|INSERT INTO joulecast_store[^;]*;", ""},
      {"\\) STRICT(, WITHOUT ROWID)?;", ");"},
      // The order in which the tables are created; store.postgresql.sql adds it.
      {",(  --[^\n]*)?\n  FOREIGN KEY \\(robot_id, active_version\\)[^\n]*", "\\1"},
      // The check of each row costs several times what storing it does. A program that stores such rows holds
      // the mission's row locked, and one that deletes the mission deletes them after it.
      {" REFERENCES mission \\(mission_key\\) ON DELETE CASCADE", ""},
      {"INTEGER NOT NULL PRIMARY KEY( AUTOINCREMENT)?,",
       "BIGINT GENERATED BY DEFAULT AS IDENTITY PRIMARY KEY,"},
      {"json_valid\\((\\w+)\\)", "\\1::json IS NOT NULL"},
      {"\\bINTEGER\\b", "BIGINT"},
      {"\\bREAL\\b", "DOUBLE PRECISION"},
      {"\\bBLOB\\b", "BYTEA"},
      // As SQLite compares texts: by their bytes.
      {"\\bTEXT\\b", "TEXT COLLATE \"C\""}};
  for (const auto& [word, instead] : words) RE2::GlobalReplace(&sql, word, instead);
  return sql;
}

const Schema& postgres_schema() {
  static const std::string sql = in_postgres(std::string(store_sql))
                                     .append(postgres_store_sql)
                                     .append(mission_day_sql())
                                     .append(postgres_cluster_sql);
  static const Schema schema = with_changes(7, sql, in_postgres);
  return schema;
}

Result<void> bring_to_postgres_schema(Database& database, const Schema& schema) {
  Transaction transaction(database, Database::Access::write);
  const std::string version = std::to_string(schema.version);
  if (!database.has_table("joulecast_store")) {
    database.execute(std::string(schema.sql));
    database.execute(
        "INSERT INTO joulecast_store (one, identity, writer, batch, schema_version) VALUES (1, "
        "gen_random_uuid()::text, '', 0, " +
        version + ")");
  } else {
    const std::int64_t present = database.integer("SELECT schema_version FROM joulecast_store");
    TRY(migrate(database, schema, present));
    database.execute("UPDATE joulecast_store SET schema_version = " + version);
  }
  transaction.commit();
  return {};
}

}  // namespace joulecast::history

#pragma once

#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "base/error.h"
#include "history/sql.h"

namespace joulecast::history {

// One step from schema version `from` to from + 1.
struct Migration {
  std::int64_t from = 0;
  std::string sql;
};

// A schema as it is now, and the way to it from older files.
struct Schema {
  std::int64_t version = 0;
  std::string_view sql;               // makes an empty database one of `version`
  std::vector<Migration> migrations;  // ascending in `from`, without a hole up to version - 1; may be empty
};

// The schema of schemas/store.sql.
const Schema& store_schema();

// A table of schemas/store.sql.
struct Table {
  std::string name;
  std::vector<std::pair<std::string, std::string>> columns;  // name and SQLite's type
  std::vector<std::string> key;                              // columns of the primary key
};
// In an order in which no row comes before one that it refers to, but for a robot's active version.
const std::vector<Table>& store_tables();

// Checks that migrations begin at the older version or before. Fault::conflict: no release wrote the store.
Result<void> check_older(const Schema& schema, std::int64_t version);

// Runs the migrations from the version to the schema's, in the caller's transaction. Fault::conflict: the
// version is newer, or check_older(). Throws SqlError.
Result<void> migrate(Database& database, const Schema& schema, std::int64_t version);

// Marks the file as a joulecast store in SQLite's application_id: "JLCT".
inline constexpr std::int64_t store_application_id = 0x4a4c4354;

// How the database differs from the schema of its version: "trigger x is missing", "index y was changed".
// Tables and indexes of others are no difference.
std::vector<std::string> schema_differences(Database& database, const Schema& schema);

// Brings the database to the schema, all in one transaction: creates it in an empty file, migrates an older
// one, leaves the same one as it is but for triggers of other programs and missing triggers and indexes,
// which it restores, with an entry in the audit. Fault::conflict: the file is newer, or too old for the list.
// Fault::corrupt: it holds something else than a store. Throws SqlError.
Result<void> bring_to_schema(Database& database, const Schema& schema);

// Text of schemas/store.sql in PostgreSQL's dialect: types, collations, identities and checks.
std::string in_postgres(std::string sql);

// That of schemas/store.sql with store.postgresql.sql, mission_day_sql() and cluster.postgresql.sql.
const Schema& postgres_schema();

// Brings the current schema of a PostgreSQL database (the first of its search_path) to `schema`, all in one
// transaction: creates the tables where there are none, migrates older ones, leaves the same ones as they
// are. The caller holds the store's lock. Fault::conflict: the tables are newer, or of a development version.
// Throws SqlError.
Result<void> bring_to_postgres_schema(Database& database, const Schema& schema = postgres_schema());

}  // namespace joulecast::history

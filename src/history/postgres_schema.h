#pragma once

#include <string>

#include "base/error.h"
#include "history/schema.h"

namespace joulecast::history {

// Text of schemas/store.sql in PostgreSQL's dialect: types, collations, identities and checks.
std::string in_postgres(std::string sql);

// The schema of schemas/store.sql in PostgreSQL, with store.postgresql.sql, mission_day_sql() and
// cluster.postgresql.sql.
const Schema& postgres_schema();

// Brings the current schema of a PostgreSQL database (the first of its search_path) to `schema`, all in one
// transaction: creates the tables where there are none, migrates older ones, leaves the same ones as they
// are. The caller holds the store's lock. Fault::conflict: the tables are newer, or of a development version.
// Throws SqlError.
Result<void> bring_to_postgres_schema(Database& database, const Schema& schema = postgres_schema());

}  // namespace joulecast::history

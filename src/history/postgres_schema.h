#pragma once

#include "base/error.h"
#include "history/schema.h"

namespace joulecast::history {

// The schema of schemas/store.postgresql.sql, store_by_robot.postgresql.sql and cluster.postgresql.sql.
const Schema& postgres_schema();

// Brings the current schema of a PostgreSQL database (the first of its search_path) to `schema`, all in one
// transaction: creates the tables where there are none, migrates older ones, leaves the same ones as they
// are. The caller holds the store's lock. Fault::conflict: the tables are newer, or of a development version.
// Throws SqlError.
Result<void> bring_to_postgres_schema(Database& database, const Schema& schema = postgres_schema());

}  // namespace joulecast::history

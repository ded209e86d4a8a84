#pragma once

#include <cstdint>

#include "base/error.h"
#include "history/sql.h"

namespace joulecast::history {

inline constexpr std::int64_t postgres_schema_version = 5;

// Brings the current schema of a PostgreSQL database (the first of its search_path) to
// schemas/store.postgresql.sql, store_by_robot.postgresql.sql and cluster.postgresql.sql, all in one
// transaction: creates the tables where there are none, migrates older ones, leaves the same ones as they
// are. The caller holds the store's lock. Fault::conflict: the tables are newer. Throws SqlError.
Result<void> bring_to_postgres_schema(Database& database);

}  // namespace joulecast::history

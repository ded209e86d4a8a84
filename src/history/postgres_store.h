#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>

#include "base/error.h"
#include "history/open_store.h"
#include "history/sql.h"
#include "history/store.h"

namespace joulecast::history {

struct PostgresOptions {
  std::string url;                             // libpq's: postgresql://user@host1,host2/database?option=value
  std::size_t readers = 4;                     // connections for queries; further queries wait for one
  std::chrono::milliseconds lock_wait{3000};   // for another program's hold on the store to end
  std::function<std::int64_t()> now_utime_us;  // the clock that retention goes by; empty: the system's
  // If set: this program's name among those that write to the store at the same time, from new_writer_name().
  // All of them set it.
  std::string shared_writer;
  // How many commands were dropped for carrying this epoch of a robot's lease; called on apply()'s thread.
  std::function<void(const std::string& robot_id, Epoch epoch, std::uint64_t count)> on_dropped;
  std::chrono::milliseconds query_limit{0};  // each statement of a query; 0: unlimited
  StandbyOptions standby;
};

// Opens the store, creating or migrating its tables in the first schema of the connection's search_path. One
// program at a time holds it, by an advisory lock of its writing connection, or several with shared_writer.
// Fault::conflict: another program holds it, or its schema is newer than this program. Fault::unavailable: no
// server that accepts writes is reached.
Result<std::unique_ptr<Store>> open_postgres_store(const PostgresOptions& options);

// The same as tables, locked against every other program until released.
Result<std::shared_ptr<Database>> open_postgres_tables(const PostgresOptions& options);

}  // namespace joulecast::history

#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>

#include "base/error.h"
#include "history/sql.h"
#include "history/store.h"

namespace joulecast::history {

// The failures that an acknowledged commit survives.
enum class Durability {
  power_cut,   // SQLite's synchronous=FULL: its journal is written through to the disk at each commit
  process_end  // synchronous=NORMAL: a power cut loses the last commits, and damages nothing
};

struct SqliteOptions {
  std::string path;                     // of the database file; created when absent, its folder is not
  std::size_t readers = 4;              // connections for queries; further queries wait for one
  std::int64_t busy_timeout_ms = 2000;  // how long a lock of another process is waited for
  Durability durability = Durability::power_cut;
  std::function<std::int64_t()> now_utime_us;  // the clock that retention goes by; empty: the system's
};

// Opens the store, creating or migrating its schema. Fault::conflict: the file's schema is newer than this
// program. Fault::corrupt: the file is no database, or damaged. Fault::unavailable: it cannot be opened or
// written.
Result<std::unique_ptr<Store>> open_sqlite_store(const SqliteOptions& options);

// The same as tables, locked against every other program until released.
Result<std::shared_ptr<Database>> open_sqlite_tables(const SqliteOptions& options);

}  // namespace joulecast::history

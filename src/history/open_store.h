#pragma once

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <string_view>

#include "base/error.h"
#include "history/sql.h"
#include "history/sqlite.h"
#include "history/store.h"

namespace joulecast::history {

// The failures that an acknowledged commit survives.
enum class Durability {
  power_cut,   // SQLite's synchronous=FULL: its journal is written through to the disk at each commit
  process_end  // synchronous=NORMAL: a power cut loses the last commits, and damages nothing
};

struct StoreOptions {
  std::size_t readers = 4;                          // connections for queries; further queries wait for one
  std::int64_t busy_timeout_ms = 2000;              // how long a commit waits for a lock of another program
  std::function<std::int64_t()> now_utime_us = {};  // the clock that retention goes by; empty: the system's
  Durability durability = Durability::power_cut;    // of SQLite's file; a PostgreSQL has its own settings
  // Of a PostgreSQL alone, as those below.
  std::chrono::milliseconds lock_wait{3000};  // for another program's hold on the store to end
  std::chrono::milliseconds query_limit{0};   // each statement of a query; 0: unlimited
  // If set: this program's name, by new_writer_name(), among those that write at the same time; all set it.
  std::string shared_writer = {};
  // How many commands were dropped for carrying this epoch of a robot's lease; called on apply()'s thread.
  std::function<void(const std::string& robot_id, Epoch epoch, std::uint64_t count)> on_dropped = {};
};

// Whether the URL names a database of PostgreSQL, which libpq reads: postgresql://... or postgres://...
bool is_postgres_url(std::string_view url);

// Checks that it is a URL or path of a store, without connecting to it. Fault::invalid on "url".
Result<void> check_store_url(const std::string& url);

// Opens the store of a URL, creating or migrating its schema: sqlite:PATH, a PATH, or postgresql://..., whose
// tables are in the first schema of the search_path. One program at a time holds a store, or several a
// PostgreSQL with shared_writer. Fault::conflict: another program holds it, or its schema is newer than this
// program. Fault::corrupt: the file is no database, or damaged.
// Fault::unavailable: it cannot be opened or written. Fault::invalid: the URL, or an option that it excludes.
Result<std::unique_ptr<Store>> open_store(const std::string& url, const StoreOptions& options = {});
// The parts of that.
Result<std::unique_ptr<Store>> open_sqlite_store(const std::string& path, const StoreOptions& options = {});
Result<std::unique_ptr<Store>> open_postgres_store(const std::string& url, const StoreOptions& options);

// The same as tables, locked against every other program until released. With `must_exist` nothing is
// created: the errors are then also open_to_read()'s.
Result<std::shared_ptr<Database>> open_tables(const std::string& url, bool must_exist);
Result<std::shared_ptr<Database>> open_sqlite_tables(const std::string& path, const StoreOptions& options);
Result<std::shared_ptr<Database>> open_postgres_tables(const std::string& url, const StoreOptions& options);

// A read-only connection to the tables of a URL, also while another program holds them; migrates nothing.
// Fault::not_found if there is no such file, ::corrupt if it is no store, ::conflict if its schema is of
// another version than this program's.
Result<std::unique_ptr<Database>> open_to_read(const std::string& url);

// The same of a store's file; errors are on its path. `or_older`: of an earlier version, too.
Result<std::unique_ptr<SqliteDatabase>> open_file(const std::string& path,
                                                  OpenMode mode = OpenMode::read_only, bool or_older = false);

// The URL without its password, to be shown.
std::string shown_url(const std::string& url);

// The file that an sqlite URL or a path names.
std::string sqlite_path(const std::string& url);

}  // namespace joulecast::history

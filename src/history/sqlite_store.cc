#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <cstring>
#include <filesystem>
#include <optional>
#include <utility>
#include <vector>

#include "base/host_clock.h"
#include "base/try.h"
#include "history/audit.h"
#include "history/open_store.h"
#include "history/schema.h"
#include "history/sql_changes.h"
#include "history/sql_chunks.h"
#include "history/sql_queries.h"
#include "history/sql_store.h"
#include "history/sqlite.h"

namespace joulecast::history {
namespace {

// The files that were opened, identified by device and inode.
class OpenedFiles {
 public:
  explicit OpenedFiles(std::vector<std::string> paths) : paths_(std::move(paths)) {
    for (const std::string& path : paths_) opened_.push_back(identity_of(path));
  }

  // Whether the files can be found and written.
  Result<void> check() {
    TRY(check_place());
    for (const std::string& path : paths_) {
      if (::access(path.c_str(), W_OK) != 0)
        return fail(Fault::unavailable, "database", path + " cannot be written: " + std::strerror(errno));
    }
    return {};
  }

  // After unlink or replacement, writes reach no visible file; fail until restart.
  Result<void> check_place() {
    for (std::size_t k = 0; k < paths_.size() && lost_.empty(); ++k) {
      const Identity now = identity_of(paths_[k]);
      if (now != opened_[k])
        lost_ = paths_[k] + (now ? " was replaced" : " was deleted") +
                " under the running program; nothing is stored until it is started again";
    }
    if (!lost_.empty()) return fail(Fault::unavailable, "database", lost_);
    return {};
  }

 private:
  using Identity = std::optional<std::pair<dev_t, ino_t>>;
  static Identity identity_of(const std::string& path) {
    struct stat now {};
    if (stat(path.c_str(), &now) != 0) return std::nullopt;
    return std::pair(now.st_dev, now.st_ino);
  }

  std::vector<std::string> paths_;
  std::vector<Identity> opened_;
  std::string lost_;
};

void configure_writer(Database& database, Durability durability) {
  database.execute("PRAGMA journal_mode = WAL");
  database.execute(durability == Durability::power_cut ? "PRAGMA synchronous = FULL"
                                                       : "PRAGMA synchronous = NORMAL");
  database.execute("PRAGMA foreign_keys = ON");
  // Shrink a journal that grew during a long read.
  database.execute("PRAGMA journal_size_limit = 67108864");
}

bool deletes(const Command& command) {
  if (const auto* change = std::get_if<CommitChange>(&command))
    return change->change->command && deletes(*change->change->command);
  return std::holds_alternative<Prune>(command) || std::holds_alternative<PruneMissions>(command) ||
         std::holds_alternative<PruneEvents>(command) || std::holds_alternative<PruneAudit>(command) ||
         std::holds_alternative<RemoveRobot>(command);
}

// Free pages are used again; only a store that has shrunk gives them back to the disk, 16 MB at a time. A
// store of before incremental vacuum has none to give until it is restored from a backup.
void give_back(Database& database) {
  constexpr std::int64_t most_free_share = 8, pages = 4096;
  try {
    if (database.integer("PRAGMA freelist_count") * most_free_share > database.integer("PRAGMA page_count"))
      database.execute("PRAGMA incremental_vacuum(" + std::to_string(pages) + ")");
  } catch (const SqlError&) {
    // The changes are committed; the next ones try again.
  }
}

// Objects that must outlive the reading connections: the last one closed can fold the journal in.
struct OpenedDatabase {
  std::vector<std::unique_ptr<FileLock>> locks;
  std::unique_ptr<Database> writer;
};

class SqliteStore final : private OpenedDatabase, public SqlStore {
 public:
  SqliteStore(const std::string& path, const StoreOptions& options, OpenedDatabase opened)
      : OpenedDatabase(std::move(opened)),
        SqlStore(
            [path, wait = options.busy_timeout_ms] {
              return std::make_unique<SqliteDatabase>(path, OpenMode::read_only, wait);
            },
            options.readers, greatest_key(*writer)),
        path_(path),
        changes_(*writer, options.now_utime_us ? options.now_utime_us : host_utime_us),
        // The first query has opened the journal.
        files_({path_, path_ + "-wal"}) {
    set_mark(SqlChanges::mark_of(*writer));
  }

  Result<std::vector<Outcome>> apply(std::span<const Command> commands) override {
    TRY(files_.check());
    auto outcomes = guarded([&]() -> Result<std::vector<Outcome>> {
      std::vector<Outcome> done;
      ++batch_;
      const auto mark_batch = [this] {
        Rows(*writer, "UPDATE joulecast_store SET writer = ?, batch = ?", name_, batch_).run();
      };
      changes_.apply(commands, mark_batch, done);
      return done;
    });
    if (outcomes && std::ranges::any_of(commands, deletes)) give_back(*writer);
    // Nothing is acknowledged that went into a file which was deleted meanwhile. What was committed before
    // the folder became read-only is done.
    TRY(files_.check_place());
    if (outcomes) note_commit(commands, *outcomes, {mark().store, name_, batch_});
    return outcomes;
  }

  Result<void> check() override { return files_.check(); }

  Result<StoreSize> size() const override {
    return read([&](Database& database) -> Result<StoreSize> {
      StoreSize size;
      size.database_bytes = database.integer("PRAGMA page_count") * database.integer("PRAGMA page_size");
      std::error_code absent;
      const auto journal = std::filesystem::file_size(path_ + "-wal", absent);
      size.journal_bytes = absent ? 0 : static_cast<std::int64_t>(journal);
      size.telemetry_bytes = chunks::encoded_bytes(database);
      size.telemetry_chunks = chunks::count(database);
      size.missions = database.integer("SELECT count(*) FROM mission");
      size.audit_entries = count_audit(database);
      return size;
    });
  }

 private:
  const std::string path_, name_ = new_writer_name();
  std::int64_t batch_ = 0;  // the last one tried
  SqlChanges changes_;
  OpenedFiles files_;
};

Result<OpenedDatabase> open_database(const std::string& path, const StoreOptions& options) {
  // Their descriptors must be closed after SQLite's: closing one releases all locks on the file.
  TRY_ASSIGN(auto locks, lock_store(path));
  OpenedDatabase opened;
  opened.locks = std::move(locks);
  opened.writer =
      std::make_unique<SqliteDatabase>(path, OpenMode::read_write_create, options.busy_timeout_ms);
  // Before the first table is created; an existing store keeps its setting. Nothing is written yet.
  opened.writer->execute("PRAGMA auto_vacuum = INCREMENTAL");
  // The schema first, so that a file which is refused is left exactly as it was.
  TRY(bring_to_schema(*opened.writer, store_schema()));
  configure_writer(*opened.writer, options.durability);
  return opened;
}

}  // namespace

Result<std::unique_ptr<Store>> open_sqlite_store(const std::string& path, const StoreOptions& options) {
  return guarded([&]() -> Result<std::unique_ptr<Store>> {
    TRY_ASSIGN(auto opened, open_database(path, options));
    return std::make_unique<SqliteStore>(path, options, std::move(opened));
  });
}

Result<std::shared_ptr<Database>> open_sqlite_tables(const std::string& path, const StoreOptions& options) {
  return guarded([&]() -> Result<std::shared_ptr<Database>> {
    TRY_ASSIGN(auto opened, open_database(path, options));
    const auto held = std::make_shared<OpenedDatabase>(std::move(opened));
    return std::shared_ptr<Database>(held, held->writer.get());
  });
}

}  // namespace joulecast::history

#include <atomic>
#include <chrono>
#include <deque>
#include <mutex>
#include <optional>
#include <thread>
#include <utility>
#include <vector>

#include "base/host_clock.h"
#include "base/try.h"
#include "history/audit.h"
#include "history/open_store.h"
#include "history/postgres.h"
#include "history/schema.h"
#include "history/spool.h"
#include "history/sql_changes.h"
#include "history/sql_chunks.h"
#include "history/sql_queries.h"
#include "history/sql_store.h"

namespace joulecast::history {
namespace {

// The lock is the connection's: it ends when the connection's transaction is decided and the connection
// closed. Others in the same database have another schema; "JLCT" sets the lock apart from other programs'.
// In shared mode several programs may hold it if all take it in this mode.
bool try_lock(Database& database, bool shared = false) {
  return database.integer(std::string("SELECT pg_try_advisory_lock") + (shared ? "_shared" : "") +
                          "(1246512980, hashtext(current_schema()))::int") == 1;
}

Result<void> wait_for_lock(Database& database, bool shared, std::chrono::milliseconds patience) {
  const auto give_up = std::chrono::steady_clock::now() + patience;
  while (!try_lock(database, shared)) {
    if (std::chrono::steady_clock::now() >= give_up)
      return fail(Fault::conflict, "database", "is locked: another joulecast program has this store open");
    std::this_thread::sleep_for(std::chrono::milliseconds(50));
  }
  return {};
}

Result<std::unique_ptr<PostgresDatabase>> connect_writer(const std::string& url,
                                                         const std::string& writer_name) {
  auto database = std::make_unique<PostgresDatabase>(url, writer_name);
  if (database->integer("SELECT (current_schema() IS NOT NULL)::int") == 0)
    return fail(Fault::not_found, "database", "the search_path names no schema that exists");
  return database;
}

Result<std::unique_ptr<PostgresDatabase>> open_writer(const std::string& url, const StoreOptions& options,
                                                      const std::string& writer_name) {
  TRY_ASSIGN(auto database, connect_writer(url, writer_name));
  TRY(wait_for_lock(*database, false, options.lock_wait));
  TRY(bring_to_postgres_schema(*database));
  return database;
}

// Rows that were copied in carry their own numbers; the next ones are greater.
void advance_identities(Database& database) {
  for (const auto& [table, column] : {std::pair("telemetry_chunk", "chunk_key"),
                                      {"covariate_chunk", "chunk_key"},
                                      {"event", "event_id"},
                                      {"diagnosis", "diagnosis_id"},
                                      {"proposal", "proposal_id"}}) {
    const std::string sequence =
        std::string("pg_get_serial_sequence('") + table + "', '" + column + "')::regclass";
    database.execute("SELECT setval(" + sequence + ", last) FROM (SELECT max(" + column + ") AS last FROM " +
                     table + ") AS stored WHERE last > coalesce(pg_sequence_last_value(" + sequence +
                     "), 0)");
  }
}

// Of several that share the store the first prepares it, while it is alone.
void prepare_shared(Database& database) {
  advance_identities(database);
  database.execute(
      "SELECT setval('cluster_mission_keys', greatest((SELECT coalesce(max(mission_key), 0) FROM mission), "
      "(SELECT last_value FROM cluster_mission_keys)) + 1)");
}

Result<std::unique_ptr<PostgresDatabase>> open_shared_writer(const std::string& url,
                                                             const StoreOptions& options) {
  auto opened = connect_writer(url, options.shared_writer);
  if (!opened) return opened;
  PostgresDatabase& database = **opened;
  if (try_lock(database)) {
    TRY(bring_to_postgres_schema(database));
    prepare_shared(database);
    // The own lock is no obstacle to the shared one.
    if (!try_lock(database, true)) return fail(Fault::internal, "database", "the lock was not shared");
    database.execute("SELECT pg_advisory_unlock(1246512980, hashtext(current_schema()))");
  } else if (auto held = wait_for_lock(database, true, options.lock_wait); !held) {
    return tl::unexpected(held.error());
  }
  const std::int64_t version = database.integer("SELECT schema_version FROM joulecast_store");
  if (version != postgres_schema().version)
    return fail(Fault::conflict, "database",
                "schema version " + std::to_string(version) +
                    " is in use by other daemons; this program needs version " +
                    std::to_string(postgres_schema().version) + " and can migrate once they have stopped");
  database.execute("DELETE FROM cluster_writer WHERE since < now() - interval '30 days'");
  Rows(database, "INSERT INTO cluster_writer VALUES (?, 0, now())", options.shared_writer).run();
  return opened;
}

// Mission keys come in blocks of this many: schemas/cluster.postgresql.sql.
constexpr MissionKey key_block = 1000;
constexpr std::string_view next_keys = "SELECT nextval('cluster_mission_keys')";

class PostgresStore final : public SqlStore {
 public:
  PostgresStore(const std::string& url, const StoreOptions& options, std::string name,
                std::unique_ptr<PostgresDatabase> writer)
      : SqlStore(
            [url, name, limit = options.query_limit] {
              auto reader = std::make_unique<PostgresDatabase>(url, name + "-reader");
              reader->limit_statements(limit);
              return reader;
            },
            options.readers, greatest_key(*writer)),
        url_(url),
        name_(std::move(name)),
        now_utime_us_(options.now_utime_us ? options.now_utime_us : host_utime_us),
        lock_timeout_ms_(options.busy_timeout_ms),
        shared_(!options.shared_writer.empty()),
        on_dropped_(options.on_dropped) {
    BatchMark last = SqlChanges::mark_of(*writer);
    if (shared_) {
      last = {last.store, name_, 0};
      for (int k = 0; k < 2; ++k) add_keys(writer->integer(next_keys));
    }
    set_mark(std::move(last));
    use(std::move(writer));
  }

  Result<std::vector<Outcome>> apply(std::span<const Command> commands) override {
    return guarded([&]() -> Result<std::vector<Outcome>> {
      TRY(make_ready());
      get_keys();
      if (in_doubt_) {
        const bool committed = was_committed();
        InDoubt before = *std::exchange(in_doubt_, std::nullopt);
        if (committed && before.commands == bytes_of(commands))
          return done(commands, std::move(before.outcomes));
      }
      std::vector<Outcome> outcomes;
      ++batch_;
      try {
        changes_->apply(
            commands, [this] { mark_batch(); }, outcomes);
      } catch (const SqlError& error) {
        if (error.kind() != SqlError::Kind::commit_unknown) throw;
        in_doubt_ = InDoubt{bytes_of(commands), std::move(outcomes)};
        TRY(make_ready());
        const bool committed = was_committed();
        outcomes = std::exchange(in_doubt_, std::nullopt)->outcomes;
        if (!committed) throw;
      }
      if (on_dropped_)
        for (const auto& [robot_id, dropped] : changes_->dropped()) {
          fenced_ += dropped.count;
          fenced_samples_ += dropped.samples;
          on_dropped_(robot_id, dropped.epoch, dropped.count);
        }
      return done(commands, std::move(outcomes));
    });
  }

  std::uint64_t fenced() const override { return fenced_; }
  std::uint64_t fenced_samples() const override { return fenced_samples_; }

  bool is_in_doubt() const override { return in_doubt_.has_value(); }

  Result<void> check() override {
    return guarded([&]() -> Result<void> {
      TRY(make_ready());
      writer_->execute("SELECT 1");
      return {};
    });
  }

  Result<StoreSize> size() const override {
    return read([](Database& database) -> Result<StoreSize> {
      StoreSize size;
      size.database_bytes = database.integer(
          "SELECT CAST(sum(pg_total_relation_size(oid)) AS BIGINT) FROM pg_class WHERE relkind = 'r' AND "
          "relnamespace = current_schema()::regnamespace");
      size.telemetry_bytes = chunks::encoded_bytes(database);
      size.telemetry_chunks = chunks::count(database);
      size.missions = database.integer(
          "SELECT CAST((SELECT coalesce(sum(stored), 0) FROM mission_day) + (SELECT count(*) FROM mission "
          "WHERE state = 'open') AS BIGINT)");
      size.audit_entries = count_audit(database);
      return size;
    });
  }

 private:
  // A batch with an unconfirmed COMMIT.
  struct InDoubt {
    std::vector<std::byte> commands;
    std::vector<Outcome> outcomes;
  };

  static std::vector<std::byte> bytes_of(std::span<const Command> commands) {
    std::vector<const Command*> each;
    for (const Command& command : commands) each.push_back(&command);
    return command_bytes(each);
  }

  void use(std::unique_ptr<PostgresDatabase> writer) {
    writer->execute("SET lock_timeout = " + std::to_string(lock_timeout_ms_));
    changes_.reset();
    writer_ = std::move(writer);
    changes_.emplace(*writer_, now_utime_us_, shared_ ? name_ : std::string());
  }

  // Reconnects if the connection was lost, and takes the lock again. A free lock proves that the lost
  // connection's last transaction has ended.
  Result<void> make_ready() {
    if (!taken_over_.empty()) return fail(Fault::unavailable, "database", taken_over_);
    if (writer_->is_usable()) return {};
    auto database = std::make_unique<PostgresDatabase>(url_, name_);
    if (shared_ ? !take_back(*database) : !try_lock(*database)) {
      Rows(*database,
           "SELECT pg_terminate_backend(pid) FROM pg_stat_activity WHERE application_name = ? AND pid <> "
           "pg_backend_pid()",
           name_)
          .run();
      return fail(Fault::unavailable, "database", "the store is still held by a connection that was lost");
    }
    if (!shared_ && !is_own(database->text("SELECT writer FROM joulecast_store"))) {
      taken_over_ =
          "another joulecast program has written to the store meanwhile; nothing is stored until this one is "
          "started again";
      return fail(Fault::unavailable, "database", taken_over_);
    }
    use(std::move(database));
    return {};
  }

  // Whether no other program has written since this one did, or opened the store.
  bool is_own(const std::string& writer) const { return writer == name_ || writer == mark().writer; }

  // Takes the shared lock if the lost connection has ended and no program holds the store exclusively.
  bool take_back(Database& database) {
    Rows others(
        database,
        "SELECT count(*) FROM pg_stat_activity WHERE application_name = ? AND pid <> pg_backend_pid()",
        name_);
    return others.next() && others.integer() == 0 && try_lock(database, true);
  }

  // Records the batch, by which a later connection sees the outcome of its COMMIT. Locks the row till then.
  void mark_batch() {
    if (shared_)
      Rows(*writer_, "UPDATE cluster_writer SET batch = ?, since = now() WHERE writer = ?", batch_, name_)
          .run();
    else
      Rows(*writer_, "UPDATE joulecast_store SET writer = ?, batch = ?", name_, batch_).run();
  }

  bool was_committed() {
    Rows rows(*writer_,
              shared_ ? "SELECT batch FROM cluster_writer WHERE writer = ?1"
                      : "SELECT batch FROM joulecast_store WHERE writer = ?1",
              name_);
    return rows.next() && rows.integer() == batch_;
  }

  void add_keys(MissionKey first) {
    const std::lock_guard lock(blocks_mutex_);
    keys_.push_back({first, first + key_block});
  }

  // While the database is away, the keys at hand do for a block of missions at least.
  void get_keys() {
    const auto has_enough = [this] {
      const std::lock_guard lock(blocks_mutex_);
      return keys_.size() >= 2;
    };
    if (shared_ && !has_enough()) add_keys(writer_->integer(next_keys));
  }
  Result<MissionKey> new_mission_key() override {
    if (!shared_) return SqlStore::new_mission_key();
    const std::lock_guard lock(blocks_mutex_);
    if (keys_.empty()) return fail(Fault::unavailable, "database", "gave no more keys of missions");
    const MissionKey key = keys_.front().next++;
    if (keys_.front().next == keys_.front().end) keys_.pop_front();
    return key;
  }

  std::vector<Outcome> done(std::span<const Command> commands, std::vector<Outcome> outcomes) {
    note_commit(commands, outcomes, {mark().store, name_, batch_});
    return outcomes;
  }

  const std::string url_, name_;
  const std::function<std::int64_t()> now_utime_us_;
  const std::int64_t lock_timeout_ms_;
  const bool shared_;
  const std::function<void(const std::string&, Epoch, std::uint64_t)> on_dropped_;
  struct KeyBlock {
    MissionKey next = 0, end = 0;
  };
  std::mutex blocks_mutex_;
  std::deque<KeyBlock> keys_;
  std::unique_ptr<PostgresDatabase> writer_;
  std::optional<SqlChanges> changes_;
  std::int64_t batch_ = 0;  // the last one tried
  std::atomic<std::uint64_t> fenced_ = 0, fenced_samples_ = 0;
  std::optional<InDoubt> in_doubt_;
  std::string taken_over_;  // why the store is lost to this program; empty: it is not
};

}  // namespace

Result<std::unique_ptr<Store>> open_postgres_store(const std::string& url, const StoreOptions& options) {
  return guarded([&]() -> Result<std::unique_ptr<Store>> {
    if (!options.shared_writer.empty()) {
      TRY_ASSIGN(auto writer, open_shared_writer(url, options));
      return std::make_unique<PostgresStore>(url, options, options.shared_writer, std::move(writer));
    }
    const std::string name = new_writer_name();
    TRY_ASSIGN(auto writer, open_writer(url, options, name));
    advance_identities(*writer);
    return std::make_unique<PostgresStore>(url, options, name, std::move(writer));
  });
}

Result<std::shared_ptr<Database>> open_postgres_tables(const std::string& url, const StoreOptions& options) {
  return guarded([&]() -> Result<std::shared_ptr<Database>> {
    TRY_ASSIGN(auto writer, open_writer(url, options, new_writer_name()));
    return std::shared_ptr<Database>(std::move(writer));
  });
}

}  // namespace joulecast::history

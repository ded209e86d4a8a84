#include "history/postgres_store.h"

#include <optional>
#include <random>
#include <thread>
#include <utility>
#include <vector>

#include "base/host_clock.h"
#include "history/postgres.h"
#include "history/postgres_schema.h"
#include "history/spool.h"
#include "history/sql_changes.h"
#include "history/sql_chunks.h"
#include "history/sql_queries.h"
#include "history/sql_store.h"

namespace joulecast::history {
namespace {

// Names this run of the program among all that ever wrote to the store.
std::string new_writer_name() {
  std::random_device random;
  std::string name = "joulecast-";
  constexpr std::string_view digits = "0123456789abcdef";
  for (int k = 0; k < 16; ++k) name += digits[random() % digits.size()];
  return name;
}

// The lock is the connection's: it ends when the connection's transaction is decided and the connection
// closed. Others in the same database have another schema; "JLCT" sets the lock apart from other programs'.
bool try_lock(Database& database) {
  return database.integer("SELECT pg_try_advisory_lock(1246512980, hashtext(current_schema()))::int") == 1;
}

Result<std::unique_ptr<PostgresDatabase>> open_writer(const PostgresOptions& options,
                                                      const std::string& writer_name) {
  auto database = std::make_unique<PostgresDatabase>(options.url, writer_name);
  if (database->integer("SELECT (current_schema() IS NOT NULL)::int") == 0)
    return fail(Fault::not_found, "database", "the search_path names no schema that exists");
  const auto give_up = std::chrono::steady_clock::now() + options.lock_wait;
  while (!try_lock(*database)) {
    if (std::chrono::steady_clock::now() >= give_up)
      return fail(Fault::conflict, "database",
                  "is locked: another joulecast program, a daemon perhaps, has this store open");
    std::this_thread::sleep_for(std::chrono::milliseconds(50));
  }
  if (auto ready = bring_to_postgres_schema(*database); !ready) return tl::unexpected(ready.error());
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

class PostgresStore final : public SqlStore {
 public:
  PostgresStore(const PostgresOptions& options, std::string name, std::unique_ptr<PostgresDatabase> writer)
      : SqlStore(
            [url = options.url, name] { return std::make_unique<PostgresDatabase>(url, name + "-reader"); },
            options.readers, queries::greatest_key(*writer)),
        url_(options.url),
        name_(std::move(name)),
        now_utime_us_(options.now_utime_us ? options.now_utime_us : host_utime_us) {
    Rows(writer->statement("UPDATE joulecast_store SET writer = ?, batch = 0")).bind(name_).run();
    use(std::move(writer));
  }

  Result<std::vector<Outcome>> apply(std::span<const Command> commands) override {
    return guarded([&]() -> Result<std::vector<Outcome>> {
      if (auto ready = make_ready(); !ready) return tl::unexpected(ready.error());
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
        if (auto ready = make_ready(); !ready) return tl::unexpected(ready.error());
        const bool committed = was_committed();
        outcomes = std::exchange(in_doubt_, std::nullopt)->outcomes;
        if (!committed) throw;
      }
      return done(commands, std::move(outcomes));
    });
  }

  bool is_in_doubt() const override { return in_doubt_.has_value(); }

  Result<void> check() override {
    return guarded([&]() -> Result<void> {
      if (auto ready = make_ready(); !ready) return ready;
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
      size.missions = database.integer("SELECT count(*) FROM mission");
      return size;
    });
  }

 private:
  // A batch whose COMMIT was not answered.
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
    changes_.reset();
    writer_ = std::move(writer);
    changes_.emplace(*writer_, now_utime_us_);
  }

  // Connects anew where the connection was lost, and takes the lock again. That the lock is free says that
  // the lost connection's last transaction is decided.
  Result<void> make_ready() {
    if (!taken_over_.empty()) return fail(Fault::unavailable, "database", taken_over_);
    if (writer_->is_usable()) return {};
    auto database = std::make_unique<PostgresDatabase>(url_, name_);
    if (!try_lock(*database)) {
      Rows(database->statement(
               "SELECT pg_terminate_backend(pid) FROM pg_stat_activity WHERE application_name = ? "
               "AND pid <> pg_backend_pid()"))
          .bind(name_)
          .run();
      return fail(Fault::unavailable, "database", "the store is still held by a connection that was lost");
    }
    const std::string owner = database->text("SELECT writer FROM joulecast_store");
    if (owner != name_) {
      taken_over_ =
          "another joulecast program has written to the store meanwhile; nothing is stored until this one is "
          "started again";
      return fail(Fault::unavailable, "database", taken_over_);
    }
    use(std::move(database));
    return {};
  }

  // Held until the transaction ends, for the outcome of its COMMIT to be known by.
  void mark_batch() { Rows(writer_->statement("UPDATE joulecast_store SET batch = ?")).bind(batch_).run(); }

  bool was_committed() { return writer_->integer("SELECT batch FROM joulecast_store") == batch_; }

  std::vector<Outcome> done(std::span<const Command> commands, std::vector<Outcome> outcomes) {
    forget_reservations(commands, outcomes);
    return outcomes;
  }

  const std::string url_, name_;
  const std::function<std::int64_t()> now_utime_us_;
  std::unique_ptr<PostgresDatabase> writer_;
  std::optional<SqlChanges> changes_;
  std::int64_t batch_ = 0;  // the last one tried
  std::optional<InDoubt> in_doubt_;
  std::string taken_over_;  // why the store is lost to this program; empty: it is not
};

}  // namespace

Result<std::unique_ptr<Store>> open_postgres_store(const PostgresOptions& options) {
  return guarded([&]() -> Result<std::unique_ptr<Store>> {
    const std::string name = new_writer_name();
    auto writer = open_writer(options, name);
    if (!writer) return tl::unexpected(writer.error());
    advance_identities(**writer);
    return std::make_unique<PostgresStore>(options, name, std::move(*writer));
  });
}

Result<std::shared_ptr<Database>> open_postgres_tables(const PostgresOptions& options) {
  return guarded([&]() -> Result<std::shared_ptr<Database>> {
    auto writer = open_writer(options, new_writer_name());
    if (!writer) return tl::unexpected(writer.error());
    return std::shared_ptr<Database>(std::move(*writer));
  });
}

}  // namespace joulecast::history

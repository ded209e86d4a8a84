#include "history/sqlite_store.h"

#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <condition_variable>
#include <cstring>
#include <filesystem>
#include <map>
#include <mutex>
#include <optional>
#include <tuple>
#include <utility>
#include <vector>

#include "base/host_clock.h"
#include "history/file_lock.h"
#include "history/schema.h"
#include "history/sqlite.h"
#include "history/sqlite_changes.h"
#include "history/sqlite_chunks.h"
#include "history/sqlite_queries.h"

namespace joulecast::history {
namespace {

Error error_of(const SqliteError& error) {
  return Error{error.fault(), "database", error.what()};
}

// Runs work that throws SqliteError; nothing is thrown past this.
template <class Work>
auto guarded(Work work) -> decltype(work()) {
  try {
    return work();
  } catch (const SqliteError& error) {
    return tl::unexpected(error_of(error));
  } catch (const std::exception& error) {
    return fail(Fault::unavailable, "database", error.what());
  }
}

// The files that were opened, known again by device and inode.
class OpenedFiles {
 public:
  explicit OpenedFiles(std::vector<std::string> paths) : paths_(std::move(paths)) {
    for (const std::string& path : paths_) opened_.push_back(identity_of(path));
  }

  // A lost file stays lost: what was written to it since is in no file that anybody finds.
  Result<void> check() {
    for (std::size_t k = 0; k < paths_.size() && lost_.empty(); ++k) {
      const Identity now = identity_of(paths_[k]);
      if (now != opened_[k])
        lost_ = paths_[k] + (now ? " was replaced" : " was deleted") +
                " under the running program; nothing is stored until it is started again";
    }
    if (!lost_.empty()) return fail(Fault::unavailable, "database", lost_);
    for (const std::string& path : paths_) {
      if (access(path.c_str(), W_OK) != 0)
        return fail(Fault::unavailable, "database", path + " cannot be written: " + std::strerror(errno));
    }
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

// Reading connections, lent one at a time.
class ReaderPool {
 public:
  ReaderPool(const std::string& path, std::size_t count, std::int64_t busy_timeout_ms) {
    for (std::size_t k = 0; k < std::max<std::size_t>(count, 1); ++k)
      idle_.push_back(std::make_unique<Database>(path, OpenMode::read_only, busy_timeout_ms));
  }

  class Lease {
   public:
    Lease(ReaderPool& pool, std::unique_ptr<Database> database)
        : pool_(pool), database_(std::move(database)) {}
    ~Lease() { pool_.give_back(std::move(database_)); }
    Lease(const Lease&) = delete;
    Lease& operator=(const Lease&) = delete;
    Database& operator*() { return *database_; }

   private:
    ReaderPool& pool_;
    std::unique_ptr<Database> database_;
  };

  Lease lend() {
    std::unique_lock lock(mutex_);
    returned_.wait(lock, [this] { return !idle_.empty(); });
    std::unique_ptr<Database> database = std::move(idle_.back());
    idle_.pop_back();
    return Lease(*this, std::move(database));
  }

 private:
  void give_back(std::unique_ptr<Database> database) {
    {
      std::lock_guard lock(mutex_);
      idle_.push_back(std::move(database));
    }
    returned_.notify_one();
  }

  std::mutex mutex_;
  std::condition_variable returned_;
  std::vector<std::unique_ptr<Database>> idle_;
};

void configure_writer(Database& database) {
  database.execute("PRAGMA journal_mode = WAL");
  // In WAL mode NORMAL never corrupts; a power cut may lose the last commits, the end of the process loses
  // none.
  database.execute("PRAGMA synchronous = NORMAL");
  database.execute("PRAGMA foreign_keys = ON");
  // Give back a journal that a long read let grow.
  database.execute("PRAGMA journal_size_limit = 67108864");
}

class SqliteStore final : public Store {
 public:
  SqliteStore(const SqliteOptions& options, std::vector<std::unique_ptr<FileLock>> locks,
              std::unique_ptr<Database> writer)
      : path_(options.path),
        locks_(std::move(locks)),
        writer_(std::move(writer)),
        changes_(*writer_, options.now_utime_us ? options.now_utime_us : host_utime_us),
        readers_(options.path, options.readers, options.busy_timeout_ms),
        // The first query has opened the journal.
        last_key_(queries::greatest_key(*writer_)),
        files_({path_, path_ + "-wal"}) {}

  Result<std::vector<Outcome>> apply(std::span<const Command> commands) override {
    if (const Result<void> sound = files_.check(); !sound) return tl::unexpected(sound.error());
    auto outcomes = guarded([&]() -> Result<std::vector<Outcome>> { return changes_.apply(commands); });
    // Nothing is acknowledged that went into a file which was deleted meanwhile.
    if (const Result<void> sound = files_.check(); !sound) return tl::unexpected(sound.error());
    if (outcomes) forget_reservations(commands, *outcomes);
    return outcomes;
  }

  Result<void> check() override { return files_.check(); }

  Result<MissionKey> mission_key(std::string_view robot_id, std::string_view mission_id,
                                 std::int64_t start_utime_us) override {
    std::lock_guard lock(keys_mutex_);
    const MissionName mission(robot_id, mission_id, start_utime_us);
    if (const auto found = reserved_.find(mission); found != reserved_.end()) return found->second;
    auto stored = read([&](Database& database) -> Result<std::optional<MissionKey>> {
      return queries::key_of(database, robot_id, mission_id, start_utime_us);
    });
    if (!stored) return tl::unexpected(stored.error());
    if (*stored) return **stored;
    return reserved_[mission] = ++last_key_;
  }

  Result<std::optional<MissionKey>> earlier_mission(std::string_view robot_id, std::string_view mission_id,
                                                    std::int64_t before_utime_us) override {
    std::lock_guard lock(keys_mutex_);
    const auto stored = read([&](Database& database) -> Result<std::optional<queries::MissionStart>> {
      return queries::last_called(database, robot_id, mission_id, before_utime_us);
    });
    if (!stored) return tl::unexpected(stored.error());
    std::optional<queries::MissionStart> last = *stored;
    // What is reserved sorts by start within a robot and name.
    const auto after = reserved_.lower_bound(MissionName(robot_id, mission_id, before_utime_us));
    if (after != reserved_.begin()) {
      const auto& [mission, key] = *std::prev(after);
      const auto& [robot, name, start_utime_us] = mission;
      if (robot == robot_id && name == mission_id && (!last || last->start_utime_us < start_utime_us))
        last = {start_utime_us, key};
    }
    return last ? std::optional(last->key) : std::nullopt;
  }

  Result<std::vector<RobotRecord>> robots() const override { return read(queries::robots); }

  Result<ModelVersion> model(std::string_view robot_id, std::optional<std::int64_t> version) const override {
    return read([&](Database& database) { return queries::model(database, robot_id, version); });
  }

  Result<std::vector<ModelVersion>> model_versions(std::string_view robot_id) const override {
    return read([&](Database& database) { return queries::model_versions(database, robot_id); });
  }

  Result<Mission> mission(MissionKey key) const override {
    return read([&](Database& database) { return queries::mission(database, key); });
  }

  Result<MissionPage> missions(const MissionFilter& filter, const PageRequest& page,
                               MissionSort sort) const override {
    return read([&](Database& database) { return queries::missions(database, filter, page, sort); });
  }

  Result<Totals> totals(const MissionFilter& filter) const override {
    return read([&](Database& database) { return queries::totals(database, filter); });
  }

  Result<std::vector<TotalsGroup>> grouped_totals(const MissionFilter& filter, Grouping by,
                                                  std::int64_t utc_offset_s) const override {
    return read(
        [&](Database& database) { return queries::grouped_totals(database, filter, by, utc_offset_s); });
  }

  Result<Trace> trace(MissionKey key, TimeRange range, std::int64_t max_points) const override {
    return read([&](Database& database) { return queries::trace(database, key, range, max_points); });
  }

  Result<TelemetryPage> telemetry(MissionKey key, TimeRange range, const PageRequest& page) const override {
    return read([&](Database& database) { return queries::telemetry(database, key, range, page); });
  }

  Result<CovariatePage> covariates(MissionKey key, TimeRange range, const PageRequest& page) const override {
    return read([&](Database& database) { return queries::covariates(database, key, range, page); });
  }

  Result<std::vector<Event>> events(std::int64_t after_id, std::int64_t limit,
                                    std::optional<std::string> robot_id) const override {
    return read([&](Database& database) { return queries::events(database, after_id, limit, robot_id); });
  }

  Result<std::optional<Learned>> learned(std::string_view robot_id, std::string_view topic) const override {
    return read([&](Database& database) { return queries::learned(database, robot_id, topic); });
  }
  Result<std::optional<ResumeState>> resume_state(std::string_view robot_id) const override {
    return read([&](Database& database) { return queries::resume_state(database, robot_id); });
  }

  Result<DiagnosisRecord> diagnosis(std::int64_t id) const override {
    return read([&](Database& database) { return queries::diagnosis(database, id); });
  }

  Result<std::vector<DiagnosisRecord>> diagnoses(std::optional<std::string> robot_id, std::int64_t before_id,
                                                 std::int64_t limit) const override {
    return read([&](Database& database) { return queries::diagnoses(database, robot_id, before_id, limit); });
  }

  Result<std::string> diagnosis_report(std::int64_t id) const override {
    return read([&](Database& database) { return queries::diagnosis_report(database, id); });
  }

  Result<Proposal> proposal(std::int64_t id) const override {
    return read([&](Database& database) { return queries::proposal(database, id); });
  }

  Result<std::vector<Proposal>> proposals(std::optional<std::string> robot_id, std::int64_t before_id,
                                          std::int64_t limit) const override {
    return read([&](Database& database) { return queries::proposals(database, robot_id, before_id, limit); });
  }

  Result<std::vector<Mission>> recover() const override { return read(queries::open_missions); }

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
      return size;
    });
  }

 private:
  using MissionName = std::tuple<std::string, std::string, std::int64_t>;

  template <class Query>
  auto read(Query query) const -> decltype(query(std::declval<Database&>())) {
    return guarded([&] {
      auto lease = readers_.lend();
      // One snapshot for all statements of the query.
      Transaction snapshot(*lease, Transaction::Kind::read);
      return query(*lease);
    });
  }

  void forget_reservations(std::span<const Command> commands, const std::vector<Outcome>& outcomes) {
    std::lock_guard lock(keys_mutex_);
    for (std::size_t k = 0; k < commands.size(); ++k) {
      const auto* start = std::get_if<StartMission>(&commands[k]);
      if (!start || !outcomes[k]) continue;
      const Mission& mission = start->mission;
      reserved_.erase({mission.robot_id, mission.mission_id, mission.start_utime_us});
      last_key_ = std::max(last_key_, mission.key);
    }
  }

  std::string path_;
  std::vector<std::unique_ptr<FileLock>> locks_;  // of the lock file and of the database itself
  std::unique_ptr<Database> writer_;
  SqliteChanges changes_;
  mutable ReaderPool readers_;

  std::mutex keys_mutex_;
  MissionKey last_key_;
  std::map<MissionName, MissionKey> reserved_;
  OpenedFiles files_;
};

}  // namespace

Result<std::unique_ptr<Store>> open_sqlite_store(const SqliteOptions& options) {
  // Their descriptors are closed after SQLite's, whose locks would go with the database's.
  auto locks = lock_store(options.path);
  if (!locks) return tl::unexpected(locks.error());
  return guarded([&]() -> Result<std::unique_ptr<Store>> {
    auto writer =
        std::make_unique<Database>(options.path, OpenMode::read_write_create, options.busy_timeout_ms);
    // Before the first table is made; a store that has some keeps what it has. Nothing is written yet.
    writer->execute("PRAGMA auto_vacuum = INCREMENTAL");
    // The schema first, so that a file which is refused is left exactly as it was.
    if (auto ready = bring_to_schema(*writer, store_schema()); !ready) return tl::unexpected(ready.error());
    configure_writer(*writer);
    return std::make_unique<SqliteStore>(options, std::move(*locks), std::move(writer));
  });
}

}  // namespace joulecast::history

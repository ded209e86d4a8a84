#pragma once

#include <chrono>
#include <condition_variable>
#include <functional>
#include <map>
#include <memory>
#include <mutex>
#include <string>
#include <tuple>
#include <utility>
#include <vector>

#include "base/error.h"
#include "history/sql.h"
#include "history/store.h"

namespace joulecast::history {

// Runs work that throws SqlError; nothing is thrown past this.
template <class Work>
auto guarded(Work work, const std::string& field = "database") -> decltype(work()) {
  try {
    return work();
  } catch (const SqlError& error) {
    return fail(error.fault(), field, error.what());
  } catch (const std::exception& error) {
    return fail(Fault::unavailable, field, error.what());
  }
}

// Reading connections, each used by one caller at a time; a lost one is replaced when it is next needed.
class ReaderPool {
 public:
  using Connect = std::function<std::unique_ptr<Database>()>;
  // Whether connections are made now, or each when it is first needed.
  enum class At { once, need };
  ReaderPool(Connect connect, std::size_t count, At at = At::once);

  class Lease {
   public:
    Lease(ReaderPool& pool, std::unique_ptr<Database> database)
        : pool_(pool), database_(std::move(database)) {}
    ~Lease() { pool_.give_back(std::move(database_)); }
    Lease(const Lease&) = delete;
    Lease& operator=(const Lease&) = delete;
    Database& operator*();

   private:
    ReaderPool& pool_;
    std::unique_ptr<Database> database_;
  };

  Lease lend();
  // The database was reached by another connection: the next lease connects without a pause.
  void reached();
  std::size_t size() const { return size_; }

 private:
  void give_back(std::unique_ptr<Database> database);

  using Clock = std::chrono::steady_clock;
  std::unique_ptr<Database> connect();

  const Connect connect_;
  const std::size_t size_;
  std::mutex mutex_;
  std::condition_variable returned_;
  std::vector<std::unique_ptr<Database>> idle_;  // null: was lost
  Clock::time_point retry_at_{};                 // no connection is tried before
  std::string why_;                              // the last attempt failed
};

// Common base of the stores: their reading connections, and the keys of missions. If its program is the only
// writer, keys are assigned in memory.
class SqlStore : public Store {
 public:
  Result<MissionKey> mission_key(std::string_view robot_id, std::string_view mission_id,
                                 std::int64_t start_utime_us) override;
  Result<std::optional<MissionKey>> earlier_mission(std::string_view robot_id, std::string_view mission_id,
                                                    std::int64_t before_utime_us) override;

  BatchMark mark() const override;
  // Again if the connection is lost.
  Result<void> run(const Work& work) const override;

 protected:
  // `last_key`: the greatest key of a stored mission.
  SqlStore(ReaderPool::Connect connect, std::size_t readers, MissionKey last_key);

  // A key that no mission has.
  virtual Result<MissionKey> new_key() { return ++last_key_; }

  // The result of a statement that is no query, on a reading connection.
  Result<std::int64_t> result_of(const std::string& sql) const;

  void set_mark(BatchMark mark);

  // Of a batch that apply() has committed.
  void note_commit(std::span<const Command> commands, const std::vector<Outcome>& outcomes, BatchMark mark);

 private:
  using MissionName = std::tuple<std::string, std::string, std::int64_t>;

  mutable ReaderPool readers_;
  mutable std::mutex mark_mutex_;
  BatchMark mark_;
  // A query of the accounting thread. After one that the store did not answer none is tried for some seconds:
  // a locked table costs accounting a tenth of its time at most.
  template <class Query>
  auto read_for_keys(Query query) -> decltype(query(std::declval<Database&>())) {
    using Clock = std::chrono::steady_clock;
    if (Clock::now() < keys_retry_at_)
      return fail(Fault::unavailable, "database", "was not reached a moment ago");
    auto found = read(std::move(query));
    if (!found && found.error().fault == Fault::unavailable) keys_retry_at_ = Clock::now() + keys_pause;
    return found;
  }

  std::mutex keys_mutex_;
  static constexpr std::chrono::seconds keys_pause{10};  // a read waits 1 s for a lock
  std::chrono::steady_clock::time_point keys_retry_at_{};
  MissionKey last_key_;
  std::map<MissionName, MissionKey> reserved_;
};

}  // namespace joulecast::history

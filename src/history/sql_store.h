#pragma once

#include <chrono>
#include <condition_variable>
#include <functional>
#include <memory>
#include <mutex>
#include <string>
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
  ReaderPool(const Connect& connect, std::size_t count);

  class Lease {
   public:
    Lease(ReaderPool& pool, std::unique_ptr<Database> database)
        : pool_(pool), database_(std::move(database)) {}
    ~Lease() { pool_.give_back(std::move(database_)); }
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
  Result<MissionKey> new_mission_key() override;

  BatchMark mark() const override;
  // Again if the connection is lost.
  Result<void> run(const Work& work) const override;

 protected:
  // `last_key`: the greatest key of a stored mission.
  SqlStore(ReaderPool::Connect connect, std::size_t readers, MissionKey last_key);

  void set_mark(BatchMark mark);

  // Of a batch that apply() has committed.
  void note_commit(std::span<const Command> commands, const std::vector<Outcome>& outcomes, BatchMark mark);

 private:
  mutable ReaderPool readers_;
  mutable std::mutex mark_mutex_;
  BatchMark mark_;
  std::mutex key_mutex_;
  MissionKey last_key_;
};

}  // namespace joulecast::history

#include "history/sql_store.h"

#include <algorithm>

#include "access/sha256.h"

namespace joulecast::history {

std::string new_writer_name() {
  return "joulecast-" + access::random_hex(8);
}

// After a failed connection: there may be many callers, and each attempt may take long.
constexpr std::chrono::seconds connect_pause{1};

ReaderPool::ReaderPool(const Connect& connect, std::size_t count)
    : connect_(connect), size_(std::max<std::size_t>(count, 1)) {
  while (idle_.size() < size_) idle_.push_back(connect_());
}

Database& ReaderPool::Lease::operator*() {
  if (!database_) database_ = pool_.connect();
  return *database_;
}

std::unique_ptr<Database> ReaderPool::connect() {
  {
    const std::lock_guard lock(mutex_);
    if (Clock::now() < retry_at_) throw SqlError(SqlError::Kind::unavailable, why_);
  }
  try {
    return connect_();
  } catch (const SqlError& error) {
    const std::lock_guard lock(mutex_);
    why_ = error.what();
    retry_at_ = Clock::now() + connect_pause;
    throw;
  }
}

ReaderPool::Lease ReaderPool::lend() {
  std::unique_lock lock(mutex_);
  returned_.wait(lock, [this] { return !idle_.empty(); });
  std::unique_ptr<Database> database = std::move(idle_.back());
  idle_.pop_back();
  return Lease(*this, std::move(database));
}

void ReaderPool::reached() {
  const std::lock_guard lock(mutex_);
  retry_at_ = {};
}

void ReaderPool::give_back(std::unique_ptr<Database> database) {
  if (database && !database->is_usable()) database.reset();
  {
    std::lock_guard lock(mutex_);
    idle_.push_back(std::move(database));
  }
  returned_.notify_one();
}

SqlStore::SqlStore(ReaderPool::Connect connect, std::size_t readers, MissionKey last_key)
    : readers_(std::move(connect), readers), last_key_(last_key) {}

Result<void> SqlStore::run(const Work& work) const {
  return guarded([&]() -> Result<void> {
    for (std::size_t lost = 0;; ++lost) {
      auto lease = readers_.lend();
      try {
        Transaction snapshot(*lease, Database::Access::read);
        return work(*lease);
      } catch (const SqlError& error) {
        if (error.kind() != SqlError::Kind::connection_lost || lost >= readers_.size()) throw;
      }
    }
  });
}

Result<MissionKey> SqlStore::new_mission_key() {
  const std::lock_guard lock(key_mutex_);
  return ++last_key_;
}

BatchMark SqlStore::mark() const {
  const std::lock_guard lock(mark_mutex_);
  return mark_;
}

void SqlStore::set_mark(BatchMark mark) {
  const std::lock_guard lock(mark_mutex_);
  mark_ = std::move(mark);
}

void SqlStore::note_commit(std::span<const Command> commands, const std::vector<Outcome>& outcomes,
                           BatchMark mark) {
  readers_.reached();
  // A spool that is refused commits nothing.
  if (!commands.empty() && std::holds_alternative<TakeSpool>(commands.front()) && !outcomes.front()) return;
  set_mark(std::move(mark));
  // A spool has keys of the last run.
  const std::lock_guard lock(key_mutex_);
  for (const Command& command : commands)
    if (const auto* start = std::get_if<StartMission>(&command))
      last_key_ = std::max(last_key_, start->mission.key);
}

}  // namespace joulecast::history

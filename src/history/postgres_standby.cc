#include "history/postgres_standby.h"

#include <utility>

#include "history/postgres.h"

namespace joulecast::history {
namespace {

constexpr std::chrono::milliseconds between_looks{250};
constexpr std::size_t most_looks = 4000;  // beyond, the older half is thinned out

// libpq's, of 14 and later.
constexpr const char* any_server = "prefer-standby";

std::string system_of(Database& database) {
  return database.text("SELECT system_identifier::text FROM pg_control_system()");
}

}  // namespace

PostgresStandby::PostgresStandby(StandbyOptions options, std::chrono::milliseconds query_limit,
                                 std::string primary_url, std::string name, const SqlStore& store)
    : options_(std::move(options)),
      primary_url_(std::move(primary_url)),
      name_(std::move(name)),
      store_(store),
      readers_(
          [this, query_limit] {
            auto reader = std::make_unique<PostgresDatabase>(options_.url, name_ + "-standby", any_server);
            reader->limit_statements(query_limit);
            return reader;
          },
          options_.readers, ReaderPool::At::need),
      watch_([this](const std::stop_token& stop) { watch(stop); }) {}

PostgresStandby::~PostgresStandby() {
  watch_.request_stop();
  watch_.join();
}

void PostgresStandby::watch(const std::stop_token& stop) {
  while (!stop.stop_requested()) {
    look();
    std::unique_lock lock(mutex_);
    wake_.wait_for(lock, stop, between_looks, [] { return false; });
  }
}

void PostgresStandby::look() {
  std::string why;
  // The server may be away for a while and the standby still be as new as before.
  try {
    look_at_server();
  } catch (const SqlError& error) {
    server_.reset();
    why = error.what();
  }
  try {
    look_at_standby();
  } catch (const SqlError& error) {
    standby_.reset();
    why = error.what();
    const std::lock_guard lock(mutex_);
    as_of_.reset();
  }
  const std::lock_guard lock(mutex_);
  if (!why.empty() || as_of_) why_not_ = std::move(why);
}

void PostgresStandby::look_at_server() {
  if (!server_) {
    server_ = std::make_unique<PostgresDatabase>(primary_url_, name_ + "-watch");
    system_ = system_of(*server_);
  }
  const Clock::time_point before = Clock::now();
  Rows rows(*server_, "SELECT (pg_current_wal_insert_lsn() - '0/0')::bigint");
  if (!rows.next()) return;
  const std::lock_guard lock(mutex_);
  looks_.push_back({before, rows.integer()});
  // If the standby is far behind, its lag is measured in coarser steps.
  if (looks_.size() > most_looks)
    for (std::size_t k = 1; k < looks_.size() / 2; ++k) looks_.erase(looks_.begin() + static_cast<long>(k));
}

void PostgresStandby::look_at_standby() {
  if (!standby_) {
    auto connected = std::make_unique<PostgresDatabase>(options_.url, name_ + "-watch", any_server);
    if (!system_.empty() && system_of(*connected) != system_)
      throw SqlError(SqlError::Kind::unavailable, "store.read_url is no standby of the server of store.url");
    standby_ = std::move(connected);
  }
  Rows rows(*standby_, "SELECT (pg_last_wal_replay_lsn() - '0/0')::bigint WHERE pg_is_in_recovery()");
  // One that was promoted takes part in no replication that could be measured.
  if (!rows.next())
    throw SqlError(SqlError::Kind::unavailable, "the server of store.read_url is no standby any more");
  const std::int64_t replayed = rows.integer();
  const std::lock_guard lock(mutex_);
  while (!looks_.empty() && looks_.front().position <= replayed) {
    as_of_ = looks_.front().at;
    looks_.pop_front();
  }
}

std::optional<double> PostgresStandby::staleness_s() const {
  if (!as_of_) return std::nullopt;
  return std::chrono::duration<double>(Clock::now() - *as_of_).count();
}

Past PostgresStandby::past() const {
  const std::lock_guard lock(mutex_);
  const auto staleness = staleness_s();
  if (!staleness || *staleness > options_.max_staleness_s) {
    ++passed_on_;
    return {store_, std::nullopt};
  }
  return {*this, staleness};
}

StandbyStatus PostgresStandby::status() const {
  const std::lock_guard lock(mutex_);
  StandbyStatus status;
  status.staleness_s = staleness_s();
  status.in_use = status.staleness_s && *status.staleness_s <= options_.max_staleness_s;
  status.answered = answered_;
  status.passed_on = passed_on_;
  status.why_not = status.in_use ? "" : why_not_;
  return status;
}

Result<void> PostgresStandby::run(const Work& work) const {
  const Result<void> done = guarded([&]() -> Result<void> {
    auto lease = readers_.lend();
    Transaction snapshot(*lease, Database::Access::read);
    return work(*lease);
  });
  // Data that the standby lacks may not have been replayed yet.
  const bool passed_on = !done && done.error().fault != Fault::invalid;
  {
    const std::lock_guard lock(mutex_);
    ++(passed_on ? passed_on_ : answered_);
  }
  return passed_on ? store_.run(work) : done;
}

}  // namespace joulecast::history

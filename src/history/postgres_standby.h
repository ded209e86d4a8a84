#pragma once

#include <chrono>
#include <condition_variable>
#include <cstdint>
#include <deque>
#include <memory>
#include <mutex>
#include <optional>
#include <string>
#include <thread>

#include "history/open_store.h"
#include "history/sql_store.h"
#include "history/store.h"

namespace joulecast::history {

class PostgresDatabase;

// Queries of the past, sent to a standby of the store's server. The store itself answers those that the
// standby cannot answer, because it is not reached, has not replayed far enough or ended the query. Several
// times a second the positions of the server and of the standby in the log (WAL) are read; the standby's data
// are then at least as new as the last reading at which the server had got no farther. Clocks of other
// machines are not compared.
class PostgresStandby final : public History {
 public:
  // `store` answers otherwise; it is at `primary_url` and outlives this.
  // `query_limit`: of each statement.
  PostgresStandby(StandbyOptions options, std::chrono::milliseconds query_limit, std::string primary_url,
                  std::string name, const SqlStore& store);
  ~PostgresStandby() override;

  // The standby while it is no staler than StandbyOptions::max_staleness_s, else the store.
  Past past() const;
  StandbyStatus status() const;

  Result<void> run(const Work& work) const override;

 private:
  using Clock = std::chrono::steady_clock;
  // At that time the server's log was that long, in bytes.
  struct Look {
    Clock::time_point at;
    std::int64_t position = 0;
  };

  void watch(const std::stop_token& stop);
  void look();
  void look_at_server();
  void look_at_standby();
  std::optional<double> staleness_s() const;  // with the mutex held

  const StandbyOptions options_;
  const std::string primary_url_, name_;
  const SqlStore& store_;
  mutable ReaderPool readers_;
  std::unique_ptr<PostgresDatabase> server_, standby_;  // the watch's own
  std::string system_;  // identifier of the server's data, from its creation on

  mutable std::mutex mutex_;
  std::deque<Look> looks_;  // that the standby has not reached, but for the first one
  std::optional<Clock::time_point> as_of_;
  std::string why_not_;
  mutable std::uint64_t answered_ = 0, passed_on_ = 0;
  std::condition_variable_any wake_;
  std::jthread watch_;
};

}  // namespace joulecast::history

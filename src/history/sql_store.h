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

// Common base of the stores: every query, and the keys of missions. If its program is the only writer, keys
// are assigned in memory.
class SqlStore : public Store {
 public:
  Result<MissionKey> mission_key(std::string_view robot_id, std::string_view mission_id,
                                 std::int64_t start_utime_us) override;
  Result<std::optional<MissionKey>> earlier_mission(std::string_view robot_id, std::string_view mission_id,
                                                    std::int64_t before_utime_us) override;

  Result<std::vector<RobotRecord>> robots() const override;
  Result<ModelVersion> model(std::string_view robot_id, std::optional<std::int64_t> version) const override;
  Result<std::vector<ModelVersion>> model_versions(std::string_view robot_id) const override;
  Result<Mission> mission(MissionKey key) const override;
  Result<MissionPage> missions(const MissionFilter& filter, const PageRequest& page,
                               MissionSort sort) const override;
  Result<Totals> totals(const MissionFilter& filter) const override;
  Result<std::vector<TotalsGroup>> grouped_totals(const MissionFilter& filter, Grouping by,
                                                  std::int64_t utc_offset_s) const override;
  Result<Trace> trace(MissionKey key, TimeRange range, std::int64_t max_points) const override;
  Result<FloorReading> floor_visits(const MissionFilter& filter, double cell_m, std::int64_t max_points,
                                    const FloorSink& sink) const override;
  Result<TelemetryPage> telemetry(MissionKey key, TimeRange range, const PageRequest& page) const override;
  Result<CovariatePage> covariates(MissionKey key, TimeRange range, const PageRequest& page) const override;
  Result<std::optional<RequestAnswer>> answer(std::string_view actor, std::string_view key) const override;
  Result<std::vector<AuditEntry>> audit(std::int64_t before_id, std::int64_t limit) const override;
  Result<std::vector<Event>> events(std::int64_t after_id, std::int64_t limit,
                                    std::optional<std::string> robot_id) const override;
  Result<std::optional<ResumeState>> resume_state(std::string_view robot_id) const override;
  Result<std::vector<FloorPlan>> floor_plans() const override;
  Result<FloorPlan> floor_plan(std::string_view map, std::string_view level) const override;
  Result<std::optional<Learned>> learned(std::string_view robot_id, std::string_view topic) const override;
  Result<std::vector<Learned>> all_learned(std::string_view topic) const override;
  Result<DiagnosisRecord> diagnosis(std::int64_t id) const override;
  Result<std::vector<DiagnosisRecord>> diagnoses(std::optional<std::string> robot_id, std::int64_t before_id,
                                                 std::int64_t limit) const override;
  Result<std::string> diagnosis_report(std::int64_t id) const override;
  Result<Proposal> proposal(std::int64_t id) const override;
  Result<std::vector<Proposal>> proposals(std::optional<std::string> robot_id, std::int64_t before_id,
                                          std::int64_t limit) const override;
  Result<std::vector<Mission>> recover() const override;
  BatchMark mark() const override;

 protected:
  // `last_key`: the greatest key of a stored mission.
  SqlStore(ReaderPool::Connect connect, std::size_t readers, MissionKey last_key);

  // One snapshot for all statements of the query. The query is repeated on another connection if its own is
  // lost.
  template <class Query>
  auto read(Query query) const -> decltype(query(std::declval<Database&>())) {
    return guarded([&] {
      for (std::size_t lost = 0;; ++lost) {
        auto lease = readers_.lend();
        try {
          Transaction snapshot(*lease, Database::Access::read);
          return query(*lease);
        } catch (const SqlError& error) {
          if (error.kind() != SqlError::Kind::connection_lost || lost >= readers_.size()) throw;
        }
      }
    });
  }

  // A key that no mission has.
  virtual Result<MissionKey> new_key() { return ++last_key_; }

  // The result of a statement that is no query, on a reading connection.
  Result<std::int64_t> ask(const std::string& sql) const;

  void set_mark(BatchMark mark);

  // Of a batch that apply() has committed.
  void note_commit(std::span<const Command> commands, const std::vector<Outcome>& outcomes, BatchMark mark);

 private:
  using MissionName = std::tuple<std::string, std::string, std::int64_t>;

  mutable ReaderPool readers_;
  mutable std::mutex mark_mutex_;
  BatchMark mark_;
  std::mutex keys_mutex_;
  MissionKey last_key_;
  std::map<MissionName, MissionKey> reserved_;
};

}  // namespace joulecast::history

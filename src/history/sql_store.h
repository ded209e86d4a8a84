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
#include "base/try.h"
#include "history/audit.h"
#include "history/sql.h"
#include "history/sql_queries.h"
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

// A database that is queried.
class Queried {
 public:
  using Work = std::function<Result<void>(Database&)>;
  // Runs the work on a connection, in one snapshot; perhaps again on another one, if it fails. The errors are
  // the work's, and those of the database.
  virtual Result<void> run(const Work& work) const = 0;

 protected:
  ~Queried() = default;

  // The result of a query, run as work.
  template <class Answer, class... Parameters, class... Arguments>
  Answer ask(Answer (*query)(Database&, Parameters...), const Arguments&... arguments) const {
    return read([&](Database& database) { return query(database, arguments...); });
  }
  template <class Query>
  auto read(Query query) const -> decltype(query(std::declval<Database&>())) {
    decltype(query(std::declval<Database&>())) answer = fail(Fault::internal, "database", "no answer");
    TRY(run([&](Database& database) -> Result<void> {
      answer = query(database);
      if (!answer) return tl::unexpected(answer.error());
      return {};
    }));
    return answer;
  }
};

// The queries of the past of Store or History.
template <class Base>
class SqlHistory : public Base, public Queried {
 public:
  Result<MissionPage> missions(const MissionFilter& filter, const PageRequest& page,
                               MissionSort sort) const override {
    return ask(queries::missions, filter, page, sort);
  }
  Result<Totals> totals(const MissionFilter& filter) const override { return ask(queries::totals, filter); }
  Result<std::vector<TotalsGroup>> grouped_totals(const MissionFilter& filter, Grouping by,
                                                  std::int64_t utc_offset_s) const override {
    return ask(queries::grouped_totals, filter, by, utc_offset_s);
  }
  Result<Trace> trace(MissionKey key, TimeRange range, std::int64_t max_points) const override {
    return ask(queries::trace, key, range, max_points);
  }
  Result<TelemetryPage> telemetry(MissionKey key, TimeRange range, const PageRequest& page) const override {
    return ask(queries::telemetry, key, range, page);
  }
  Result<CovariatePage> covariates(MissionKey key, TimeRange range, const PageRequest& page) const override {
    return ask(queries::covariates, key, range, page);
  }
};

// Common base of the stores: every query, and the keys of missions. If its program is the only writer, keys
// are assigned in memory.
class SqlStore : public SqlHistory<Store> {
 public:
  Result<MissionKey> new_mission_key() override;

  Result<std::vector<RobotRecord>> robots() const override { return ask(queries::robots); }
  Result<ModelVersion> model(std::string_view robot_id, std::optional<std::int64_t> version) const override {
    return ask(queries::model, robot_id, version);
  }
  Result<std::vector<ModelVersion>> model_versions(std::string_view robot_id) const override {
    return ask(queries::model_versions, robot_id);
  }
  Result<Mission> mission(MissionKey key) const override { return ask(queries::mission, key); }
  Result<FloorReading> floor_visits(const MissionFilter& filter, double cell_m, std::int64_t max_points,
                                    const FloorSink& sink) const override;
  Result<std::optional<RequestAnswer>> answer(std::string_view actor, std::string_view key) const override {
    return ask(queries::answer, actor, key);
  }
  Result<std::vector<AuditEntry>> audit(std::int64_t behind_id, std::int64_t limit,
                                        const LogFilter& filter) const override {
    return ask(queries::audit, behind_id, limit, filter);
  }
  Result<std::vector<Event>> events(std::int64_t behind_id, std::int64_t limit,
                                    const LogFilter& filter) const override {
    return ask(queries::events, behind_id, limit, filter);
  }
  Result<std::optional<ResumeState>> resume_state(std::string_view robot_id) const override {
    return ask(queries::resume_state, robot_id);
  }
  Result<std::vector<FloorPlan>> floor_plans() const override { return ask(queries::floor_plans); }
  Result<FloorPlan> floor_plan(std::string_view map, std::string_view level) const override {
    return ask(queries::floor_plan, map, level);
  }
  Result<std::optional<Learned>> learned(std::string_view robot_id, std::string_view topic) const override {
    return ask(queries::learned, robot_id, topic);
  }
  Result<std::vector<Learned>> all_learned(std::string_view topic) const override {
    return ask(queries::all_learned, topic);
  }
  Result<DiagnosisRecord> diagnosis(std::int64_t id) const override { return ask(queries::diagnosis, id); }
  Result<std::vector<DiagnosisRecord>> diagnoses(std::optional<std::string> robot_id, std::int64_t before_id,
                                                 std::int64_t limit) const override {
    return ask(queries::diagnoses, robot_id, before_id, limit);
  }
  Result<std::string> diagnosis_report(std::int64_t id) const override {
    return ask(queries::diagnosis_report, id);
  }
  Result<Proposal> proposal(std::int64_t id) const override { return ask(queries::proposal, id); }
  Result<std::vector<Proposal>> proposals(std::optional<std::string> robot_id, std::int64_t before_id,
                                          std::int64_t limit) const override {
    return ask(queries::proposals, robot_id, before_id, limit);
  }
  Result<std::vector<Mission>> recover() const override { return ask(queries::open_missions); }
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

#pragma once

#include <cstdint>
#include <functional>
#include <limits>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "base/error.h"
#include "base/try.h"
#include "history/commands.h"
#include "history/records.h"

namespace joulecast::history {

inline constexpr std::int64_t whole_past = std::numeric_limits<std::int64_t>::min();
inline constexpr std::int64_t whole_future = std::numeric_limits<std::int64_t>::max();

// Half-open: from <= utime < to.
struct TimeRange {
  std::int64_t from_utime_us = whole_past;
  std::int64_t to_utime_us = whole_future;
};

// Which missions; an absent member does not filter. Bounds are half-open: from <= value < to.
struct MissionFilter {
  std::vector<std::string> robot_ids;  // empty: any
  std::optional<std::string> mission_id;
  std::optional<std::string> name_contains;  // a part of mission_id; ASCII letters in any case
  TimeRange started;
  std::vector<MissionState> states;  // empty: any
  std::optional<bool> incomplete;
  // Closed: min <= payload <= max. Either one excludes missions of undeclared payload.
  std::optional<double> payload_min_kg;
  std::optional<double> payload_max_kg;
  // Closed, of signals::energy_ratio(). Either one excludes missions without a ratio.
  std::optional<double> ratio_min;
  std::optional<double> ratio_max;
};

inline constexpr std::size_t max_filter_robots = 10'000;

// The order of listed missions. Texts are compared by their bytes, states in the order of MissionState.
enum class MissionOrder {
  start,
  robot,
  mission,  // mission_id
  state,
  duration,
  distance,
  payload,
  energy,  // battery_j
  modelled,
  ratio,      // signals::energy_ratio()
  wh_per_km,  // signals::energy_per_distance_wh_km()
  charge      // charge_ah
};

// Ties go by key in the same direction; missions without a value come last in both.
struct MissionSort {
  MissionOrder by = MissionOrder::start;
  bool ascending = false;
};

inline constexpr std::int64_t max_page_size = 1000;

// `cursor` is a page's `next_cursor`, or empty for the first page. A cursor is opaque, valid only with the
// query it came from; any other is a Fault::invalid on field "cursor". `limit` is 1 to max_page_size.
struct PageRequest {
  std::int64_t limit = 50;
  std::string cursor;
};

// A mission that starts between two pages does not shift the others. A mission with a sort value that changes
// meanwhile may appear twice or not at all; only an open mission's value changes.
struct MissionPage {
  std::vector<Mission> missions;
  std::string next_cursor;  // empty: the last page
};

// Sums over missions, but for those that were annulled (MissionFindings). A mission that did not measure a
// quantity adds nothing to it; a quantity that none measured is NaN.
struct Totals {
  std::int64_t missions = 0;
  std::int64_t measured_missions = 0;  // those with measured energy
  std::int64_t incomplete_missions = 0;
  std::int64_t samples = 0;
  std::int64_t gap_count = 0;
  double gap_s = 0;
  signals::Accounts accounts;
};

enum class Grouping { robot, day, week, robot_day, robot_week };

inline constexpr std::size_t max_groups = 10'000;

// The totals of one robot, of the missions that started within one day or week, or of those of one robot.
struct TotalsGroup {
  std::string robot_id;            // by robot
  std::int64_t from_utime_us = 0;  // by day or week: its beginning
  Totals totals;
};

// Entries of the log of events or of the audit; of the latter, `kinds` are actions. Empty: all.
struct LogFilter {
  std::vector<std::string> robot_ids = {};  // of events alone
  std::vector<std::string> kinds = {};
  TimeRange range = {};
  bool newest_first = false;
};

inline constexpr std::int64_t max_trace_points = 20'000;
inline constexpr std::int64_t max_telemetry_samples = 100'000;

// In the order of arrival, which is not always that of utime.
template <class Item>
struct ItemPage {
  std::vector<Item> items;
  std::string next_cursor;  // empty: nothing follows
};
using TelemetryPage = ItemPage<signals::Sample>;
using CovariatePage = ItemPage<signals::CovariateChange>;

inline constexpr std::int64_t max_floor_points = 1'000'000;  // seconds of missions
inline constexpr double least_floor_cell_m = 0.1;
inline constexpr double greatest_floor_cell_m = 100;
// No robot has positions beyond this.
inline constexpr double farthest_floor_m = 1e6;
// A robot that is slower, on average over a second, stands or turns in place: its energy is not the floor's.
// With 0.02 and 0.1 m/s the energy over distance of a virtual AMR is 2 % more and 4 % less.
inline constexpr double least_floor_speed_m_s = 0.05;

// Sums over seconds of missions.
struct FloorSums {
  double covered_s = 0;
  double distance_m = 0;  // sum of the absolute mean speeds of the seconds
  double energy_j = 0;    // measured, or modelled where it was not
  double driving_j = 0;   // of energy_j
  // Over the seconds of driving in which both are available.
  double measured_j = 0;
  double modelled_j = 0;

  FloorSums& operator+=(const FloorSums& more);
};

// A mission's sums within one square of the floor, [column, column + 1) x [row, row + 1) cells from the
// origin of its robot's map, from the mission's trace: a second belongs to the square of its mean position.
struct FloorVisit : FloorSums {
  std::int32_t column = 0, row = 0;
};

struct FloorMission {
  MissionKey key = 0;
  std::string_view robot_id;
  std::span<const FloorVisit> visits;  // each square at most once, in no order
};

// The extent of a reading. Annulled and contradicted missions do not count.
struct FloorReading {
  std::int64_t missions = 0;       // that match
  std::int64_t missions_read = 0;  // all of them, or an even share where they last longer than was allowed
  std::int64_t points = 0;         // seconds read
};

// Takes one mission after the other; false ends the reading.
using FloorSink = std::function<bool(const FloorMission&)>;

struct StoreSize {
  std::int64_t database_bytes = 0;   // pages in use and free
  std::int64_t journal_bytes = 0;    // committed, not yet in the database's pages
  std::int64_t telemetry_bytes = 0;  // encoded raw telemetry and covariates
  std::int64_t telemetry_chunks = 0;
  std::int64_t missions = 0;
  std::int64_t audit_entries = 0;
};

// The outcome of one command: a number specified in its description, or the reason for its refusal.
using Outcome = Result<std::int64_t>;

class Database;  // sql.h

// Names this run of the program among all that ever wrote to a store.
std::string new_writer_name();

// The history of a fleet: one implementation for each database.
//
// Threads: apply() from one thread at a time (the Writer's); everything else from any thread, also during
// apply(). A query sees the commits before it began. Errors: Fault::not_found for a named thing that
// is absent, ::invalid for a broken constraint of the arguments, ::unavailable when the disk or database
// fails temporarily, ::corrupt when stored bytes cannot be trusted.
class Store {
 public:
  virtual ~Store() = default;

  // Applies the commands in order in one transaction. The result is one outcome a command: a refused one
  // (not_found, conflict, invalid) leaves no trace, and the others are applied; only a refused TakeSpool
  // refuses all. An error means that nothing was applied.
  virtual Result<std::vector<Outcome>> apply(std::span<const Command> commands) = 0;

  // After apply() failed with Fault::unavailable: whether it may have been committed all the same, which is
  // found out when the same commands are applied again; they are then not applied twice.
  virtual bool is_in_doubt() const { return false; }

  // The last batch that apply() committed, of this program or, before its first, the one before. Any thread.
  virtual BatchMark mark() const = 0;

  // How many commands apply() has dropped because their robots' leases are others'. Any thread.
  virtual std::uint64_t fenced() const { return 0; }
  // How many raw samples of such commands it has stored nevertheless. Any thread.
  virtual std::uint64_t fenced_samples() const { return 0; }

  // Checks that the store's files are still those that were opened; apply() calls it too. Fault::unavailable
  // if they were deleted or replaced, which lasts until the program is restarted, or if they cannot be
  // written at present. Call from apply()'s thread.
  virtual Result<void> check() { return {}; }

  // A key for StartMission, which no other mission has. From memory: never waits for the database.
  // Fault::unavailable if the database has been away for a thousand missions.
  virtual Result<MissionKey> new_mission_key() = 0;

  using Work = std::function<Result<void>(Database&)>;
  // Runs the work on a connection to the database, in one snapshot; perhaps again on another one, if it
  // fails. The errors are the work's, and those of the database.
  virtual Result<void> run(const Work& work) const = 0;

  // By robot_id ascending.
  Result<std::vector<RobotRecord>> robots() const;
  // The active version, or the given one.
  Result<ModelVersion> model(std::string_view robot_id,
                             std::optional<std::int64_t> version = std::nullopt) const;
  // Newest first; not_found when the robot is unknown.
  Result<std::vector<ModelVersion>> model_versions(std::string_view robot_id) const;

  Result<Mission> mission(MissionKey key) const;
  Result<MissionPage> missions(const MissionFilter& filter, const PageRequest& page,
                               MissionSort sort = {}) const;
  Result<Totals> totals(const MissionFilter& filter) const;
  // Groups that have missions, ascending by robot, then by time. Days begin at midnight, weeks on Monday, of
  // a clock that is `utc_offset_s` ahead of UTC. Fault::invalid on "group_by" for more than max_groups.
  Result<std::vector<TotalsGroup>> grouped_totals(const MissionFilter& filter, Grouping by,
                                                  std::int64_t utc_offset_s) const;

  // At most max_points buckets (1 to max_trace_points): neighbours are merged by least, time-weighted mean
  // and greatest, cumulative values by the last. not_found when the mission is unknown.
  Result<Trace> trace(MissionKey key, TimeRange range, std::int64_t max_points) const;
  // At most `page.limit` samples (1 to max_telemetry_samples). Empty when the retention dropped them;
  // not_found when the mission is unknown.
  Result<TelemetryPage> telemetry(MissionKey key, TimeRange range, const PageRequest& page) const;

  // Changes of the covariates: at most `page.limit` (1 to max_telemetry_samples). Values that apply at the
  // range's beginning changed before it. Empty when the retention dropped them; not_found: no such mission.
  Result<CovariatePage> covariates(MissionKey key, TimeRange range, const PageRequest& page) const;
  // Passes each mission that matches to the sink, in the order of keys, outside of any lock: its sums by
  // square of `cell_m` metres (least_floor_cell_m to greatest_floor_cell_m). Reads at most about `max_points`
  // seconds of missions (1 to max_floor_points); above that, an even share of the missions.
  Result<FloorReading> floor_visits(const MissionFilter& filter, double cell_m, std::int64_t max_points,
                                    const FloorSink& sink) const;

  // Events behind that id in the filter's order, at most `limit` (1 to max_page_size).
  Result<std::vector<Event>> events(std::int64_t behind_id, std::int64_t limit,
                                    const LogFilter& filter = {}) const;

  // The stored answer to that request; absent if none is stored.
  Result<std::optional<RequestAnswer>> answer(std::string_view actor, std::string_view key) const;

  // The same of the audit.
  Result<std::vector<AuditEntry>> audit(std::int64_t behind_id, std::int64_t limit,
                                        const LogFilter& filter = {.newest_first = true}) const;

  // Absent when none was ever put.
  Result<std::optional<ResumeState>> resume_state(std::string_view robot_id) const;

  // By map and level, without their images.
  Result<std::vector<FloorPlan>> floor_plans() const;
  Result<FloorPlan> floor_plan(std::string_view map, std::string_view level) const;

  // The training state of the robot under the topic; absent if none is stored.
  Result<std::optional<Learned>> learned(std::string_view robot_id, std::string_view topic) const;
  Result<DiagnosisRecord> diagnosis(std::int64_t id) const;
  // Newest first, with id < before_id, at most `limit` (1 to max_page_size); of one robot when given. Lists
  // leave out result_json and model_json.
  Result<std::vector<DiagnosisRecord>> diagnoses(const std::optional<std::string>& robot_id,
                                                 std::int64_t before_id, std::int64_t limit) const;
  // The report of a diagnosis as HTML; not_found when it has none.
  Result<std::string> diagnosis_report(std::int64_t id) const;
  Result<Proposal> proposal(std::int64_t id) const;
  // As diagnoses().
  Result<std::vector<Proposal>> proposals(const std::optional<std::string>& robot_id, std::int64_t before_id,
                                          std::int64_t limit) const;

  // At start: the missions that were open when the last daemon ended, oldest first. Each is to be resumed
  // (just go on checkpointing it) or ended by a checkpoint with MissionState::interrupted.
  Result<std::vector<Mission>> recover() const;

  virtual Result<StoreSize> size() const = 0;

  // What was learned of every robot on a topic, by id.
  Result<std::vector<Learned>> all_learned(std::string_view topic) const;

 protected:
  // The result of a query, run as work.
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

}  // namespace joulecast::history

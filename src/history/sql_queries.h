#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "base/error.h"
#include "history/sql.h"
#include "history/store.h"

// Store's queries as SQL, each on a connection within a read transaction. They throw SqlError.
namespace joulecast::history::queries {

tl::unexpected<Error> no_mission(MissionKey key);
// Whether the store has this mission.
bool has_mission(Database& database, MissionKey key);

// Fault::invalid on `field` unless 1 <= limit <= greatest.
Result<void> check_limit(std::string_view field, std::int64_t limit, std::int64_t greatest);

Result<std::vector<RobotRecord>> robots(Database& database);
Result<ModelVersion> model(Database& database, std::string_view robot_id,
                           std::optional<std::int64_t> version);
Result<std::vector<ModelVersion>> model_versions(Database& database, std::string_view robot_id);

Result<Mission> mission(Database& database, MissionKey key);
Result<MissionPage> missions(Database& database, const MissionFilter& filter, const PageRequest& page,
                             MissionSort sort);
Result<Totals> totals(Database& database, const MissionFilter& filter);
Result<std::vector<TotalsGroup>> grouped_totals(Database& database, const MissionFilter& filter, Grouping by,
                                                std::int64_t utc_offset_s);
// Which missions are read for a map of the floor.
struct FloorChoice {
  struct Chosen {
    MissionKey key = 0;
    std::string robot_id;
    std::int64_t points = 0;  // at most
  };
  std::int64_t missions = 0;   // that match
  std::vector<Chosen> chosen;  // by key: all of them, or an even share that has at most so many points
};
Result<FloorChoice> floor_missions(Database& database, const MissionFilter& filter, std::int64_t max_points);
// How many of the first are to be read in one query; 0 of none.
std::size_t next_at_once(std::span<const FloorChoice::Chosen> chosen);
struct FloorSums {
  std::vector<std::vector<FloorVisit>> visits;  // of each mission
  std::int64_t points = 0;
};
Result<FloorSums> floor_sums(Database& database, std::span<const FloorChoice::Chosen> chosen, double cell_m);
Result<std::vector<Mission>> open_missions(Database& database);
// The last one of that robot and name before the time; 0: none.
MissionKey last_called(Database& database, std::string_view robot_id, std::string_view mission_id,
                       std::int64_t before_utime_us);
// 0 when there are no missions.
MissionKey greatest_key(Database& database);

Result<Trace> trace(Database& database, MissionKey key, TimeRange range, std::int64_t max_points);
Result<TelemetryPage> telemetry(Database& database, MissionKey key, TimeRange range, const PageRequest& page);
Result<CovariatePage> covariates(Database& database, MissionKey key, TimeRange range,
                                 const PageRequest& page);

Result<std::vector<Event>> events(Database& database, std::int64_t behind_id, std::int64_t limit,
                                  const LogFilter& filter);
Result<std::vector<AuditEntry>> audit(Database& database, std::int64_t behind_id, std::int64_t limit,
                                      const LogFilter& filter);
Result<std::optional<ResumeState>> resume_state(Database& database, std::string_view robot_id);
Result<std::optional<RequestAnswer>> answer(Database& database, std::string_view actor, std::string_view key);
tl::unexpected<Error> no_floor_plan(std::string_view map, std::string_view level);
Result<std::vector<FloorPlan>> floor_plans(Database& database);
Result<FloorPlan> floor_plan(Database& database, std::string_view map, std::string_view level);
Result<std::optional<Learned>> learned(Database& database, std::string_view robot_id, std::string_view topic);
Result<std::vector<Learned>> all_learned(Database& database, std::string_view topic);

Result<DiagnosisRecord> diagnosis(Database& database, std::int64_t id);
Result<std::vector<DiagnosisRecord>> diagnoses(Database& database, const std::optional<std::string>& robot_id,
                                               std::int64_t before_id, std::int64_t limit);
Result<std::string> diagnosis_report(Database& database, std::int64_t id);
Result<Proposal> proposal(Database& database, std::int64_t id);
Result<std::vector<Proposal>> proposals(Database& database, const std::optional<std::string>& robot_id,
                                        std::int64_t before_id, std::int64_t limit);

}  // namespace joulecast::history::queries

#pragma once

#include <nlohmann/json_fwd.hpp>
#include <span>
#include <string>
#include <utility>
#include <vector>

#include "base/error.h"
#include "gap/runs/run_table.h"
#include "gap/verdict/diagnosis.h"
#include "telemetry/log_recordings.h"

namespace joulecast::gap {

// The strength of one cause in one group, above that in the group where it is weakest: only differences show.
struct GroupStrength {
  std::string group;
  double value = 0, deviation = 0;
  double energy_per_m_j = 0;  // by which this raises the energy of a metre; NaN: no power was measured
};

// A cause with a strength that differs between groups.
struct ComparedEffect {
  std::string id, parameter, unit;
  std::vector<GroupStrength> groups;
};

struct ComparedGroup {
  std::string name;
  std::size_t missions = 0, samples = 0;
  double way_m = 0;
  // Measured, and by the model with the causes that all groups share; NaN: no power was measured.
  double energy_per_m_j = 0, model_per_m_j = 0;
};

// Decomposition of the difference in energy per metre between the groups that spend least and most.
struct GroupDifference {
  std::string from, to;       // names of groups
  double energy_per_m_j = 0;  // measured, `to` above `from`
  double by_motion_j = 0;     // by the model, from their motion and payload
  std::vector<std::pair<std::string, double>> by_effect_j;
  double unexplained_j = 0;
};

// Differences between groups of missions of one robot: floors, drivers, gears, days.
struct Comparison {
  // Gap and errors are those of the model with the common causes; strengths are those of the groups that are
  // furthest apart, the stronger less the weaker; the regression is one in each group. Nothing is to be
  // adopted.
  Diagnosis diagnosis;
  std::vector<ComparedGroup> groups;
  std::vector<std::string> common;  // causes that all groups share, in addition to the file's
  std::vector<ComparedEffect> effects;
  std::optional<GroupDifference> difference;
  std::vector<std::string> limits;
};

// Returns the group of each mission. "prefix" is the part before the first '-' of its id, "suffix" the part
// after the last '_'; any other name is a label ("surface" of the covariates "surface=..."), with the value
// that was active longest in the mission. Fault::invalid for a label that a mission lacks.
Result<std::vector<std::string>> groups_of(const telemetry::RecordingSet& recordings, const std::string& by);

// Compares the groups. Fault::invalid for fewer than two groups, or one with too little motion.
Result<Comparison> compare_recordings(const telemetry::RecordingSet& recordings,
                                      std::span<const std::string> group_of_mission,
                                      const robot::RobotModel& robot, const Progress& progress = {});
Result<Comparison> compare_runs(const RunSet& runs, std::span<const std::string> group_of_run,
                                const robot::RobotModel& robot, const Progress& progress = {});

// Returns the JSON that `joulecast gap --compare-by --json` prints: a diagnosis's JSON of the differences,
// `kind` "comparison", and the fields of groups.
nlohmann::ordered_json comparison_to_json(const Comparison& comparison);

}  // namespace joulecast::gap

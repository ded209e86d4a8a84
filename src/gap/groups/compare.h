#pragma once

#include <functional>
#include <span>
#include <string>
#include <vector>

#include "base/error.h"
#include "gap/runs/run_table.h"
#include "gap/verdict/diagnosis.h"
#include "telemetry/recording_set.h"

namespace joulecast::gap {

// What one cause is in one group, beside its mean over all.
struct GroupStrength {
  double value = 0, deviation = 0;
  double energy_per_m_j = 0;  // by which it raises the energy of a metre there; NaN: no power was measured
};

// A cause whose strength differs between groups.
struct ComparedEffect {
  std::string id, parameter, unit;
  std::vector<GroupStrength> groups;  // in the order of Comparison::groups
};

struct ComparedGroup {
  std::string name;
  std::size_t missions = 0, samples = 0;
  double way_m = 0;
  // Measured, and by the model with what all groups share; NaN: no power was measured.
  double energy_per_m_j = 0, model_per_m_j = 0;
};

// Where the difference in energy per metre between the groups that spend least and most comes from.
struct GroupDifference {
  std::size_t from = 0, to = 0;     // groups
  double energy_per_m_j = 0;        // measured, `to` above `from`
  double by_motion_j = 0;           // that the model makes of how they drove and what they carried
  std::vector<double> by_effect_j;  // of each compared effect
  double unexplained_j = 0;
};

// What changes between groups of missions of one robot: floors, drivers, gears, days.
struct Comparison {
  // As of recordings, but of differences: gap and errors are those of the model with what all groups share,
  // strengths are those of the groups that are furthest apart, the stronger less the weaker. The referee is a
  // plain regression in each group.
  // Nothing is to be adopted.
  Diagnosis diagnosis;
  std::vector<ComparedGroup> groups;
  std::vector<std::string> common;  // causes that all groups share, beside the robot file
  std::vector<ComparedEffect> effects;
  std::optional<GroupDifference> difference;
  std::vector<std::string> limits;
};

struct CompareSettings {
  std::function<bool(double)> progress;  // called with 0..1; false cancels
};

// The group of each mission: "prefix" is what stands before the first '-' of its id, "suffix" what stands
// after the last '_', anything else the label of that name ("surface" of the covariates "surface=...") that
// it bore for most of its time. Fault::invalid for a label that a mission has not.
Result<std::vector<std::string>> groups_of(const telemetry::RecordingSet& recordings, const std::string& by);

// Fault::invalid for fewer than two groups, or one with too little motion; Fault::conflict when cancelled.
Result<Comparison> compare_recordings(const telemetry::RecordingSet& recordings,
                                      std::span<const std::string> group_of_mission,
                                      const robot::RobotModel& robot, const CompareSettings& settings = {});
Result<Comparison> compare_runs(const RunSet& runs, std::span<const std::string> group_of_run,
                                const robot::RobotModel& robot, const CompareSettings& settings = {});

}  // namespace joulecast::gap

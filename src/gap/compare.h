#pragma once

#include <functional>
#include <nlohmann/json_fwd.hpp>
#include <span>
#include <string>
#include <vector>

#include "telemetry/recording_set.h"
#include "robot/robot_model.h"

namespace joulecast::gap {

struct GroupStrength {
  double value = 0;
  double deviation =
      0;  // one standard deviation, by leaving out one mission at a time; NaN: one mission only
};

// An effect whose strength is asked for in every group of recordings.
struct ComparedEffect {
  std::string id, parameter, unit;
  std::vector<GroupStrength> groups;  // in the order of Comparison::groups
  double gain = 0;       // log evidence for strengths of their own over one for all, the others held common
  double chance = 1;     // that groups of equal strength differ as much (chi-square over the deviations)
  bool differs = false;  // evidence and chance both say so
  bool possible = true;  // within the effect's bounds in every group; otherwise it stands for something else
};

struct ComparedGroup {
  std::string name;
  std::size_t missions = 0, samples = 0;
};

// What changes between groups of recordings of one robot: floors, gears, days.
struct Comparison {
  std::string robot_id;
  bool motor_currents = true;  // false: judged from battery power and motion
  bool power_known = true;     // false: the recordings hold no power
  std::vector<ComparedGroup> groups;
  std::vector<std::string> common;      // effects that are there with one strength for all groups
  std::vector<ComparedEffect> effects;  // that differ, by what each explains; then common ones, for reading
  std::vector<std::string> limits;
};

// The group of a mission by its id: what stands before the first '-', or for a suffix of gears and the like
// what stands after the last '_'.
enum class GroupBy { prefix, suffix };
std::string group_of(const std::string& mission_id, GroupBy by);

// Finds the effects at the wheels that these recordings show, and which of them need a strength of their own
// in each group. Motors, masses and sensors are taken to be the same in all groups. Fault::invalid for fewer
// than two groups with motion.
Result<Comparison> compare_groups(const telemetry::RecordingSet& recordings,
                                  std::span<const std::string> group_of_mission,
                                  const robot::RobotModel& robot,
                                  const std::function<bool(double)>& progress = {});

nlohmann::json to_json(const Comparison& comparison);

}  // namespace joulecast::gap

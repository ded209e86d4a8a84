#pragma once

#include <optional>
#include <span>
#include <string>
#include <vector>

#include "dynamics/drive_model.h"
#include "forecast/leg_cost.h"
#include "forecast/robot_forecast.h"
#include "robot/robot_model.h"
#include "telemetry/recording.h"

namespace joulecast::forecast {

// A leg of a planned mission with the pace that its plan states.
struct StatedLeg {
  PlannedLeg leg;
  double speed = 0, acceleration = 0;  // of a moving leg: m or rad
};

// One mission: its plan, its legs as the service recorded them, and its true cost.
struct DrivenMission {
  std::vector<StatedLeg> plan;
  PastMission past;
  double metered_j = 0;  // by the service's meter, noise and sensor faults included
  double true_j = 0;     // the metered energy where the true one is unavailable
  double duration_s = 0;
  double distance_m = 0;
  double charge_at_start = 1, charge_at_end = 1;
};

struct RobotRun {
  std::string name;
  robot::RobotModel robot;  // the service's model
  dynamics::DriveModel drive;
  std::vector<DrivenMission> missions;
};

// The samples of missions through meter and leg tracker, as the service does it; plans stay empty.
std::vector<DrivenMission> driven(const robot::RobotModel& robot, const dynamics::DriveModel& drive,
                                  std::span<const telemetry::Recording> recordings);

// A fleet recorded outside the project: DIRECTORY/robot.json and telemetry.lcmlog.gz. Plans are read from the
// velocity commands. Empty where the recording is absent.
std::optional<RobotRun> recorded_fleet_robot(const std::string& directory);

// Tables of a foreign robot, imported by its mapping; those of a name order. Plans are the legs as driven.
std::optional<RobotRun> recorded_tables(const std::string& directory, const std::string& robot_file,
                                        const std::string& mapping_file);

}  // namespace joulecast::forecast

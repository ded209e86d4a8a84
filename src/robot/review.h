#pragma once

#include <string>
#include <vector>

#include "base/error.h"
#include "robot/robot_model.h"

namespace joulecast::robot {

// A value of a robot file that is within every bound but implausible, or that prevents planning.
struct ReviewFinding {
  bool fault = false;  // no motion can be planned; else suspicious only
  std::string field;   // JSON pointer
  double value = 0;    // the value shown in `says`, in its unit there; not always the field's
  std::string says;
};

// Figures that follow from a file, straight on the flat, without payload and adopted effects.
struct Figures {
  double top_speed_m_s = 0;      // at the nominal voltage; not above 0: the robot does not start
  double acceleration_m_s2 = 0;  // from standing, at the lower of the current limit and the stall current
  double energy_wh = 0;          // of a full battery
  double standing_h = 0;         // that it lasts at idle power; infinite where that is 0
};

Figures figures_of(const RobotModel& model);

// Of a model that validate() accepts; faults first. From the file's own numbers by the steady motor equations
// V = R i + K_w n w, K_t n i = T_m + nu w at the nominal voltage; adopted effects are left out.
std::vector<ReviewFinding> review(const RobotModel& model);

// Every fault as one Fault::invalid, as read_robot reports several.
Result<void> plannable(const std::vector<ReviewFinding>& findings);

}  // namespace joulecast::robot

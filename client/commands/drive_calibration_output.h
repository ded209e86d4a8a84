#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "energy/calibration.h"
#include "energy/power_calibration.h"

namespace joulecast::client {

// One mission's energy, measured and by both models, at the motors or, where measured, at the battery.
struct CalibratedMission {
  std::string mission_id;
  bool trained_on = false;
  bool at_battery = false;
  double measured_j = 0;
  double before_j = 0;  // by the robot file as given
  double after_j = 0;   // by the calibrated one

  double error_before() const { return before_j / measured_j - 1; }
  double error_after() const { return after_j / measured_j - 1; }
};

// One of both calibrations.
struct DriveOutcome {
  std::string_view method;
  std::optional<energy::DriveCalibration> by_motors;
  std::optional<energy::PowerCalibration> by_power;
  std::vector<CalibratedMission> missions;

  const robot::RobotModel& robot() const { return by_motors ? by_motors->robot : by_power->robot; }
  const std::vector<energy::ParameterEstimate>& estimates() const {
    return by_motors ? by_motors->estimates : by_power->estimates;
  }
};

void print_json(const DriveOutcome& outcome);
void print_text(const DriveOutcome& outcome);

}  // namespace joulecast::client

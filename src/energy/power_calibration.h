#pragma once

#include <cstddef>
#include <functional>
#include <span>
#include <string>
#include <vector>

#include "base/error.h"
#include "energy/calibration.h"
#include "energy/power_windows.h"
#include "robot/robot_model.h"
#include "telemetry/recording.h"

namespace joulecast::energy {

// One or several parameters that battery power alone cannot identify, and the reason.
struct Untold {
  std::string what;  // as in the robot file
  std::string why;   // a sentence's end, without its full stop
};

struct PowerCalibration {
  robot::RobotModel robot;  // the file with the estimates in it
  // `fitted`: the data identify it, with its standard error (about 95 % lie within two). Otherwise it stays
  // near the file's value, which the data change little, and the standard error is the file's as well.
  std::vector<ParameterEstimate> estimates;
  std::vector<Untold> untold;
  std::size_t windows = 0, blocks = 0;
  double effective_windows = 0;  // number of independent windows with the same information
  double reading_s = 0;          // between readings of battery power
  bool held = false;             // rows repeat these readings
  double slowest_rad_s = 0, fastest_rad_s = 0;
  double power_w = 0, left_w = 0;  // mean absolute power, and mean absolute residual of the fit
  MissedPower halves;              // each half predicted from the other, both together
};

struct PowerCalibrationOptions {
  bool resistance_known = false;                    // taken from the robot file
  std::function<void(double share)> progress = {};  // called with the share done
};

// Identifies the parameters of a drive from battery voltage and current [V, A, discharging positive] and
// wheel speeds, without any motor channel: P = idle + sum over sides of (T w + R (T/(K_t n))^2), with driver
// loss and unreturned braking, T from friction, inertia and scrub (dynamics/drive_model.h). Readings count
// where the sensor delivered a new value (windows/windows.h); the robot file is used where they contain no
// information (power_windows.h). Scrub, driver loss and unreturned braking enter the robot
// file only where they are two standard errors from zero.
//
// Fault::invalid when battery power is not measured, or for less than 40 windows in 4 blocks of 15 s.
Result<PowerCalibration> calibrate_from_power(const robot::RobotModel& robot,
                                              std::span<const telemetry::Recording> missions,
                                              const PowerCalibrationOptions& options = {});

}  // namespace joulecast::energy

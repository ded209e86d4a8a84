#pragma once

#include <Eigen/Dense>
#include <span>
#include <vector>

#include "base/error.h"
#include "dynamics/drive_model.h"
#include "energy/power_parameters.h"
#include "statistics/regression.h"
#include "telemetry/recording.h"
#include "windows/windows.h"

namespace joulecast::energy {

// Smooth windows with new readings of battery power, and the blocks that are left out together.
struct PowerWindows {
  std::vector<windows::Window> windows;
  std::vector<bool> whole;  // each wheel moves or rests throughout: the model is sure of the friction's sign
  std::size_t blocks = 0;   // numbered with time
  windows::Readings readings;
};

// Fault::invalid where battery power is not measured, or too little of it.
Result<PowerWindows> power_windows(std::span<const telemetry::Recording> missions,
                                   const robot::RobotModel& robot);

PowerScale scale_of(std::span<const windows::Window> windows);

// Mean reading of the battery's power meter over a window by a model [W]: begin, middle and end each with
// their own speed.
double metered_power_w(const dynamics::DriveModel& model, const windows::Window& window);

// Power on windows::plain_terms(), by robust regression.
class PlainRegression {
 public:
  PlainRegression(std::span<const windows::Window> windows, const robot::RobotModel& robot);
  double power_w(const windows::Window& window) const;
  double copperless_friction_nm() const;  // of each wheel, if all that grows with speed were dry friction

 private:
  double wheel_radius_m_;
  statistics::Regression fit_;
};

// Relative error of the battery's power in windows: sum |predicted - measured| over sum |measured|.
struct MissedPower {
  double file = 0;        // by the robot file
  double corrected = 0;   // by a model that was fitted to other windows
  double regression = 0;  // by a plain regression on those other windows
};

// Accumulates it.
class MissedPowerMeter {
 public:
  void add(const windows::Window& window, const dynamics::DriveModel& file,
           const dynamics::DriveModel& corrected, const PlainRegression& regression);
  MissedPower value() const;

 private:
  double measured_w_ = 0;
  MissedPower missed_w_;
};

}  // namespace joulecast::energy

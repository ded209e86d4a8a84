#pragma once

#include <Eigen/Dense>
#include <array>
#include <cstddef>
#include <map>
#include <span>
#include <string_view>
#include <vector>

#include "base/error.h"
#include "dynamics/catalogue.h"
#include "dynamics/drive_model.h"
#include "robot/robot_model.h"
#include "statistics/regression.h"
#include "telemetry/recording.h"
#include "windows/windows.h"

namespace joulecast::energy {

// Inertia of an empty robot at each wheel's motor [kg m^2].
struct WheelInertia {
  double straight = 0;  // both wheels with the same acceleration
  double turning = 0;   // they accelerate oppositely
};

// By members of the robot file; mass is that of the whole robot.
inline constexpr std::string_view
    straight_inertia_sum = "mass * wheel_radius^2 / 2 + wheel_inertia + rotor_inertia",
    turning_inertia_sum = "yaw_inertia * (wheel_radius / half_track)^2 / 2 + wheel_inertia + rotor_inertia";

WheelInertia wheel_inertia(const robot::RobotModel& robot);

// Gives a robot this inertia [kg m^2]. Motion shows only the sums, so the rotor takes the inertia that the
// file's mass does not explain; where the rotor's would be negative, the chassis is made lighter, down to a
// hundredth of its mass. A turning inertia below that of wheels and rotors leaves the yaw inertia unchanged.
void place_straight_inertia(double straight_kg_m2, robot::RobotModel& robot);
void place_turning_inertia(double turning_kg_m2, robot::RobotModel& robot);

// Parameters of a drive that battery power and motion may identify, at the wheel. The last three are effects
// of the catalogue and count beyond the strengths that the robot file has adopted.
struct PowerParameter {
  enum : Eigen::Index {
    idle_power,
    friction,             // mean of both sides
    friction_difference,  // right less left
    viscous,
    straight_inertia,  // WheelInertia::straight
    turning_inertia,   // WheelInertia::turning
    resistance,        // through the copper loss R (T/(K_t n))^2 alone
    turning_scrub,     // friction coefficient of turning contacts
    driver_loss,       // of the motors' absolute power
    unreturned,        // of the motors' braking power
    count
  };
  std::string_view name, unit;
  std::string_view meaning;
  std::string_view not_in_the_motion;  // why the data do not identify it
};
inline constexpr std::array<PowerParameter, PowerParameter::count> power_parameters{{
    {"idle_power_w", "W", "computers, drivers and all other loads at rest", "power barely differs from zero"},
    {"friction_torque_nm mean", "N m", "", "the robot barely moves"},
    {"friction_torque_nm right - left", "N m", "",
     "both wheels turn alike, so that only the sum of their frictions counts"},
    {"viscous_friction_nm_s_rad", "N m s/rad", "", "the robot barely moves, or always at one speed"},
    {"straight inertia", "kg m2", straight_inertia_sum, "the speed changes too little"},
    {"turning inertia", "kg m2", turning_inertia_sum, "the rate of turning changes too little"},
    {"resistance_ohm", "ohm", "from the copper loss alone, as resistance / torque constant^2",
     "it changes only the copper loss, which is too small"},
    {"turning_scrub", "1", "effect, adopted", "the robot barely turns"},
    {"driver_loss", "1", "effect, adopted",
     "the motors' power barely differs from that of friction and inertia"},
    {"no_regeneration", "1", "effect, adopted", "the motors barely brake"},
}};

using PowerVector = Eigen::Matrix<double, PowerParameter::count, 1>;

constexpr const PowerParameter& parameter_at(Eigen::Index p) {
  return power_parameters[static_cast<std::size_t>(p)];
}

// Sizes that determine how far a parameter may lie from an incomplete robot file.
struct PowerScale {
  double power_w = 1;      // mean absolute battery power
  double speed_rad_s = 1;  // mean absolute wheel speed while moving
};

// The parameters as deviations from the robot file, each in units of its expected deviation: x = 0 is the
// file, and x ~ N(0, 1) is the prior. Idle power and friction may have any value up to the size of the power,
// since files rarely contain them; inertia, resistance and effects have the deviations of a data sheet.
class PowerParameters {
 public:
  // Fault::invalid when the catalogue rejects an effect of the robot file.
  static Result<PowerParameters> make(const robot::RobotModel& robot, const PowerScale& scale,
                                      bool resistance_known);

  // Yaw rate at which the moment of turning has built up [rad/s]; a file that has scrub keeps its own.
  void set_scrub_rate(double rate_rad_s);
  bool scrub_rate_is_free() const { return !file_has_scrub_; }

  double expected(Eigen::Index p) const { return expected_[p]; }  // 0: held at the file's
  // In its own unit. The friction of a side is at least zero for every mean and difference.
  double value(Eigen::Index p, const PowerVector& x) const;
  // The value in robot(): of an effect, with the file's strength, which its least change removes.
  double resulting(Eigen::Index p, const PowerVector& x) const {
    return value(p, x) - (p >= PowerParameter::turning_scrub ? least_[p] : 0);
  }
  double least(Eigen::Index p) const { return in_units(p, least_[p]); }  // bounds in units of x
  double most(Eigen::Index p) const { return in_units(p, most_[p]); }

  dynamics::DriveModel model(const PowerVector& x) const;
  // The robot file with these values in it. Effects without strength are left out.
  robot::RobotModel robot(const PowerVector& x) const;

 private:
  explicit PowerParameters(const robot::RobotModel& robot) : robot_(robot) {}
  double plain_value(Eigen::Index p, const PowerVector& x) const { return file_[p] + expected_[p] * x[p]; }
  double in_units(Eigen::Index p, double value) const {
    return expected_[p] > 0 ? (value - file_[p]) / expected_[p] : 0;
  }
  std::array<double, 2> friction_nm(const PowerVector& x) const;
  robot::RobotModel without_effects(const PowerVector& x) const;
  std::vector<dynamics::ActiveEffect> found_effects(const PowerVector& x) const;

  robot::RobotModel robot_;
  std::vector<dynamics::ActiveEffect> adopted_;
  PowerVector file_, expected_, least_, most_;
  double scrub_rate_rad_s_ = 0;
  bool file_has_scrub_ = false;
};

// Smooth windows with new readings of battery power, and the blocks that are left out together.
struct PowerWindows {
  std::vector<windows::Window> windows;
  std::vector<bool> whole;  // each wheel moves or rests throughout: the model is sure of the friction's sign
  std::size_t blocks = 0;   // numbered with time
  windows::Readings readings;
  double phase = windows::missing;  // of row_phases, where rows are far apart
};

// Where rows are so far apart that the motion is known between them only: part of a period by which the mean
// that a row's power stands for begins before the row. Loggers read or average everything at once, or they
// average power since their last row.
inline constexpr std::array row_phases{0.5, 1.0};

// `phase` is of no account where rows are near. Fault::invalid where battery power is not measured, or too
// little of it.
Result<PowerWindows> power_windows(std::span<const telemetry::Recording> missions,
                                   const robot::RobotModel& robot, double phase);

// The recordings with half of their rows; the power of each is the mean over its doubled period.
std::vector<telemetry::Recording> every_second_row(std::span<const telemetry::Recording> missions,
                                                   double phase);

PowerScale scale_of(std::span<const windows::Window> windows);

// Mean reading of the battery's power meter over a window by a model [W]: its begin, middle and end
// each with their own speed.
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
  double regression = 0;  // by a linear regression on those other windows
  double lead_sd = 0;     // standard error of corrected - regression over blocks; NaN for one

  bool regression_wins() const { return corrected - regression > lead_sd; }
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
  std::map<std::size_t, double> lead_w_;  // by block
};

// Battery power of missions that were not used for a fit, by a robot file, by the file corrected from other
// missions, and by a linear regression on those others.
struct RegressionComparison {
  std::size_t windows = 0;
  MissedPower missed;
};

// Fault::invalid when power is not measured or too little of it, in either set of missions, or when the
// catalogue of effects rejects a model; the error names the missing data.
Result<RegressionComparison> compare_with_regression(std::span<const telemetry::Recording> learnt_from,
                                                     std::span<const telemetry::Recording> tested,
                                                     const robot::RobotModel& file,
                                                     const robot::RobotModel& corrected);

}  // namespace joulecast::energy

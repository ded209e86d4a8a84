#pragma once

#include <cstddef>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "base/error.h"
#include "energy/meter.h"
#include "robot/robot_model.h"
#include "signals/ledger.h"
#include "signals/sample.h"
#include "telemetry/recording.h"

namespace joulecast::energy {

// Parameters of a drive from recorded runs: motor voltages and currents [V, A] and wheel speeds [rad/s].
//
//   electrical   V = R i + K_w n w
//   torque       K_t n i = T_m sgn(w) + nu w + J_f a_mean +- J_t a_diff + T_0
//   a_mean, a_diff = (a_right +- a_left)/2;  J_f = m r^2/2 + I_w + I_s;  J_t = 2 I c^2 + I_w + I_s, c =
//   r/(2l)
//
// T_0 is the torque that the robot file's model attributes to payload, centre of mass and adopted effects.
// Effects that change a term (gear efficiency, friction, constants, brushes, sensors of the motors) are in
// it, so that the coefficients are the file's parameters beside these effects. Such runs cannot distinguish
// mass from rotor inertia (only J_f is seen), nor the scale of all torques from K_t. The file's ratio K_t/K_w
// (1 for an ideal machine) ties K_t to the K_w that the voltages show.

// Both are moment equations over smooth windows (windows/windows.h), whose means and slopes satisfy them
// exactly. The readings' own noise, which least squares takes for motion and current (errors in variables:
// Fuller, Measurement Error Models, 1987, section 2.2), is subtracted from the moments: its covariance
// follows from the third differences of neighbouring readings (Gasser, Sroka and Jennen-Steinmetz, Biometrika
// 73, 1986).
//
// steady: thesis (3-1), windows of straight motion at constant speed. Does not see inertia; the torque of a
// slow ramp's remaining acceleration is subtracted with the file's inertia.
//
// whole: every window in which both wheels move.
enum class CalibrationMethod { steady, whole };

struct CalibrationOptions {
  CalibrationMethod method = CalibrationMethod::steady;
  // Taken from the robot file instead of being fitted.
  bool resistance_known = false;
  bool constants_known = false;
  // Constant speed: both wheels' accelerations below this share of the fastest wheel speed a second.
  double steady_fraction_1_s = 0.1;
};

struct ParameterEstimate {
  std::string_view name;  // as in the robot file, or a combination of which only the whole is identifiable
  std::string_view unit;
  double value = 0;
  double standard_error = 0;  // two cover about 95 %
  bool fitted = false;        // false: held at `value`
  std::string note;           // why it was held, or its meaning
};

struct DriveCalibration {
  robot::RobotModel robot;  // the file with the fitted parameters in it
  // Standard errors by the jackknife over missions (fewer than five: over parts of them), widened to
  // Student's t: what differs from mission to mission is in them.
  std::vector<ParameterEstimate> estimates;
  std::size_t blocks = 0;   // that the jackknife leaves out in turn
  std::size_t windows = 0;  // that took part
  double slowest_rad_s = 0, fastest_rad_s = 0;
  double voltage_rms_v = 0;  // residual of the electrical equation (NaN: voltage not measured)
  double torque_rms_nm = 0;  // residual of the torque equation
  // By which voltages are newer than the speeds (and than currents that are of the speeds' instant), where
  // that is certain and changes the resistance; else 0. Readings at one phase of a controller's period differ
  // so, and means beside instantaneous readings. The inertias' errors contain its effect.
  double electrical_delay_s = 0;
};

// Fault::invalid when current is not measured, or nothing moves steadily; the error names the missing data.
Result<DriveCalibration> calibrate_drive(const robot::RobotModel& robot,
                                         std::span<const telemetry::Recording> missions,
                                         const CalibrationOptions& options);

struct DriveRun {
  std::string name;
  std::span<const signals::Sample> samples;  // in order of time
  double payload_kg = 0;
  std::span<const double> climb_rad = {};  // at each sample (dynamics/climb.h); empty: their pitch

  double climb_at(std::size_t k) const { return climb_rad.empty() ? samples[k].pitch_rad : climb_rad[k]; }
};

// The filter window [s] on each side that sees at least two neighbours at the runs' median interval.
double half_window_for(std::span<const DriveRun> runs);

// Meters a whole run, with its payload, its climb and its gaps. Errors are the meter's.
Result<void> meter_run(Meter& meter, const DriveRun& run, double gap_bridge_s);

// The accounts of a run by the online meter with a robot's model.
Result<signals::Accounts> metered(const robot::RobotModel& robot, const DriveRun& run,
                                  const MeterSettings& settings);

}  // namespace joulecast::energy

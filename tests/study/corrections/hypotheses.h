#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "robot/robot_model.h"
#include "telemetry/recording.h"

// Errors of units, signs and channels as hypotheses: reading = factor x truth.
namespace joulecast::gap::corrections {

enum class Quantity : std::uint8_t {
  wheel_velocity,
  motor_voltage,
  motor_current,
  battery_voltage,
  battery_current,
  battery_power,  // voltage and current together
  yaw_rate,
  position,
  heading,
  pitch
};

enum class Kind : std::uint8_t { scale, sign, rectified, delay, offset, supply, swapped };

struct Hypothesis {
  Quantity of{};
  Kind kind{};
  std::array<bool, 2> side{true, true};  // right, left
  double factor = 1;                     // of the reading over the truth; NaN: free
  double delay_s = 0;                    // of the reading behind the wheels
  std::string cause;                     // after "are recorded": "in rpm"; empty for a free factor
  double log_prior = 0;

  // Whether it has a number of its own: the log of the factor, or the offset.
  bool free() const;
  // The factor of which `value` is the logarithm, where it is free.
  double factor_at(double value) const;
  // Whether both cannot be true: they rewrite the same readings.
  bool excludes(const Hypothesis& other) const;
  // The field of robot_telemetry_t: "wheel_velocity.left".
  std::string channel() const;
};

std::string_view name_of(Kind kind);

// What was measured, and differs.
struct Measured {
  bool wheels = false, motor_voltages = false, motor_currents = false;
  bool battery_voltage = false, battery_current = false;
  bool motor_currents_negative = false, battery_current_negative = false;  // anywhere: not rectified
  bool yaw_rate = false, position = false, heading = false, pitch = false;
  double battery_period_s = 0;  // between readings of the battery
};

// Every single error that these channels allow, for a robot of these dimensions.
std::vector<Hypothesis> hypotheses_for(const robot::RobotModel& robot, const Measured& measured);

// Removes an error from a recording. `value`: of a free one. The sign of a rectified battery current is
// that of `returned`, by sample: whether power returns to the battery.
void remove_error(const Hypothesis& error, double value, const robot::RobotModel& robot,
                  std::span<const std::uint8_t> returned, telemetry::Recording& recording);

// Replaces the readings of its channel by NaN.
void leave_out(const Hypothesis& error, telemetry::Recording& recording);

// The sign of a motor current without one: that of the voltage beyond the induced voltage, or of the speed.
double current_sign(double voltage_v, double speed_rad_s, double constant_v_s_rad);

}  // namespace joulecast::gap::corrections

#pragma once

#include <array>
#include <cstddef>
#include <limits>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "dynamics/motion.h"
#include "robot/robot_model.h"
#include "telemetry/recording.h"

namespace joulecast::windows {

inline constexpr double missing = std::numeric_limits<double>::quiet_NaN();

// Time constants on which the copper heat is low-passed [s].
inline constexpr std::array<double, 6> heat_time_constants_s{30, 60, 120, 240, 480, 960};

// Time constants on which the motion is low-passed [s].
inline constexpr std::array<double, 3> motion_time_constants_s{8, 25, 80};

// One smooth window of a recording: averages of every channel, and slopes in weak form, so that linear
// equations between channels are satisfied exactly and no noisy derivative is taken. NaN: not measured, or
// without a new reading in this window. Sides [0] right, [1] left.
struct Window {
  std::size_t mission = 0;
  std::size_t block = 0;      // of assign_blocks()
  bool continues = false;     // begins half a window (or one reading) after the previous one
  bool reading = false;       // placed at readings of a channel, not on the regular grid
  bool motors_apart = false;  // the motors' own equations use other windows
  double t_s = 0;             // since the mission began
  double length_s = 0;
  double payload_kg = 0;
  std::array<double, 2> speed_rad_s{}, acceleration_rad_s2{};
  // Begin, middle and end of the window: their parts of the mean and the mean motion in them; a part without
  // samples has no weight.
  std::array<double, 3> part_weight{0, 1, 0};
  std::array<std::array<double, 2>, 3> part_speed_rad_s{}, part_acceleration_rad_s2{};
  std::array<bool, 2> moving{}, resting{};  // throughout the window; neither: starting or stopping
  // Voltage without the part that the inductance of the robot file takes, L di/dt.
  std::array<double, 2> voltage_v{missing, missing}, current_a{missing, missing};
  std::array<double, 2> voltage_slope_v_s{}, current_slope_a_s{};
  std::array<double, 2> motor_power_w{missing, missing};
  std::array<double, 2> motor_power_abs_w{}, braking_w{};  // mean |V i| and mean of -V i while negative
  std::array<double, 2> current_sign{};  // mean sign of the current, soft below a tenth of the friction's
  std::array<std::array<double, 2>, heat_time_constants_s.size()> copper_heat_w{};
  std::array<double, motion_time_constants_s.size()> recent_rad_s{};  // mean |wheel speed|, low-passed
  double battery_voltage_v = missing, battery_current_a = missing, battery_power_w = missing;
  double mission_voltage_v = missing;  // mean battery voltage of the whole mission
  double battery_power_slope_w_s = 0;
  double electrical_shift_s = 0;  // by which electrical readings were moved back before windowing
  double charge_as = 0;           // drawn since the mission began
  double yaw_rate_rad_s = missing;
  double x_m = missing, y_m = missing, heading_rad = missing;
  double climb_rad = missing;      // of the floor along the heading (dynamics/climb.h)
  std::vector<double> covariates;  // in the order of covariate_names()
  // Progress by the map over a span that starts here; NaN except once a span.
  double forward_m = missing, turn_rad = missing;
  double chord = 1;                        // straight distance over path length in that span
  std::array<double, 2> span_angle_rad{};  // turned by each wheel in that span
};

// Whether each wheel turns or stands throughout: then the sign of its friction is sure.
bool steady(const Window& w);

// The mean motion of a window, at its place and under its load.
dynamics::Instant instant_of(const Window& w);

// Baseline regression features: 1, |v|, |v_right - v_left|, v a and v sin(climb), in m and s; the last is 0
// where the climb is unknown.
std::array<double, 5> plain_terms(const Window& w, double wheel_radius_m);

struct WindowSettings {
  double length_s = 0.4;
  std::size_t fewest_samples = 8;        // in a window; slow recordings get longer windows
  double longest_gap_s = 0.25;           // between samples inside a window
  double span_s = 1.0;                   // over which progress by the map is compared
  double electrical_delay_s = 0;         // by which electrical channels lag; taken out before windowing
  std::size_t most_windows = 8000;       // beyond it, segments of windows are left out evenly
  std::optional<std::size_t> half = {};  // the motion by the wheel speeds of half_of() alone
};

// How the electrical channels were read.
struct Readings {
  double row_s = 0;             // median time between rows
  bool battery_held = false;    // rows repeat the battery's readings,
  bool motors_held = false;     // or the motors'
  double period_s = 0;          // between readings of a held channel
  bool motor_currents = false;  // read in more than a fifth of the rows
  bool motor_voltages = false;
  bool battery_power = false;  // read anywhere
  bool held() const { return battery_held || motors_held; }
};

// How these recordings were read; a repetition that a window averages out is none.
Readings find_readings(std::span<const telemetry::Recording> missions);

// Names of the covariates of these missions that differ anywhere, in order, without the climb's height.
std::vector<std::string> covariate_names(std::span<const telemetry::Recording> missions);

// Windows of all missions, half overlapping. Channels with held readings have windows of their own, one per
// reading, after the others of their mission.
std::vector<Window> make_windows(std::span<const telemetry::Recording> missions,
                                 const robot::RobotModel& robot, const Readings& readings,
                                 const WindowSettings& settings = {});

// Blocks of the recordings for cross-validation, ascending with time: whole missions if there are enough,
// several each if there are many, segments of a mission if there are few. Sets Window::block and returns the
// number of blocks.
std::size_t assign_blocks(std::span<Window> windows, std::span<const double> mission_length_s);

}  // namespace joulecast::windows

#pragma once

#include <array>
#include <cstddef>
#include <limits>
#include <span>
#include <vector>

#include "dynamics/catalogue.h"
#include "gap/recordings.h"
#include "robot/robot_model.h"

namespace joulecast::gap {

inline constexpr double missing = std::numeric_limits<double>::quiet_NaN();

// Time constants on which the copper heat is low-passed [s].
inline constexpr std::array<double, 6> heat_time_constants_s{30, 60, 120, 240, 480, 960};

// Time constants on which the motion is low-passed [s].
inline constexpr std::array<double, 3> motion_time_constants_s{8, 25, 80};

// What one smooth window (a raised cosine) of a recording says: the averages of every channel under the
// window, and slopes in weak form, so that linear equations between channels hold exactly and no noisy
// derivative is taken. NaN: not measured. Sides [0] right, [1] left.
struct Window {
  std::size_t mission = 0;
  bool continues = false;  // begins half a window after the previous one
  double t_s = 0;          // since the mission began
  double payload_kg = 0;
  std::array<double, 2> speed_rad_s{}, acceleration_rad_s2{};
  // Begin, middle and end of the window: their parts of the mean and the mean speeds in them; a part
  // without samples has no weight.
  std::array<double, 3> part_weight{0, 1, 0};
  std::array<std::array<double, 2>, 3> part_speed_rad_s{};
  std::array<bool, 2> moving{}, resting{};  // throughout the window; neither: starting or stopping
  std::array<double, 2> voltage_v{missing, missing}, current_a{missing, missing};
  std::array<double, 2> voltage_slope_v_s{}, current_slope_a_s{};
  std::array<double, 2> motor_power_w{missing, missing};
  std::array<double, 2> motor_power_abs_w{}, braking_w{};  // mean |V i| and mean of -V i while negative
  std::array<double, 2> current_sign{};  // mean sign of the current, soft below a tenth of the friction's
  std::array<std::array<double, 2>, heat_time_constants_s.size()> copper_heat_w{};
  std::array<double, motion_time_constants_s.size()> recent_rad_s{};  // mean |wheel speed|, low-passed
  bool power_turns = false;  // the motors may brake in one part of it and drive in another
  double battery_voltage_v = missing, battery_current_a = missing, battery_power_w = missing;
  double battery_voltage_step_v = 0;  // between readings that differ, of the whole mission
  double battery_power_slope_w_s = 0, battery_current_slope_a_s = 0;
  double electrical_shift_s = 0;  // by which electrical readings were moved back before windowing
  double charge_as = 0;           // drawn since the mission began
  double yaw_rate_rad_s = missing;
  double x_m = missing, y_m = missing, heading_rad = missing;
  // Progress by the map over a span that starts here; NaN except once a span.
  double forward_m = missing, turn_rad = missing;
  double chord = 1;                        // straight distance over path length in that span
  std::array<double, 2> span_angle_rad{};  // turned by each wheel in that span
};

struct WindowSettings {
  double length_s = 0.4;
  std::size_t fewest_samples = 8;   // in a window; slow recordings get longer windows
  double longest_gap_s = 0.25;      // between samples inside a window
  double span_s = 1.0;              // over which progress by the map is compared
  double electrical_delay_s = 0;    // by which electrical channels lag; taken out before windowing
  double motor_current_bias_a = 0;  // of the reading, when the sign of a current is asked for
  std::size_t most_windows = 8000;  // beyond it, blocks of windows are left out evenly
};

// Puts what a sensor effect does to a motor's readings into the settings that take it out of windows; other
// effects change nothing.
void take_out(const dynamics::ActiveEffect& effect, WindowSettings& settings);

// A single mission is judged as this many, so that a part can be held out.
inline constexpr double single_mission_parts = 4;

// Windows of all missions, half overlapping.
std::vector<Window> make_windows(const RecordingSet& set, const robot::RobotModel& robot,
                                 const WindowSettings& settings = {});

}  // namespace joulecast::gap

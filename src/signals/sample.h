#pragma once

#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <string>
#include <string_view>

namespace joulecast::signals {

inline constexpr double unmeasured = std::numeric_limits<double>::quiet_NaN();

// Whether two readings are equal, or both unmeasured.
inline bool same(double a, double b) {
  return a == b || (std::isnan(a) && std::isnan(b));
}

// One sample of robot_telemetry_t, free of LCM. Units and signs as in lcmtypes/robot_telemetry_t.lcm;
// sides: [0] right, [1] left; NaN = not measured.
struct Sample {
  std::int64_t utime_us = 0;
  std::int64_t sequence = 0;
  std::array<double, 2> wheel_velocity_rad_s{};
  std::array<double, 2> motor_voltage_v{unmeasured, unmeasured};
  std::array<double, 2> motor_current_a{unmeasured, unmeasured};
  double battery_voltage_v = unmeasured;
  double battery_current_a = unmeasured;
  std::array<double, 2> velocity_command{unmeasured, unmeasured};  // m/s, rad/s
  double yaw_rate_rad_s = unmeasured;
  double pitch_rad = unmeasured;
  std::array<double, 3> pose{unmeasured, unmeasured, unmeasured};  // x m, y m, heading rad
  std::array<double, 2> motor_temperature_c{unmeasured, unmeasured};
  double payload_kg = unmeasured;
};

// The name of one number of a sample.
struct SampleField {
  std::string_view name;  // its field in robot_telemetry_t
  std::string_view part;  // of a field of several: side, component or axis
  std::string_view key;   // with its unit; both sides share it
};

// visit(SampleField, number) for each number of a sample, which may be const, as in robot_telemetry_t.
template <class S, class Visit>
constexpr void visit_fields(S& s, Visit&& visit) {
  const auto sides = [&](std::string_view name, std::string_view key, auto& value) {
    visit(SampleField{name, "right", key}, value[0]);
    visit(SampleField{name, "left", key}, value[1]);
  };
  sides("wheel_velocity", "wheel_velocity_rad_s", s.wheel_velocity_rad_s);
  sides("motor_voltage", "motor_voltage_v", s.motor_voltage_v);
  sides("motor_current", "motor_current_a", s.motor_current_a);
  visit(SampleField{"battery_voltage", "", "battery_voltage_v"}, s.battery_voltage_v);
  visit(SampleField{"battery_current", "", "battery_current_a"}, s.battery_current_a);
  visit(SampleField{"velocity_command", "speed", "command_speed_m_s"}, s.velocity_command[0]);
  visit(SampleField{"velocity_command", "turn", "command_yaw_rate_rad_s"}, s.velocity_command[1]);
  visit(SampleField{"yaw_rate", "", "yaw_rate_rad_s"}, s.yaw_rate_rad_s);
  visit(SampleField{"pitch", "", "pitch_rad"}, s.pitch_rad);
  visit(SampleField{"pose", "x", "x_m"}, s.pose[0]);
  visit(SampleField{"pose", "y", "y_m"}, s.pose[1]);
  visit(SampleField{"pose", "heading", "heading_rad"}, s.pose[2]);
  sides("motor_temperature", "motor_temperature_c", s.motor_temperature_c);
  visit(SampleField{"payload_mass", "", "payload_kg"}, s.payload_kg);
}

inline constexpr std::size_t sample_numbers = 18;

inline constexpr std::array<SampleField, sample_numbers> sample_fields = [] {
  std::array<SampleField, sample_numbers> fields{};
  std::size_t k = 0;
  const Sample sample;
  visit_fields(sample, [&](const SampleField& field, double) { fields[k++] = field; });
  return fields;
}();
static_assert(sample_fields.back().name == "payload_mass");

// Pointers to the numbers of a sample (const or not), in the order of `sample_fields`.
template <class S>
constexpr auto numbers_of(S& sample) {
  std::array<decltype(&sample.pitch_rad), sample_numbers> numbers{};
  std::size_t k = 0;
  visit_fields(sample, [&](const SampleField&, auto& number) { numbers[k++] = &number; });
  return numbers;
}

enum class MissionPhase : std::int8_t { started = 1, finished = 2, aborted = 3 };

// mission_event_t, free of LCM.
struct MissionEvent {
  std::int64_t utime_us = 0;
  std::string mission_id;
  MissionPhase phase = MissionPhase::started;
  double payload_kg = unmeasured;
  std::string note;
};

// energy_state_t, free of LCM: the energy state that is sent to a robot. Energies in J since the mission
// began, leaving the battery positive; NaN: unknown.
struct EnergyState {
  std::int64_t utime_us = 0;
  std::string robot_id;
  std::string mission_id;  // empty: no mission open
  std::int64_t model_version = 0;
  double measured_power_w = unmeasured;
  double modelled_power_w = unmeasured;
  double measured_energy_j = unmeasured;
  double modelled_energy_j = unmeasured;
  double unexplained_energy_j = unmeasured;
  double recovered_energy_j = unmeasured;
  double state_of_charge = unmeasured;  // 0 to 1
  double state_of_charge_sd = unmeasured;
  double range_m = unmeasured;  // median
  std::array<double, 2> range_band_m{unmeasured, unmeasured};
  double run_time_s = unmeasured;  // median
  std::array<double, 2> run_time_band_s{unmeasured, unmeasured};
  std::array<double, 2> winding_temperature_c{unmeasured, unmeasured};
};

}  // namespace joulecast::signals

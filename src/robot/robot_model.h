#pragma once

#include <array>
#include <cstddef>
#include <optional>
#include <string>
#include <utility>
#include <vector>

namespace joulecast::robot {

// Sides are indexed everywhere: [0] right, [1] left. Inertia and friction values are at the wheel.
inline constexpr std::size_t right = 0;
inline constexpr std::size_t left = 1;

inline constexpr double standard_gravity_m_s2 = 9.80665;

// Yaw inertia that each kilogram of payload adds, unless the file states it; the payload sits over the axle
// [m^2].
inline constexpr double payload_yaw_inertia_m2 = 0.02;

struct Kinematics {
  double wheel_radius_m = 0;
  double half_track_m = 0;  // half the distance between the wheels, the thesis's l
  double com_offset_m = 0;  // centre of mass ahead of the axle, the thesis's d

  friend bool operator==(const Kinematics&, const Kinematics&) = default;
};

struct Mass {
  double chassis_kg = 0;         // without wheels, rotors and payload
  double wheel_kg = 0;           // one wheel with its rotor
  double yaw_inertia_kg_m2 = 0;  // whole robot without payload, about the vertical through the axle's middle
  double wheel_inertia_kg_m2 = 0;  // one wheel about its axle
  std::optional<double> payload_yaw_inertia_m2 = std::nullopt;

  friend bool operator==(const Mass&, const Mass&) = default;
};

struct Motor {
  double resistance_ohm = 0;
  double inductance_h = 0;
  double torque_constant_nm_a = 0;      // at the motor shaft
  double voltage_constant_v_s_rad = 0;  // at the motor shaft
  double gear_ratio = 1;
  double rotor_inertia_kg_m2 = 0;              // seen at the wheel, the thesis's I_s
  double viscous_friction_nm_s_rad = 0;        // at the wheel
  std::array<double, 2> friction_torque_nm{};  // at the wheel, opposing motion

  friend bool operator==(const Motor&, const Motor&) = default;
};

// One resistor-capacitor branch of the battery's equivalent circuit.
struct BatteryBranch {
  double resistance_ohm = 0;
  double time_constant_s = 0;

  friend bool operator==(const BatteryBranch&, const BatteryBranch&) = default;
};

// The charge at the electrodes' surface runs ahead of the mean while current flows, as diffusion lets it: at
// a steady current by as much as that current draws in lag_s.
struct ChargeLag {
  double lag_s = 0;
  double time_constant_s = 0;

  friend bool operator==(const ChargeLag&, const ChargeLag&) = default;
};

struct Battery {
  double nominal_voltage_v = 0;
  double capacity_ah = 0;
  double internal_resistance_ohm = 0;
  double reserve_fraction = 0;  // charge that planning leaves untouched, 0 to 1
  // Optional refinements; absent ones are derived from the four numbers above (src/battery).
  std::vector<std::pair<double, double>> open_circuit_voltage;  // (state of charge 0..1, V), charge ascending
  std::vector<std::pair<double, double>> resistance_curve;  // (state of charge 0..1, ohm), charge ascending
  std::vector<BatteryBranch> branches;                      // at most 2
  std::vector<ChargeLag> charge_lags;                       // at most 2
  std::optional<double> cutoff_voltage_v;
  std::optional<double> coulombic_efficiency;  // charge returned over charge put in, (0, 1]
  std::optional<double> ageing_factor;         // present over rated capacity, (0, 1.2]
  // Temperature: resistances and lags follow exp(activation_k (1/T - 1/298.15 K)); losses heat one mass.
  std::optional<double> activation_k;
  std::optional<double> thermal_resistance_k_w;  // battery to surroundings
  std::optional<double> thermal_time_constant_s;

  friend bool operator==(const Battery&, const Battery&) = default;
};

struct Limits {
  double speed_m_s = 0;
  double acceleration_m_s2 = 0;
  double yaw_rate_rad_s = 0;
  double current_a = 0;  // armature, each motor
  double payload_kg = 0;

  friend bool operator==(const Limits&, const Limits&) = default;
};

// An effect adopted from a diagnosis: its catalogue id and named parameters (src/dynamics/effects.cc).
struct AdoptedEffect {
  std::string id;
  std::vector<std::pair<std::string, double>> parameters;

  friend bool operator==(const AdoptedEffect&, const AdoptedEffect&) = default;
};

// The model of one robot. Immutable once stored: a change is a new version.
struct RobotModel {
  std::string robot_id;
  Kinematics kinematics;
  Mass mass;
  Motor motor;
  Battery battery;
  double idle_power_w = 0;
  Limits limits;
  std::vector<AdoptedEffect> effects;

  // m = m_c + 2 m_w + m_p (thesis, notation) [kg].
  double total_mass_kg(double payload_kg) const { return mass.chassis_kg + 2 * mass.wheel_kg + payload_kg; }

  friend bool operator==(const RobotModel&, const RobotModel&) = default;
};

}  // namespace joulecast::robot

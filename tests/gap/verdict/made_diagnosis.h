#pragma once

#include <limits>

#include "gap/verdict/diagnosis.h"

namespace joulecast::gap::testing {

inline constexpr double unknown = std::numeric_limits<double>::quiet_NaN();

// A diagnosis with every field set and with distinct numbers.
inline Diagnosis made_diagnosis() {
  Diagnosis d;
  d.robot_id = "amr-07";
  d.missions = 12;
  d.samples = 34'000;
  d.notes = {"1 message could not be read"};
  d.motor_channels = true;
  d.power = PowerSource::motors;
  d.energy_relative = 0.101;
  d.power_absolute_relative = 0.202;
  d.noise_floor = 0.033;
  d.detectable_share = 0.014;
  d.channels = {{"battery_power", 0.21, 0.031}, {"yaw_rate", 0.052, unknown}};
  d.checks = {
      {"battery_current_reversed", "battery_current", -1.02, {-1.05, -0.99}, "It is reversed.", true, {}},
      {"step_between_missions", "", 1.3, {unknown, unknown}, "It changes.", false, 4}};
  d.baseline = Baseline{{{"turning", "W/(m/s)", 1150, 12, 90, 1140}, {"constant", "W", 80, unknown}},
                        0.115,
                        0.205,
                        0.064,
                        0.004,
                        {"Turning costs 1150 W per m/s; the model has 90."}};
  d.sums = {
      {"constant + |v|", 12.5, 0.4, {"accessory_load", "coulomb_friction"}, "idle_power_w", "W", 20.5, 0.4}};
  d.where = {{"battery_power", "phase", "turning", 0, 0, 0.61, 0.17, {0.51, 0.71}},
             {"wheel_torque", "speed_m_s", "", 0.2, 0.4, -0.12, 0.09, {-0.19, -0.05}}};
  d.verdict = Verdict::effects;
  d.verdict_probability = 0.93;
  d.reasons = {"These data do not distinguish slope from grade."};
  DiagnosedEffect friction;
  friction.id = "coulomb_friction";
  friction.probability = 0.96;
  friction.group = 0.99;
  friction.parameters = {{"ratio", "1", 0.41, 0.02}, {"place", "m", 3.5, unknown}};
  friction.share = 0.72;
  friction.power_w = 19.5;
  friction.varies = 0.11;
  friction.calibrates = "/motor/friction_torque_nm";
  DiagnosedEffect load;
  load.id = "covariate:cpu_load";
  load.probability = 0.81;
  load.parameters = {{"coefficient", "W/1", 33, 3}};
  load.group = 0.82;
  load.share = 0.13;
  d.effects = {friction, load};
  d.outside = {0.22, "wheel_torque", "time", "accessory_load", {4000, 1000}};
  d.shrinkage = Shrinkage{0.203, 0.065, 0.68, {0.61, 0.74}, 1.97, 5};
  d.corrections = {{"motor.friction_torque_nm", 1.2, 1.69, 0.03}};
  d.next_drive = {{"drive fast", "a from b", 7.5}, {"drive slowly", "c from d", unknown}};
  d.adoptable = {{"coulomb_friction", {{"ratio", 0.41}}}};
  return d;
}

}  // namespace joulecast::gap::testing

#include "tests/study/trial/plant_variants.h"

#include <algorithm>
#include <array>
#include <string_view>

namespace joulecast::trial {
namespace {

using virtual_robot::Rng;
using virtual_robot::SimulationSpec;

constexpr double variant_share = 0.12;

struct Variant {
  std::string_view name;
  void (*apply)(Rng&, SimulationSpec&);
};

constexpr auto variants = std::to_array<Variant>({
    {"slow rate", [](Rng& rng, SimulationSpec& s) { s.rate_hz = rng.chance(0.5) ? 10 : 20; }},
    {"fast rate", [](Rng& rng, SimulationSpec& s) { s.rate_hz = rng.chance(0.5) ? 100 : 200; }},
    {"no gyro", [](Rng&, SimulationSpec& s) { s.sensors.gyro = false; }},
    {"no pose", [](Rng&, SimulationSpec& s) { s.sensors.pose = false; }},
    {"temperature", [](Rng&, SimulationSpec& s) { s.sensors.temperature = true; }},
    {"noise",
     [](Rng& rng, SimulationSpec& s) {
       const double by = rng.uniform(1.5, 3);
       s.sensors.encoder_noise_rad_s *= by;
       s.sensors.motor_voltage_noise *= by;
       s.sensors.motor_current_noise_a *= by;
       s.sensors.motor_current_noise *= by;
       s.sensors.battery_voltage_noise_v *= by;
       s.sensors.battery_current_noise_a *= by;
       s.sensors.gyro_noise_rad_s *= by;
       s.sensors.pose_noise_m *= by;
       s.sensors.heading_noise_rad *= by;
     }},
    {"lossy network",
     [](Rng& rng, SimulationSpec& s) {
       s.sensors.sampling_jitter = rng.uniform(0.05, 0.3);
       s.sensors.loss_probability = rng.uniform(0.002, 0.03);
     }},
    {"scatter", [](Rng& rng, SimulationSpec& s) { s.scatter = rng.uniform(1.3, 1.8); }},
    {"quick controller",
     [](Rng& rng, SimulationSpec& s) { s.controller.natural_rad_s = rng.uniform(10, 16); }},
    {"slow controller",
     [](Rng& rng, SimulationSpec& s) {
       s.controller.natural_rad_s = rng.uniform(3, 5);
       s.controller.feed_forward = rng.chance(0.5) ? 0.0 : 0.8;
     }},
    {"soft friction", [](Rng& rng, SimulationSpec& s) { s.world.bristle_rad = rng.uniform(0.015, 0.05); }},
    {"hard brushes", [](Rng&, SimulationSpec& s) { s.world.brush_softness = 0.2; }},
    {"Gaussian Stribeck", [](Rng&, SimulationSpec& s) { s.world.stribeck_power = 2; }},
    {"coarse converters",
     [](Rng& rng, SimulationSpec& s) {
       s.sensors.motor_current_step_a = 0.002 * s.robot.current_limit_a * rng.uniform(0.5, 2);
       s.sensors.battery_current_step_a = 0.1 * rng.uniform(0.5, 2);
       s.sensors.voltage_step_v = 0.002 * s.robot.nominal_voltage_v * rng.uniform(0.5, 2);
     }},
    {"drifting currents",
     [](Rng& rng, SimulationSpec& s) {
       s.sensors.current_drift_a = 0.0004 * s.robot.current_limit_a * rng.uniform(0.5, 1.5);
     }},
    {"latency", [](Rng& rng, SimulationSpec& s) { s.latency_s = rng.uniform(0.001, 0.004); }},
    {"battery sensor alone", [](Rng&, SimulationSpec& s) { s.world.motor_sensor_share = 0; }},
    {"smooth ramps", [](Rng&, SimulationSpec& s) { s.smooth_ramps = true; }},
    {"loads change", [](Rng&, SimulationSpec& s) { s.script.pickup_share = 0.5; }},
    {"short missions", [](Rng& rng, SimulationSpec& s) { s.script.duration_s = rng.uniform(45, 70); }},
    {"no arcs", [](Rng&, SimulationSpec& s) { s.script.arc_share = 0; }},
});

// Two of a kind.
bool excluded(std::string_view name, const std::vector<std::string>& names) {
  const auto has = [&](std::string_view other) { return std::ranges::find(names, other) != names.end(); };
  return (name == "fast rate" && has("slow rate")) || (name == "slow controller" && has("quick controller"));
}

}  // namespace

std::vector<std::string> vary_plant(Rng& rng, SimulationSpec& spec) {
  std::vector<std::string> names;
  while (names.empty()) {
    for (const Variant& v : variants) {
      if (!rng.chance(variant_share)) continue;
      if (excluded(v.name, names)) continue;
      v.apply(rng, spec);
      names.emplace_back(v.name);
    }
  }
  return names;
}

}  // namespace joulecast::trial

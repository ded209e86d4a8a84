#include "virtual_missions.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <string>

#include "client/virtual_robot/fleet.h"
#include "robot/robot_file.h"
#include "signals/sample.h"

namespace joulecast::forecast {
namespace {

namespace vr = virtual_robot;

// Effects that robots of the real world have, each as strong as a tenth or so of the energy. Accessory loads
// are in shares of the idle power.
struct Candidate {
  const char* id;
  double from, to;
};
constexpr Candidate candidates[] = {{"coulomb_friction", 0.15, 0.6},
                                    {"viscous_friction", 0.3, 2},
                                    {"load_rolling_resistance", 0.004, 0.02},
                                    {"turning_scrub", 0.03, 0.12},
                                    {"accessory_load", 0.05, 0.4},
                                    {"driver_loss", 0.03, 0.12},
                                    {"no_regeneration", 0.3, 1},
                                    {"gear_efficiency", 0.05, 0.2},
                                    {"payload_mass_error", -0.25, 0.35},
                                    {"floor_resistance_zone", 0.01, 0.03},
                                    {"torque_constant_loss", 0.03, 0.1},
                                    {"winding_temperature", 1, 5},
                                    {"x_cold_bearing", 0.2, 0.8},
                                    {"x_periodic_load", 0.1, 0.5},
                                    {"x_speed_cubed", 0.2, 0.8}};

std::vector<vr::EffectStrength> draw_effects(vr::Rng& rng, double idle_power_w) {
  std::vector<vr::EffectStrength> effects;
  const std::size_t wanted = 2 + rng.index(3);
  while (effects.size() < wanted) {
    const Candidate& c = candidates[rng.index(std::size(candidates))];
    if (std::ranges::find(effects, c.id, &vr::EffectStrength::first) != effects.end()) continue;
    const std::string id = c.id;
    const double unit = id == "accessory_load" || id == "x_periodic_load" ? idle_power_w : 1;
    effects.emplace_back(id, unit * rng.uniform(c.from, c.to));
  }
  return effects;
}

std::vector<StatedLeg> plan_of(const vr::MissionTruth& truth, double settle_s) {
  std::vector<StatedLeg> plan;
  vr::ScriptPose at = truth.start;
  double payload_kg = truth.script.payload_kg;
  for (const vr::Leg& leg : truth.script.legs) {
    StatedLeg s;
    s.leg.payload_kg = payload_kg;
    if (const auto* go = std::get_if<vr::GoTo>(&leg)) {
      s.leg.motion = Motion::drive;
      s.leg.way = std::hypot(go->x_m - at.x_m, go->y_m - at.y_m);
      s.speed = go->speed_m_s;
      s.acceleration = go->acceleration_m_s2;
      at.x_m = go->x_m;
      at.y_m = go->y_m;
    } else if (const auto* turn = std::get_if<vr::TurnTo>(&leg)) {
      const double heading = std::atan2(turn->y_m - at.y_m, turn->x_m - at.x_m);
      s.leg.motion = Motion::turn;
      s.leg.way = std::fabs(std::remainder(heading - at.heading_rad, 2 * std::numbers::pi));
      s.speed = turn->rate_rad_s;
      s.acceleration = turn->acceleration_rad_s2;
      at.heading_rad = heading;
    } else if (const auto* arc = std::get_if<vr::Arc>(&leg)) {
      s.leg.motion = Motion::drive;
      s.leg.way = arc->radius_m * std::fabs(arc->angle_rad);
      s.leg.curvature_1_m = 1 / arc->radius_m;
      s.speed = arc->speed_m_s;
      s.acceleration = arc->acceleration_m_s2;
      const double side = arc->angle_rad > 0 ? 1 : -1, after = at.heading_rad + arc->angle_rad;
      at.x_m += side * arc->radius_m * (std::sin(after) - std::sin(at.heading_rad));
      at.y_m -= side * arc->radius_m * (std::cos(after) - std::cos(at.heading_rad));
      at.heading_rad = after;
    } else if (const auto* dwell = std::get_if<vr::Dwell>(&leg)) {
      s.leg.duration_s = dwell->duration_s;
    } else {
      payload_kg = std::get<vr::Load>(leg).payload_kg;
      continue;
    }
    if (s.leg.motion == Motion::stand || s.leg.way > 1e-6) plan.push_back(s);
    if (s.leg.motion != Motion::stand && settle_s > 0) {
      StatedLeg settle;
      settle.leg.payload_kg = payload_kg;
      settle.leg.duration_s = settle_s;
      plan.push_back(settle);
    }
  }
  return plan;
}

RobotRun run(std::string_view kind, int missions, std::uint64_t seed,
             const std::vector<vr::EffectStrength>* given, const VirtualHabit& habit) {
  const auto shipped = std::ranges::find(vr::shipped_robots(), kind, &vr::ShippedRobot::kind);
  const std::string text(shipped->json_text);
  vr::SimulationSpec spec;
  spec.robot = *vr::parse_robot(text);
  spec.script = habit.script;
  spec.settle_s = habit.settle_s;
  vr::Rng rng = vr::Rng::stream(seed, 77);
  spec.world = vr::draw_world(rng, spec.script.map_half_width_m);
  spec.imperfections =
      *vr::make_imperfections(given != nullptr ? *given : draw_effects(rng, spec.robot.idle_power_w));
  spec.missions = missions;
  const vr::Simulation done = vr::simulate_missions(spec, seed);

  std::vector<telemetry::Recording> recordings;
  std::size_t next = 0;
  for (const signals::MissionEvent& event : done.events) {
    if (event.phase == signals::MissionPhase::started) continue;
    telemetry::Recording& mission = recordings.emplace_back();
    while (next < done.samples.size() && done.samples[next].utime_us < event.utime_us)
      mission.samples.push_back(done.samples[next++]);
  }
  robot::RobotModel robot = *robot::parse_robot(text);
  dynamics::DriveModel drive = *dynamics::drive_model(robot);
  RobotRun out{std::string(kind), robot, drive, driven(robot, drive, recordings)};
  for (std::size_t k = 0; k < out.missions.size(); ++k) {
    const vr::MissionTruth& truth = done.truth.missions[k];
    DrivenMission& m = out.missions[k];
    m.plan = plan_of(truth, habit.settle_s);
    m.true_j = truth.battery_energy_j;
    m.duration_s = truth.duration_s;
    m.distance_m = truth.distance_m;
    m.charge_at_start = truth.charge_at_start;
    m.charge_at_end = truth.charge_at_end;
  }
  return out;
}

vr::ScriptOptions script(double halts, double shortest_s, double longest_s, double slowest, double fastest,
                         double gentlest, double hardest, double arcs) {
  vr::ScriptOptions options;
  options.dwell_share = halts;
  options.shortest_halt_s = shortest_s;
  options.longest_halt_s = longest_s;
  options.slowest_fraction = slowest;
  options.fastest_fraction = fastest;
  options.gentlest_fraction = gentlest;
  options.hardest_fraction = hardest;
  options.arc_share = arcs;
  return options;
}

}  // namespace

std::span<const VirtualHabit> virtual_habits() {
  static const std::array<VirtualHabit, 6> habits{
      {{"as simulated", {}, 0.4},
       {"seldom and long halts", script(0.04, 15, 40, 0.3, 0.9, 0.35, 0.95, 0.2), 0},
       {"often and short halts", script(0.7, 0.3, 1.5, 0.3, 0.9, 0.35, 0.95, 0.2), 0},
       {"no halts, gentle", script(0, 1, 2, 0.25, 0.45, 0.2, 0.4, 0.2), 0},
       {"no halts, hard", script(0, 1, 2, 0.7, 0.95, 0.8, 0.98, 0.2), 0},
       {"arcs instead of turns", script(0.15, 1, 4, 0.3, 0.9, 0.35, 0.95, 0.9), 0}}};
  return habits;
}

RobotRun run_virtual_robot(std::string_view kind, int missions, std::uint64_t seed, bool departing,
                           const VirtualHabit& habit) {
  const std::vector<vr::EffectStrength> none;
  return run(kind, missions, seed, departing ? nullptr : &none, habit);
}

RobotRun run_virtual_robot(std::string_view kind, int missions, std::uint64_t seed,
                           const std::vector<virtual_robot::EffectStrength>& effects,
                           const VirtualHabit& habit) {
  return run(kind, missions, seed, &effects, habit);
}

}  // namespace joulecast::forecast

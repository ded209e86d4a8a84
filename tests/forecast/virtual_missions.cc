#include "virtual_missions.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <string>

#include "client/virtual_robot/fleet.h"
#include "energy/meter.h"
#include "robot/robot_file.h"
#include "signals/mission_event.h"

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

std::vector<StatedLeg> plan_of(const vr::MissionTruth& truth) {
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
  }
  return plan;
}

VirtualRobotRun run(std::string_view kind, int missions, std::uint64_t seed,
                    const std::vector<vr::EffectStrength>* given) {
  const auto shipped = std::ranges::find(vr::shipped_robots(), kind, &vr::ShippedRobot::kind);
  const std::string text(shipped->json_text);
  vr::SimulationSpec spec;
  spec.robot = *vr::parse_robot(text);
  vr::Rng rng = vr::Rng::stream(seed, 77);
  spec.world = vr::draw_world(rng, spec.script.map_half_width_m);
  const std::vector<vr::EffectStrength> effects =
      given != nullptr ? *given : draw_effects(rng, spec.robot.idle_power_w);
  spec.imperfections = *vr::make_imperfections(effects);
  spec.missions = missions;
  const vr::Simulation done = vr::simulate_missions(spec, seed);

  robot::RobotModel robot = *robot::parse_robot(text);
  dynamics::DriveModel drive = *dynamics::drive_model(robot);
  VirtualRobotRun out{robot, drive, effects, {}};
  LegTracker tracker(robot);
  energy::Meter meter(drive, {}, [&](const energy::MeterPoint& p) {
    tracker.add({p.bridged ? p.interval_s : 0, p.speed_m_s, p.yaw_rate_rad_s, p.measured_power_w,
                 p.sample.payload_kg});
  });
  std::size_t next = 0, index = 0;
  for (const signals::MissionEvent& event : done.events) {
    if (event.phase == signals::MissionPhase::started) {
      meter.begin();
      tracker.begin();
      continue;
    }
    while (next < done.samples.size() && done.samples[next].utime_us < event.utime_us)
      (void)meter.add(done.samples[next++]);
    (void)meter.flush();
    const vr::MissionTruth& truth = done.truth.missions[index++];
    VirtualMission m;
    m.plan = plan_of(truth);
    m.past = {event.utime_us, tracker.take()};
    m.metered_j = meter.accounts().measured_j;
    m.true_j = truth.battery_energy_j;
    m.distance_m = truth.distance_m;
    m.charge_at_start = truth.charge_at_start;
    m.charge_at_end = truth.charge_at_end;
    out.missions.push_back(std::move(m));
  }
  return out;
}

}  // namespace

VirtualRobotRun run_virtual_robot(std::string_view kind, int missions, std::uint64_t seed, bool departing) {
  const std::vector<vr::EffectStrength> none;
  return run(kind, missions, seed, departing ? nullptr : &none);
}

VirtualRobotRun run_virtual_robot(std::string_view kind, int missions, std::uint64_t seed,
                                  const std::vector<vr::EffectStrength>& effects) {
  return run(kind, missions, seed, &effects);
}

std::vector<PricedLeg> price_plan(const VirtualRobotRun& run, const VirtualMission& mission,
                                  const Forecaster& forecaster, Driving driving) {
  const LegPricer pricer(run.robot, run.drive);
  std::vector<PricedLeg> priced;
  for (const StatedLeg& stated : mission.plan) {
    Pace pace = forecaster.usual;
    if (driving == Driving::stated && stated.leg.motion == Motion::drive) {
      pace.speed_m_s = stated.speed;
      pace.acceleration_m_s2 = stated.acceleration;
    } else if (driving == Driving::stated) {
      pace.yaw_rate_rad_s = stated.speed;
      pace.yaw_acceleration_rad_s2 = stated.acceleration;
    }
    const std::vector<PricedLeg> one = price(pricer, std::span(&stated.leg, 1), pace);
    priced.insert(priced.end(), one.begin(), one.end());
  }
  return priced;
}

}  // namespace joulecast::forecast

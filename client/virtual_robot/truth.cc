#include "client/virtual_robot/truth.h"

#include <map>
#include <nlohmann/json.hpp>

namespace joulecast::virtual_robot {

NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE(World, slope_direction_rad, weak_side, stribeck_speed_m_s, stribeck_power,
                                   bristle_rad, brush_softness, motor_sensor_share, battery_sensor_share,
                                   emf_loss_share, thermal_time_constant_s, period_s, burst_time_s, patch_m)
NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE(MissionTruth, mission_id, payload_kg, undeclared_kg, duration_s,
                                   distance_m, battery_energy_j)

std::string truth_json(const std::vector<Truth>& truths) {
  using Json = nlohmann::json;
  Json robots = Json::array();
  for (const Truth& truth : truths) {
    Json missions = Json::array();
    for (const MissionTruth& m : truth.missions) {
      const PlantAccounts& a = m.accounts;
      missions.push_back(m);
      missions.back().update({{"motor_energy_j", a.motor},
                              {"driver_energy_j", a.bus},
                              {"copper_j", a.copper},
                              {"brush_j", a.brush},
                              {"internal_friction_j", a.internal},
                              {"floor_friction_j", a.floor},
                              {"gear_j", a.gear},
                              {"drag_j", a.drag},
                              {"scrub_j", a.scrub},
                              {"slip_j", a.slip},
                              {"potential_j", a.potential}});
    }
    Json world = truth.world;
    world["zone"] = {truth.world.zone_x_m, truth.world.zone_y_m, truth.world.zone_radius_m};
    robots.push_back({{"robot_id", truth.robot_id},
                      {"seed", truth.seed},
                      {"effects", std::map(truth.effects.begin(), truth.effects.end())},
                      {"world", world},
                      {"missions", missions}});
  }
  return Json{{"robots", robots}}.dump(2) + "\n";
}

}  // namespace joulecast::virtual_robot

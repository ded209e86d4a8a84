#include "client/virtual_robot/truth.h"

#include <nlohmann/json.hpp>

namespace joulecast::virtual_robot {

std::string truth_json(const std::vector<Truth>& truths) {
  using Json = nlohmann::json;
  Json robots = Json::array();
  for (const Truth& truth : truths) {
    Json effects = Json::object();
    for (const auto& [id, strength] : truth.effects) effects[id] = strength;
    Json missions = Json::array();
    for (const MissionTruth& m : truth.missions) {
      const PlantAccounts& a = m.accounts;
      missions.push_back({{"mission_id", m.mission_id},
                          {"payload_kg", m.payload_kg},
                          {"undeclared_kg", m.undeclared_kg},
                          {"duration_s", m.duration_s},
                          {"distance_m", m.distance_m},
                          {"battery_energy_j", m.battery_energy_j},
                          {"motor_energy_j", a.motor},
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
    const World& w = truth.world;
    robots.push_back({{"robot_id", truth.robot_id},
                      {"seed", truth.seed},
                      {"effects", effects},
                      {"world",
                       {{"zone", {w.zone_x_m, w.zone_y_m, w.zone_radius_m}},
                        {"slope_direction_rad", w.slope_direction_rad},
                        {"weak_side", w.weak_side},
                        {"stribeck_speed_m_s", w.stribeck_speed_m_s},
                        {"stribeck_power", w.stribeck_power},
                        {"bristle_rad", w.bristle_rad},
                        {"brush_softness", w.brush_softness},
                        {"motor_sensor_share", w.motor_sensor_share},
                        {"battery_sensor_share", w.battery_sensor_share},
                        {"emf_loss_share", w.emf_loss_share},
                        {"thermal_time_constant_s", w.thermal_time_constant_s},
                        {"period_s", w.period_s},
                        {"burst_time_s", w.burst_time_s},
                        {"patch_m", w.patch_m}}},
                      {"missions", missions}});
  }
  return Json{{"robots", robots}}.dump(2) + "\n";
}

}  // namespace joulecast::virtual_robot

#include "client/virtual_robot/robot_parameters.h"

#include <cmath>
#include <nlohmann/json.hpp>
#include <optional>

namespace joulecast::virtual_robot {
namespace {

using Json = nlohmann::json;

enum class Sign { positive, not_negative, any };

// Reads numbers by JSON pointer and keeps the first fault, so that the caller reads straight through.
class Reader {
 public:
  explicit Reader(const Json& document) : document_(document) {}

  double number(const std::string& pointer, Sign sign, std::optional<double> fallback = std::nullopt) {
    const Json* value = find(pointer);
    if (value != nullptr) return check(pointer, *value, sign);
    if (!fallback) report(pointer, "is missing");
    return fallback.value_or(1);
  }

  const Json* find(const std::string& pointer) const {
    const Json::json_pointer at(pointer);
    return document_.contains(at) ? &document_.at(at) : nullptr;
  }

  double check(const std::string& pointer, const Json& value, Sign sign) {
    if (!value.is_number()) {
      report(pointer, "must be a number");
      return 1;
    }
    const double number = value.get<double>();
    if (!std::isfinite(number)) report(pointer, "must be finite");
    if (sign == Sign::positive && !(number > 0)) report(pointer, "must be above 0");
    if (sign == Sign::not_negative && !(number >= 0)) report(pointer, "must not be negative");
    return number;
  }

  void report(const std::string& pointer, const std::string& message) {
    if (fault_.message.empty()) fault_ = Error{Fault::invalid, pointer, message};
  }

  const Error& fault() const { return fault_; }

 private:
  const Json& document_;
  Error fault_;
};

}  // namespace

Result<RobotParameters> parse_robot(const std::string& json_text) {
  const Json document = Json::parse(json_text, nullptr, false);
  if (document.is_discarded() || !document.is_object()) return invalid("", "a robot file is one JSON object");
  Reader in(document);
  RobotParameters p;

  const Json* id = in.find("/robot_id");
  if (id == nullptr || !id->is_string() || id->get<std::string>().empty()) {
    in.report("/robot_id", "must be a string of one character or more");
  } else {
    p.robot_id = id->get<std::string>();
  }
  p.wheel_radius_m = in.number("/kinematics/wheel_radius_m", Sign::positive);
  p.half_track_m = in.number("/kinematics/half_track_m", Sign::positive);
  p.com_offset_m = in.number("/kinematics/com_offset_m", Sign::any, 0);
  p.chassis_kg = in.number("/mass/chassis_kg", Sign::positive);
  p.wheel_kg = in.number("/mass/wheel_kg", Sign::not_negative, 0);
  p.yaw_inertia_kg_m2 = in.number("/mass/yaw_inertia_kg_m2", Sign::positive);
  p.payload_yaw_inertia_m2 = in.number("/mass/payload_yaw_inertia_m2", Sign::not_negative, 0.02);
  p.wheel_inertia_kg_m2 = in.number("/mass/wheel_inertia_kg_m2", Sign::not_negative, 0) +
                          in.number("/motor/rotor_inertia_kg_m2", Sign::not_negative, 0);
  p.resistance_ohm = in.number("/motor/resistance_ohm", Sign::positive);
  p.inductance_h = in.number("/motor/inductance_h", Sign::not_negative, 0);
  p.torque_constant_nm_a = in.number("/motor/torque_constant_nm_a", Sign::positive);
  p.voltage_constant_v_s_rad = in.number("/motor/voltage_constant_v_s_rad", Sign::positive);
  p.gear_ratio = in.number("/motor/gear_ratio", Sign::positive, 1);
  p.viscous_friction_nm_s_rad = in.number("/motor/viscous_friction_nm_s_rad", Sign::not_negative, 0);
  const Json* friction = in.find("/motor/friction_torque_nm");
  if (friction == nullptr || !friction->is_array() || friction->size() != 2) {
    in.report("/motor/friction_torque_nm", "must be [right, left]");
  } else {
    for (std::size_t side : {0u, 1u})
      p.friction_torque_nm[side] = in.check("/motor/friction_torque_nm/" + std::to_string(side),
                                            (*friction)[side], Sign::not_negative);
  }
  p.nominal_voltage_v = in.number("/battery/nominal_voltage_v", Sign::positive);
  p.capacity_ah = in.number("/battery/capacity_ah", Sign::positive);
  p.internal_resistance_ohm = in.number("/battery/internal_resistance_ohm", Sign::not_negative);
  p.capacity_ah *= in.number("/battery/ageing_factor", Sign::positive, 1);
  if (in.find("/battery/open_circuit_voltage") != nullptr) {
    const std::string at = "/battery/open_circuit_voltage";
    const Json* charge = in.find(at + "/charge");
    const Json* voltage = in.find(at + "/voltage_v");
    if (charge == nullptr || voltage == nullptr || !charge->is_array() || !voltage->is_array() ||
        charge->size() < 2 || charge->size() != voltage->size()) {
      in.report(at, "must hold charge and voltage_v, of the same length, two or more");
    } else {
      for (std::size_t k = 0; k < charge->size(); ++k) {
        const std::string index = "/" + std::to_string(k);
        const double share = in.check(at + "/charge" + index, (*charge)[k], Sign::not_negative);
        if (!p.open_circuit_voltage.empty() && share <= p.open_circuit_voltage.back().first)
          in.report(at + "/charge" + index, "must ascend");
        p.open_circuit_voltage.emplace_back(
            share, in.check(at + "/voltage_v" + index, (*voltage)[k], Sign::positive));
      }
    }
  }
  p.idle_power_w = in.number("/idle_power_w", Sign::not_negative, 0);
  p.speed_limit_m_s = in.number("/limits/speed_m_s", Sign::positive);
  p.acceleration_limit_m_s2 = in.number("/limits/acceleration_m_s2", Sign::positive);
  p.yaw_rate_limit_rad_s = in.number("/limits/yaw_rate_rad_s", Sign::positive);
  p.current_limit_a = in.number("/limits/current_a", Sign::positive);
  p.payload_limit_kg = in.number("/limits/payload_kg", Sign::not_negative, 0);
  if (const Json* effects = in.find("/effects"); effects != nullptr && !effects->empty())
    in.report("/effects", "must be empty: a virtual robot's imperfections are given with --effect");
  if (!in.fault().message.empty()) return tl::unexpected(in.fault());
  return p;
}

}  // namespace joulecast::virtual_robot

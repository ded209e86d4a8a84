#include "client/virtual_robot/robot_parameters.h"

#include <nlohmann/json.hpp>
#include <string>
#include <string_view>

#include "tests/client/robots.h"

namespace joulecast::virtual_robot {
namespace {

nlohmann::json amr_json() {
  for (const auto& robot : shipped_robots()) {
    if (robot.kind == "amr") return nlohmann::json::parse(robot.json_text);
  }
  return {};
}

TEST(RobotParameters, ReadsEveryField) {
  const RobotParameters amr = shipped("amr");
  EXPECT_EQ(amr.robot_id, "amr");
  EXPECT_EQ(amr.wheel_radius_m, 0.08);
  EXPECT_EQ(amr.com_offset_m, 0.02);
  EXPECT_DOUBLE_EQ(amr.wheel_inertia_kg_m2, 0.048 + 0.004);  // wheel and rotor
  EXPECT_EQ(amr.friction_torque_nm[1], 0.88);
  EXPECT_EQ(amr.payload_limit_kg, 60);
}

TEST(RobotParameters, ReadsCalibratedBattery) {
  auto document = amr_json();
  document["battery"]["open_circuit_voltage"] = {{"charge", {0, 0.5, 1}}, {"voltage_v", {21, 25, 29}}};
  document["battery"]["ageing_factor"] = 0.9;
  const auto robot = parse_robot(document.dump());
  ASSERT_TRUE(robot) << describe(robot.error());
  EXPECT_EQ(robot->open_circuit_voltage,
            (std::vector<std::pair<double, double>>{{0, 21}, {0.5, 25}, {1, 29}}));
  EXPECT_DOUBLE_EQ(robot->capacity_ah, 0.9 * shipped("amr").capacity_ah);
}

TEST(RobotParameters, ErrorNamesPointer) {
  const auto fault_of = [](const char* pointer, nlohmann::json value) {
    auto document = amr_json();
    document[nlohmann::json::json_pointer(pointer)] = std::move(value);
    const auto parsed = parse_robot(document.dump());
    return parsed ? std::string("accepted") : parsed.error().field;
  };
  EXPECT_EQ(fault_of("/kinematics/wheel_radius_m", 0), "/kinematics/wheel_radius_m");
  EXPECT_EQ(fault_of("/motor/resistance_ohm", "low"), "/motor/resistance_ohm");
  EXPECT_EQ(fault_of("/motor/friction_torque_nm", {1, -1}), "/motor/friction_torque_nm/1");
  EXPECT_EQ(fault_of("/motor/friction_torque_nm", 1), "/motor/friction_torque_nm");
  EXPECT_EQ(fault_of("/robot_id", ""), "/robot_id");
  EXPECT_EQ(fault_of("/battery/open_circuit_voltage", {{"charge", {0.5, 0.5}}, {"voltage_v", {24, 25}}}),
            "/battery/open_circuit_voltage/charge/1");
  EXPECT_EQ(fault_of("/battery/open_circuit_voltage", {{"charge", {0, 1}}, {"voltage_v", {24}}}),
            "/battery/open_circuit_voltage");
  EXPECT_EQ(fault_of("/effects/slope", {{"angle_rad", 0.1}}), "/effects");
  EXPECT_EQ(fault_of("/idle_power_w", 10), "accepted");
  auto lacking = amr_json();
  lacking["limits"].erase("speed_m_s");
  EXPECT_EQ(parse_robot(lacking.dump()).error().field, "/limits/speed_m_s");
  EXPECT_FALSE(parse_robot("[1, 2"));
}

}  // namespace
}  // namespace joulecast::virtual_robot

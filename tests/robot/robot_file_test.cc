#include "robot/robot_file.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <bit>
#include <cmath>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <random>

#include "robot/robot_fields.h"
#include "tests/support/shared_folder.h"

namespace joulecast::robot {
namespace {

using nlohmann::json;
using ::testing::HasSubstr;
using ::testing::Not;

const std::filesystem::path shipped = std::filesystem::path(JOULECAST_SOURCE_DIR) / "deploy/robots";

RobotModel nomad() {
  const auto model = load_robot(shipped / "nomad.json");
  EXPECT_TRUE(model) << describe(model.error());
  return *model;
}

// A model in which every member differs from its default, so that a lost field is detected.
RobotModel full_model() {
  RobotModel model = nomad();
  model.robot_id = "a.B_9-z";
  model.kinematics.com_offset_m = -0.03;
  model.mass.payload_yaw_inertia_m2 = 0.17;
  model.motor.rotor_inertia_kg_m2 = 0.001;
  model.battery.open_circuit_voltage = {{0, 18.1}, {0.1, 21}, {0.5, 21}, {1, 25.2}};
  model.battery.resistance_curve = {{0.1, 0.2}, {0.9, 0.1}};
  model.battery.branches = {{0.01, 20}, {0.02, 900}};
  model.battery.charge_lags = {{70, 40}, {150, 1500}};
  model.battery.cutoff_voltage_v = 18;
  model.battery.coulombic_efficiency = 0.99;
  model.battery.ageing_factor = 0.9;
  model.battery.activation_k = 2500;
  model.battery.thermal_resistance_k_w = 1.5;
  model.battery.thermal_time_constant_s = 3000;
  model.effects = {{"load_rolling", {{"c_rr", 0.01}}}, {"slope", {{"angle_rad", -0.02}, {"bias", 0}}}};
  return model;
}

Error error_of(const json& document) {
  const auto model = read_robot(document);
  EXPECT_FALSE(model) << document.dump();
  return model ? Error{} : model.error();
}

TEST(RobotFile, ShippedRobotsAreValid) {
  for (const char* name : {"nomad", "p3dx"}) {
    const auto model = load_robot(shipped / (std::string(name) + ".json"));
    ASSERT_TRUE(model) << describe(model.error());
    EXPECT_EQ(model->robot_id, name);
  }
}

TEST(RobotFile, RoundTripKeepsEveryMember) {
  const RobotModel model = full_model();
  for (const int indent : {-1, 0, 2}) {
    const auto again = parse_robot(to_json_text(model, indent));
    ASSERT_TRUE(again) << describe(again.error());
    EXPECT_EQ(*again, model);
  }
}

TEST(RobotFile, RoundTripKeepsEveryBit) {
  std::mt19937_64 random(20261121);
  std::uniform_int_distribution<std::uint64_t> mantissa(0, (std::uint64_t{1} << 52) - 1);
  std::uniform_int_distribution<std::uint64_t> exponent(1, 1022);  // all normal numbers below 1
  RobotModel model = nomad();
  model.battery.internal_resistance_ohm = 0;
  for (int i = 0; i < 20000; ++i) {
    const double drawn = std::bit_cast<double>(exponent(random) << 52 | mantissa(random));
    model.motor.inductance_h = drawn;
    model.effects = {{"e", {{"p", -drawn}}}};
    const auto again = parse_robot(to_json_text(model, -1));
    ASSERT_TRUE(again) << describe(again.error());
    ASSERT_EQ(std::bit_cast<std::uint64_t>(again->motor.inductance_h), std::bit_cast<std::uint64_t>(drawn));
    ASSERT_EQ(std::bit_cast<std::uint64_t>(again->effects[0].parameters[0].second),
              std::bit_cast<std::uint64_t>(-drawn));
  }
}

TEST(RobotFile, NamesOrDefaultsMissingKeys) {
  const json whole = robot_to_json(full_model());
  for (const Field& field : fields()) {
    const json::json_pointer pointer{std::string(field.pointer)};
    json document = whole;
    document[pointer.parent_pointer()].erase(std::string(field.key()));
    if (field.presence == Presence::optional) {
      const auto model = read_robot(document);
      EXPECT_TRUE(model) << field.pointer << ": " << describe(model.error());
    } else {
      EXPECT_EQ(error_of(document), (Error{Fault::invalid, std::string(field.pointer), "is missing"}));
    }
  }
}

TEST(RobotFile, AbsentNumbersTakeDefaults) {
  json document = robot_to_json(full_model());
  document["kinematics"].erase("com_offset_m");
  for (const char* key : {"inductance_h", "gear_ratio", "rotor_inertia_kg_m2"}) document["motor"].erase(key);
  const auto model = read_robot(document);
  ASSERT_TRUE(model) << describe(model.error());
  EXPECT_EQ(model->kinematics.com_offset_m, 0);
  EXPECT_EQ(model->motor.inductance_h, 0);
  EXPECT_EQ(model->motor.gear_ratio, 1);
  EXPECT_EQ(model->motor.rotor_inertia_kg_m2, 0);
}

TEST(RobotFile, RejectsNumbersOutsideBounds) {
  const json whole = robot_to_json(full_model());
  for (const Field& field : fields()) {
    const json::json_pointer pointer{std::string(field.pointer)};
    if (!whole[pointer].is_number()) continue;
    const Bounds& bounds = field.bounds;
    const double infinity = std::numeric_limits<double>::infinity();
    const double below =
        bounds.exclusive_minimum ? bounds.minimum : std::nextafter(bounds.minimum, -infinity);
    const double above = bounds.exclusive_maximum ? bounds.maximum : std::nextafter(bounds.maximum, infinity);
    for (const double value : {below, above, std::numeric_limits<double>::quiet_NaN()}) {
      json document = whole;
      document[pointer] = value;
      const Error error = error_of(document);
      EXPECT_EQ(error.field, field.pointer);
      EXPECT_THAT(error.message,
                  HasSubstr(std::string(bounds.exclusive_minimum ? "greater than " : "at least ")));
      EXPECT_THAT(error.message, HasSubstr(std::string(unit_of(field.key()))));
    }
  }
}

TEST(RobotFile, ReportsWrongTypes) {
  const json whole = robot_to_json(full_model());
  for (const Field& field : fields()) {
    for (const json& wrong : {json(nullptr), json(true), json("7"), json::array({json::object()})}) {
      if (field.pointer == "/robot_id" && wrong.is_string()) continue;
      json document = whole;
      document[json::json_pointer{std::string(field.pointer)}] = wrong;
      EXPECT_THAT(error_of(document).field, ::testing::StartsWith(std::string(field.pointer)));
    }
  }
  for (const char* object : {"kinematics", "mass", "motor", "battery", "limits"}) {
    json document = whole;
    document[object] = 3;
    EXPECT_EQ(error_of(document).field, std::string("/") + object);
    EXPECT_THAT(error_of(document).message, Not(HasSubstr("missing")));
  }
  EXPECT_EQ(error_of(json::array()).message, "is array, must be an object");
}

TEST(RobotFile, ReportsAllProblems) {
  json document = robot_to_json(full_model());
  document["mass"]["chassis_kg"] = -2;
  document["motor"]["friction_torque_nm"] = {0.1, -0.5};
  document["limits"].erase("speed_m_s");
  document["battery"]["colour"] = "red";
  const Error error = error_of(document);
  EXPECT_EQ(error.fault, Fault::invalid);
  EXPECT_THAT(error.field, ::testing::AnyOf("/battery/colour", "/mass/chassis_kg", "/limits/speed_m_s"));
  const std::string all = describe(error);
  EXPECT_THAT(all, HasSubstr("/mass/chassis_kg: is -2 kg, must be greater than 0 kg and at most 100000 kg"));
  EXPECT_THAT(all, HasSubstr("/motor/friction_torque_nm/1: is -0.5 N m, must be at least 0 N m"));
  EXPECT_THAT(all, HasSubstr("/limits/speed_m_s: is missing"));
  EXPECT_THAT(all, HasSubstr("/battery/colour: is an unknown member"));
}

TEST(RobotFile, RejectsUnknownKeys) {
  for (const char* pointer :
       {"/x", "/kinematics/x", "/mass/x", "/motor/x", "/battery/x", "/limits/x",
        "/battery/open_circuit_voltage/x", "/battery/branches/0/x", "/battery/charge_lags/1/x"}) {
    json document = robot_to_json(full_model());
    document[json::json_pointer(pointer)] = 1;
    EXPECT_EQ(error_of(document), (Error{Fault::invalid, pointer, "is an unknown member"}));
  }
}

TEST(RobotFile, ChecksConsistencyOfFields) {
  struct Case {
    const char* change;  // JSON merge patch
    const char* field;
  };
  for (const Case& item : {
           Case{R"({"kinematics": {"com_offset_m": 2.0}})", "/mass/yaw_inertia_kg_m2"},
           Case{R"({"mass": {"yaw_inertia_kg_m2": 0.05}})", "/mass/yaw_inertia_kg_m2"},
           Case{R"({"idle_power_w": 1800.0})", "/idle_power_w"},
           Case{R"({"battery": {"cutoff_voltage_v": 24.0}})", "/battery/cutoff_voltage_v"},
           Case{R"({"battery": {"nominal_voltage_v": 25.3}})", "/battery/nominal_voltage_v"},
           Case{R"({"battery": {"open_circuit_voltage": {"charge": [0, 0.5, 0.5, 1]}}})",
                "/battery/open_circuit_voltage/charge/2"},
           Case{R"({"battery": {"open_circuit_voltage": {"voltage_v": [18, 22, 21, 25]}}})",
                "/battery/open_circuit_voltage/voltage_v/2"},
           Case{R"({"battery": {"open_circuit_voltage": {"charge": [0.01, 0.1, 0.5, 1]}}})",
                "/battery/open_circuit_voltage/charge"},
           Case{R"({"battery": {"open_circuit_voltage": {"charge": [0, 1]}}})",
                "/battery/open_circuit_voltage"},
           Case{R"({"battery": {"open_circuit_voltage": {"charge": [0], "voltage_v": [24]}}})",
                "/battery/open_circuit_voltage"},
           Case{R"({"battery": {"resistance_curve": {"charge": [0.9, 0.1]}}})",
                "/battery/resistance_curve/charge/1"},
           Case{R"({"battery": {"resistance_curve": {"charge": [], "resistance_ohm": []}}})",
                "/battery/resistance_curve"},
           Case{R"({"battery": {"branches": [{"resistance_ohm": 1, "time_constant_s": 1},
                                             {"resistance_ohm": 1, "time_constant_s": 1},
                                             {"resistance_ohm": 1, "time_constant_s": 1}]}})",
                "/battery/branches"},
           Case{R"({"battery": {"branches": [{"resistance_ohm": 1, "time_constant_s": 0}]}})",
                "/battery/branches/0/time_constant_s"},
           Case{R"({"robot_id": "with space"})", "/robot_id"},
           Case{R"({"robot_id": ""})", "/robot_id"},
           Case{R"({"effects": {"Bad id": {}}})", "/effects/Bad id"},
           Case{R"({"effects": {"a/b": {}}})", "/effects/a~1b"},
           Case{R"({"effects": {"slope": {"angle_rad": "steep"}}})", "/effects/slope/angle_rad"},
       }) {
    json document = robot_to_json(full_model());
    document.merge_patch(json::parse(item.change));
    EXPECT_EQ(error_of(document).field, item.field) << item.change << " " << error_of(document).message;
  }
}

TEST(RobotFile, RejectsInvalidJson) {
  for (const char* text : {"", "{", "{} {}", "[1e999]", "\xff", "{\"a\":1,}"}) {
    const auto model = parse_robot(std::string_view(text));
    ASSERT_FALSE(model) << text;
    EXPECT_THAT(model.error().message, HasSubstr("malformed JSON"));
  }
  const auto twice = parse_robot(std::string_view(R"({"robot_id": "a", "robot_id": "b"})"));
  ASSERT_FALSE(twice);
  EXPECT_EQ(twice.error(), (Error{Fault::invalid, "/robot_id", "the key is given more than once"}));
  const auto huge = parse_robot(std::string_view(std::string((1 << 20) + 1, ' ')));
  ASSERT_FALSE(huge);
  EXPECT_EQ(huge.error().fault, Fault::too_large);
  EXPECT_FALSE(parse_robot(std::string_view(std::string(500000, '['))));
}

TEST(RobotFile, ReportsAbsentFilesAndFolders) {
  const auto model = load_robot(shipped / "absent.json");
  ASSERT_FALSE(model);
  EXPECT_EQ(model.error().fault, Fault::not_found);
  EXPECT_THAT(model.error().field, HasSubstr("absent.json"));
  const auto folder = load_robot(shipped);
  ASSERT_FALSE(folder);
  EXPECT_EQ(folder.error().fault, Fault::invalid);
}

TEST(RobotFile, ChecksModelsBuiltInCode) {
  RobotModel model = full_model();
  EXPECT_TRUE(validate(model));
  model.motor.gear_ratio = std::numeric_limits<double>::quiet_NaN();
  model.effects[0].parameters[0].second = std::numeric_limits<double>::infinity();
  const auto checked = validate(model);
  ASSERT_FALSE(checked);
  EXPECT_EQ(checked.error().field, "/motor/gear_ratio");
  EXPECT_THAT(checked.error().message, HasSubstr("/effects/load_rolling/c_rr"));
  model = full_model();
  model.effects[0].parameters.push_back(model.effects[0].parameters[0]);
  const auto twice = validate(model);
  ASSERT_FALSE(twice);
  EXPECT_EQ(twice.error(), (Error{Fault::invalid, "/effects/load_rolling/c_rr", "is given twice"}));
}

TEST(RobotFile, StatesRequiredCounts) {
  json document = robot_to_json(full_model());
  auto& curve = document["battery"]["open_circuit_voltage"];
  curve["charge"] = curve["voltage_v"] = json::array_t(max_curve_points + 1, 0.5);
  EXPECT_EQ(error_of(document),
            (Error{Fault::invalid, "/battery/open_circuit_voltage", "has 1002 points, must have 2 to 1001"}));
  document = robot_to_json(full_model());
  document["motor"]["friction_torque_nm"] = json::array_t(max_curve_points + 1, 1e9);
  EXPECT_EQ(error_of(document), (Error{Fault::invalid, "/motor/friction_torque_nm",
                                       "has 1002 numbers, must have 2: [right, left]"}));
}

TEST(BatteryFile, MatchesBatteryObject) {
  const RobotModel model = full_model();
  EXPECT_EQ(battery_to_json(model.battery), robot_to_json(model)["battery"]);
  const auto battery = parse_battery(to_json_text(model.battery));
  ASSERT_TRUE(battery) << describe(battery.error());
  EXPECT_EQ(*battery, model.battery);
  EXPECT_EQ(parse_battery(to_json_text(model)), model.battery);
  json document = battery_to_json(model.battery);
  document.erase("capacity_ah");
  document["robot_id"] = "x";
  const auto broken = parse_battery(document.dump());
  ASSERT_FALSE(broken);
  EXPECT_THAT(describe(broken.error()), HasSubstr("/battery/capacity_ah: is missing"));
  EXPECT_THAT(describe(broken.error()), HasSubstr("/battery/robot_id: is an unknown member"));
}

TEST(RobotFields, UnitsFollowFromNames) {
  EXPECT_EQ(unit_of("viscous_friction_nm_s_rad"), "N m s/rad");
  EXPECT_EQ(unit_of("voltage_constant_v_s_rad"), "V s/rad");
  EXPECT_EQ(unit_of("speed_m_s"), "m/s");
  EXPECT_EQ(unit_of("yaw_rate_rad_s"), "rad/s");
  EXPECT_EQ(unit_of("capacity_ah"), "Ah");
  EXPECT_EQ(unit_of("inductance_h"), "H");
  EXPECT_EQ(unit_of("gear_ratio"), "");
}

}  // namespace
}  // namespace joulecast::robot

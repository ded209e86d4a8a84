#include "robot/robot_schema.h"

#include <fmt/format.h>
#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <limits>
#include <map>
#include <nlohmann/json.hpp>
#include <set>
#include <string>

#include "describe/schema.h"
#include "robot/robot_fields.h"

namespace joulecast::robot {
namespace {

using nlohmann::json;

json schema() {
  return robot_schema();
}

// The constraints on numbers at one location.
struct Statement {
  Bounds bounds;
  bool required = false;
};

void PrintTo(const Statement& s, std::ostream* out) {
  *out << (s.bounds.exclusive_minimum ? "(" : "[") << s.bounds.minimum << ", " << s.bounds.maximum
       << (s.bounds.exclusive_maximum ? ")" : "]") << (s.required ? " required" : " optional");
}

bool operator==(const Statement& a, const Statement& b) {
  return a.bounds.minimum == b.bounds.minimum && a.bounds.maximum == b.bounds.maximum &&
         a.bounds.exclusive_minimum == b.bounds.exclusive_minimum &&
         a.bounds.exclusive_maximum == b.bounds.exclusive_maximum && a.required == b.required;
}

using Statements = std::map<std::string, Statement>;

Bounds bounds_of(const json& node) {
  Bounds bounds;
  if (node.contains("minimum")) bounds.minimum = node["minimum"];
  if (node.contains("exclusiveMinimum"))
    bounds.minimum = node["exclusiveMinimum"], bounds.exclusive_minimum = true;
  if (node.contains("maximum")) bounds.maximum = node["maximum"];
  if (node.contains("exclusiveMaximum"))
    bounds.maximum = node["exclusiveMaximum"], bounds.exclusive_maximum = true;
  return bounds;
}

// Visits the schema down to its leaves. Every object with named properties must be closed.
void collect(const json& node, const std::string& pointer, bool required, Statements& out) {
  if (node.contains("properties")) {
    EXPECT_EQ(node.value("additionalProperties", json(true)), json(false)) << pointer;
    for (const auto& [key, child] : node["properties"].items()) {
      bool child_required = false;
      for (const auto& name : node.value("required", json::array())) child_required |= name == key;
      collect(child, pointer + "/" + key, child_required, out);
    }
  } else if (node.contains("items")) {
    collect(node["items"], pointer, required, out);
  } else {
    out[pointer] = {bounds_of(node), required};
  }
}

Statements from_table() {
  Statements out;
  for (const Field& field : fields()) {
    const std::string pointer(field.pointer);
    const bool required = field.presence == Presence::required;
    if (!field.value_key.empty()) {
      out[pointer + "/charge"] = {fraction, true};
      out[pointer + "/" + std::string(field.value_key)] = {field.bounds, true};
    } else if (std::holds_alternative<std::vector<BatteryBranch>& (*)(RobotModel&)>(field.member)) {
      for (const auto& branch : element_fields<BatteryBranch>())
        out[pointer + "/" + std::string(branch.key)] = {branch.bounds, true};
    } else if (std::holds_alternative<std::vector<ChargeLag>& (*)(RobotModel&)>(field.member)) {
      for (const auto& lag : element_fields<ChargeLag>())
        out[pointer + "/" + std::string(lag.key)] = {lag.bounds, true};
    } else {
      out[pointer] = {field.bounds, required};
    }
  }
  return out;
}

TEST(RobotSchema, MatchesTheCommittedFile) {
  const char* path = JOULECAST_SOURCE_DIR "/schemas/robot.schema.json";
  const std::string text = robot_schema().dump(2) + "\n";
  if (std::getenv("UPDATE") != nullptr) std::ofstream(path) << text;
  std::ifstream file(path);
  EXPECT_EQ(std::string(std::istreambuf_iterator<char>(file), {}), text) << "regenerate: UPDATE=1";
}

TEST(RobotSchema, AcceptsShippedRobots) {
  for (const auto& entry : std::filesystem::directory_iterator(JOULECAST_SOURCE_DIR "/deploy/robots")) {
    if (entry.path().extension() != ".json") continue;
    std::ifstream file(entry.path());
    json robot = json::parse(file);
    EXPECT_TRUE(described::schema_faults(robot_schema(), robot).empty()) << entry.path();
    robot["battery"]["branches"] = {{{"resistance_ohm", -1}}};
    EXPECT_EQ(described::schema_faults(robot_schema(), robot).size(), 2U) << entry.path();
  }
}

TEST(RobotSchema, MatchesTheTable) {
  const json document = schema();
  Statements from_schema;
  collect(document, "", true, from_schema);
  EXPECT_EQ(from_schema, from_table());
}

TEST(RobotSchema, RequiresObjectsWithRequiredKeys) {
  const json document = schema();
  std::set<std::string> expected;
  for (const Field& field : fields())
    if (field.presence == Presence::required)
      expected.insert(std::string(field.pointer.substr(1, field.pointer.find('/', 1) - 1)));
  EXPECT_EQ(document["required"].get<std::set<std::string>>(), expected);
}

TEST(RobotSchema, SharesPatternsCountsAndDefaults) {
  const json document = schema();
  const json& properties = document["properties"];
  EXPECT_EQ(properties["robot_id"]["pattern"], robot_id_pattern);
  const json& effects = properties["effects"];
  EXPECT_EQ(effects["propertyNames"]["pattern"], effect_name_pattern);
  EXPECT_EQ(effects["additionalProperties"]["propertyNames"]["pattern"], effect_name_pattern);
  EXPECT_EQ(effects["maxProperties"], max_effects);
  EXPECT_EQ(effects["additionalProperties"]["maxProperties"], max_effect_parameters);
  const json& battery = properties["battery"]["properties"];
  EXPECT_EQ(battery["branches"]["maxItems"], max_branches);
  EXPECT_EQ(battery["charge_lags"]["maxItems"], max_branches);
  EXPECT_EQ(battery["open_circuit_voltage"]["properties"]["voltage_v"]["maxItems"], max_curve_points);
  EXPECT_EQ(battery["resistance_curve"]["properties"]["resistance_ohm"]["maxItems"], max_curve_points);
  EXPECT_EQ(battery["resistance_curve"]["properties"]["charge"]["maxItems"], max_curve_points);

  RobotModel born;
  for (const Field& field : fields()) {
    const auto* member = std::get_if<double& (*)(RobotModel&)>(&field.member);
    if (member == nullptr || field.presence == Presence::required) continue;
    const std::string pointer(field.pointer);
    const std::size_t slash = pointer.find('/', 1);
    const json& node = properties[pointer.substr(1, slash - 1)]["properties"][pointer.substr(slash + 1)];
    EXPECT_TRUE(node.value("description", "").ends_with(fmt::format("; default {}", (*member)(born))))
        << pointer;
  }
}

}  // namespace
}  // namespace joulecast::robot

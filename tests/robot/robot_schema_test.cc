#include <gtest/gtest.h>

#include <fstream>
#include <limits>
#include <map>
#include <nlohmann/json.hpp>
#include <set>
#include <string>

#include "robot/robot_fields.h"
#include "robot/robot_file.h"

namespace joulecast::robot {
namespace {

using nlohmann::json;

json schema() {
  std::ifstream file(std::string(JOULECAST_SOURCE_DIR) + "/schemas/robot.schema.json");
  return json::parse(file);
}

// The node, with its reference resolved.
const json& resolved(const json& root, const json& node) {
  if (!node.contains("$ref")) return node;
  return root[json::json_pointer(node["$ref"].get<std::string>().substr(1))];
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
void collect(const json& root, const json& reference, const std::string& pointer, bool required,
             Statements& out) {
  const json& node = resolved(root, reference);
  if (node.contains("properties")) {
    EXPECT_EQ(node.value("additionalProperties", json(true)), json(false)) << pointer;
    for (const auto& [key, child] : node["properties"].items()) {
      bool child_required = false;
      for (const auto& name : node.value("required", json::array())) child_required |= name == key;
      collect(root, child, pointer + "/" + key, child_required, out);
    }
  } else if (node.contains("items")) {
    collect(root, node["items"], pointer, required, out);
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
      for (const auto& branch : branch_fields())
        out[pointer + "/" + std::string(branch.key)] = {branch.bounds, true};
    } else if (std::holds_alternative<std::vector<ChargeLag>& (*)(RobotModel&)>(field.member)) {
      for (const auto& lag : lag_fields()) out[pointer + "/" + std::string(lag.key)] = {lag.bounds, true};
    } else {
      out[pointer] = {field.bounds, required};
    }
  }
  return out;
}

TEST(RobotSchema, MatchesTheTable) {
  const json document = schema();
  Statements from_schema;
  collect(document, document, "", true, from_schema);
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
  const json& battery = document["$defs"]["battery"]["properties"];
  EXPECT_EQ(battery["branches"]["maxItems"], max_branches);
  EXPECT_EQ(battery["charge_lags"]["maxItems"], max_branches);
  EXPECT_EQ(battery["open_circuit_voltage"]["properties"]["voltage_v"]["maxItems"], max_curve_points);
  EXPECT_EQ(battery["resistance_curve"]["properties"]["resistance_ohm"]["maxItems"], max_curve_points);
  EXPECT_EQ(document["$defs"]["charge"]["maxItems"], max_curve_points);

  RobotModel born;
  for (const Field& field : fields()) {
    const auto* member = std::get_if<double& (*)(RobotModel&)>(&field.member);
    if (member == nullptr || field.presence == Presence::required) continue;
    const std::string pointer(field.pointer);
    const std::size_t slash = pointer.find('/', 1);
    const json& node = properties[pointer.substr(1, slash - 1)]["properties"][pointer.substr(slash + 1)];
    EXPECT_EQ(node.value("default", json()), json((*member)(born))) << pointer;
  }
}

}  // namespace
}  // namespace joulecast::robot

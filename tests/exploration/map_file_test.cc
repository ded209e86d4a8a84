#include "tests/study/exploration/map_file.h"

#include <gtest/gtest.h>

#include <fstream>
#include <nlohmann/json.hpp>
#include <set>

#include "tests/study/exploration/explore.h"

namespace joulecast::exploration {
namespace {

using nlohmann::json;

json valid() {
  return json::parse(R"({
    "width_m": 12, "height_m": 8, "node_spacing_m": 0.25, "safety_radius_m": 0.4, "stop_unseen_nodes": 3,
    "obstacles": [{"square": {"center_m": [6, 4], "side_m": 2}}, {"polygon_m": [[1, 5], [3, 5], [2, 7]]}],
    "robot": {"x_m": 2, "y_m": 2, "heading_rad": 1.5}
  })");
}

TEST(MapFile, ReadsEveryField) {
  const auto map = read_map(valid());
  ASSERT_TRUE(map) << describe(map.error());
  EXPECT_EQ(map->width_m, 12);
  EXPECT_EQ(map->height_m, 8);
  EXPECT_EQ(map->node_spacing_m, 0.25);
  EXPECT_EQ(map->safety_radius_m, 0.4);
  EXPECT_EQ(map->stop_unseen_nodes, 3u);
  EXPECT_EQ(map->start, (Point{2, 2}));
  EXPECT_EQ(map->start_heading_rad, 1.5);
  ASSERT_EQ(map->obstacles.size(), 2u);
  EXPECT_TRUE(map->obstacles[0].contains({6.9, 4.9}));
  EXPECT_FALSE(map->obstacles[0].contains({7.1, 4}));
  EXPECT_TRUE(map->obstacles[1].contains({2, 5.5}));
}

TEST(MapFile, RoundTripsMapFiles) {
  const auto map = read_map(valid());
  ASSERT_TRUE(map);
  const json written = map_to_json(*map);
  const auto again = read_map(written);
  ASSERT_TRUE(again) << describe(again.error());
  EXPECT_EQ(map_to_json(*again), written);
}

TEST(MapFile, NamesTheFault) {
  struct Case {
    const char* patch;
    const char* field;
    Fault fault = Fault::invalid;
  };
  for (const Case& c : {
           Case{R"([{"op":"replace","path":"/width_m","value":0}])", "/width_m"},
           Case{R"([{"op":"replace","path":"/width_m","value":"12"}])", "/width_m"},
           Case{R"([{"op":"replace","path":"/height_m","value":1001}])", "/height_m"},
           Case{R"([{"op":"replace","path":"/node_spacing_m","value":-1}])", "/node_spacing_m"},
           Case{R"([{"op":"replace","path":"/node_spacing_m","value":9}])", "/node_spacing_m"},
           Case{R"([{"op":"replace","path":"/node_spacing_m","value":0.001}])", "/node_spacing_m",
                Fault::too_large},
           Case{R"([{"op":"replace","path":"/safety_radius_m","value":-0.1}])", "/safety_radius_m"},
           Case{R"([{"op":"replace","path":"/stop_unseen_nodes","value":-1}])", "/stop_unseen_nodes"},
           Case{R"([{"op":"replace","path":"/stop_unseen_nodes","value":1.5}])", "/stop_unseen_nodes"},
           Case{R"([{"op":"add","path":"/colour","value":"red"}])", "/colour"},
           Case{R"([{"op":"remove","path":"/robot"}])", "/robot"},
           Case{R"([{"op":"remove","path":"/robot/x_m"}])", "/robot/x_m"},
           Case{R"([{"op":"replace","path":"/robot/x_m","value":13}])", "/robot/x_m"},
           Case{R"([{"op":"replace","path":"/robot","value":{"x_m":6,"y_m":2.8}}])", "/robot"},
           Case{R"([{"op":"replace","path":"/obstacles","value":{}}])", "/obstacles"},
           Case{R"([{"op":"replace","path":"/obstacles/0","value":{}}])", "/obstacles/0"},
           Case{R"([{"op":"replace","path":"/obstacles/0/square/side_m","value":0}])",
                "/obstacles/0/square/side_m"},
           Case{R"([{"op":"remove","path":"/obstacles/0/square/center_m"}])", "/obstacles/0/square/center_m"},
           Case{R"([{"op":"replace","path":"/obstacles/1/polygon_m/2","value":[1]}])",
                "/obstacles/1/polygon_m/2"},
           Case{R"([{"op":"replace","path":"/obstacles/1/polygon_m/2","value":[2,null]}])",
                "/obstacles/1/polygon_m/2/1"},
           Case{R"([{"op":"add","path":"/obstacles/1/polygon_m/-","value":[2,5.5]}])",
                "/obstacles/1/polygon_m"},
       }) {
    const auto map = read_map(valid().patch(json::parse(c.patch)));
    ASSERT_FALSE(map) << c.patch;
    EXPECT_EQ(map.error().field, c.field) << describe(map.error());
    EXPECT_EQ(map.error().fault, c.fault) << describe(map.error());
  }
}

TEST(MapFile, CountsObstaclesAndCorners) {
  json many = valid();
  for (std::size_t k = 0; k < max_obstacles; ++k) many["obstacles"].push_back(many["obstacles"][0]);
  EXPECT_EQ(read_map(many).error().fault, Fault::too_large);
  json round = valid();
  for (std::size_t k = 0; k <= max_corners; ++k) round["obstacles"][1]["polygon_m"].push_back({k, k});
  EXPECT_EQ(read_map(round).error().fault, Fault::too_large);
}

TEST(MapFile, RejectsBrokenAndMissingFiles) {
  EXPECT_EQ(parse_map("{").error().fault, Fault::invalid);
  EXPECT_EQ(parse_map("[]").error().fault, Fault::invalid);
  EXPECT_EQ(load_map("no/such/map.json").error().fault, Fault::not_found);
}

TEST(MapFile, ShippedMapIsExplored) {
  const auto map = load_map(std::string(JOULECAST_SOURCE_DIR) + "/deploy/maps/yard.json");
  ASSERT_TRUE(map) << describe(map.error());
  const auto explored = explore(*map);
  ASSERT_TRUE(explored);
  EXPECT_EQ(explored->outcome, Outcome::explored);
}

TEST(MapFile, AgreesWithItsSchema) {
  std::ifstream file(std::string(JOULECAST_SOURCE_DIR) + "/tests/study/exploration/map.schema.json");
  const json schema = json::parse(file);
  const json& properties = schema["properties"];
  std::set<std::string> keys;
  for (const auto& [key, unused] : properties.items()) keys.insert(key);
  const json born = map_to_json(Map{});
  std::set<std::string> written;
  for (const auto& [key, unused] : born.items()) written.insert(key);
  EXPECT_EQ(keys, written);
  for (const char* key :
       {"width_m", "height_m", "node_spacing_m", "safety_radius_m", "stop_unseen_nodes", "obstacles"})
    EXPECT_EQ(properties[key]["default"], born[key]) << key;
  EXPECT_EQ(properties["width_m"]["maximum"], max_side_m);
  EXPECT_EQ(properties["obstacles"]["maxItems"], max_obstacles);
  EXPECT_EQ(properties["obstacles"]["items"]["oneOf"][1]["properties"]["polygon_m"]["maxItems"], max_corners);
}

}  // namespace
}  // namespace joulecast::exploration

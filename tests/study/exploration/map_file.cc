#include "tests/study/exploration/map_file.h"

#include <fmt/format.h>

#include <algorithm>
#include <initializer_list>
#include <iterator>
#include <nlohmann/json.hpp>
#include <string>

#include "base/bounds.h"
#include "base/json_text.h"
#include "base/text_file.h"

namespace joulecast::exploration {
namespace {

using Json = nlohmann::json;

constexpr std::size_t max_file_bytes = 1 << 20;

Result<void> object_with(const Json& value, const std::string& pointer,
                         std::initializer_list<std::string_view> known) {
  if (!value.is_object()) return invalid(pointer, fmt::format("is {}, must be an object", value.type_name()));
  for (const auto& [key, unused] : value.items())
    if (std::find(known.begin(), known.end(), key) == known.end())
      return invalid(pointer + "/" + key, "is an unknown member");
  return {};
}

Result<double> number(const Json& value, const std::string& pointer) {
  if (!value.is_number()) return invalid(pointer, fmt::format("is {}, must be a number", value.type_name()));
  return value.get<double>();
}

// The member `key` of an object; an absent one is `absent` where that is allowed.
Result<double> member(const Json& object, const std::string& pointer, const char* key,
                      const double* absent = nullptr) {
  const auto found = object.find(key);
  if (found != object.end()) return number(*found, pointer + "/" + key);
  if (absent != nullptr) return *absent;
  return invalid(pointer + "/" + key, "is missing");
}

Result<Point> point(const Json& value, const std::string& pointer) {
  if (!value.is_array() || value.size() != 2)
    return invalid(pointer, "must be an array of 2 numbers: [x, y]");
  const auto x = number(value[0], pointer + "/0");
  if (!x) return tl::unexpected(x.error());
  const auto y = number(value[1], pointer + "/1");
  if (!y) return tl::unexpected(y.error());
  return Point{*x, *y};
}

Result<ConvexPolygon> square(const Json& value, const std::string& pointer) {
  if (auto ok = object_with(value, pointer, {"center_m", "side_m"}); !ok) return tl::unexpected(ok.error());
  if (!value.contains("center_m")) return invalid(pointer + "/center_m", "is missing");
  const auto center = point(value["center_m"], pointer + "/center_m");
  if (!center) return tl::unexpected(center.error());
  const auto side = member(value, pointer, "side_m");
  if (!side) return tl::unexpected(side.error());
  if (const Bounds bounds{0, max_side_m, true}; !bounds.contain(*side))
    return invalid(pointer + "/side_m", out_of_bounds(*side, bounds, "m"));
  return ConvexPolygon::square(*center, *side);
}

Result<ConvexPolygon> polygon(const Json& value, const std::string& pointer) {
  if (!value.is_array()) return invalid(pointer, fmt::format("is {}, must be an array", value.type_name()));
  if (value.size() > max_corners) {
    return fail(Fault::too_large, pointer,
                fmt::format("has {} corners, must have at most {}", value.size(), max_corners));
  }
  std::vector<Point> corners;
  for (std::size_t k = 0; k < value.size(); ++k) {
    const auto corner = point(value[k], fmt::format("{}/{}", pointer, k));
    if (!corner) return tl::unexpected(corner.error());
    corners.push_back(*corner);
  }
  auto shape = ConvexPolygon::from_corners(std::move(corners));
  if (!shape) shape.error().field = pointer;
  return shape;
}

Result<ConvexPolygon> obstacle(const Json& value, const std::string& pointer) {
  if (auto ok = object_with(value, pointer, {"square", "polygon_m"}); !ok) return tl::unexpected(ok.error());
  if (value.size() != 1) return invalid(pointer, "must have exactly one of square and polygon_m");
  return value.contains("square") ? square(value["square"], pointer + "/square")
                                  : polygon(value["polygon_m"], pointer + "/polygon_m");
}

Result<void> read_robot(const Json& document, Map& map) {
  const auto robot = document.find("robot");
  if (robot == document.end()) return invalid("/robot", "is missing");
  if (auto ok = object_with(*robot, "/robot", {"x_m", "y_m", "heading_rad"}); !ok) return ok;
  const double ahead = 0;
  const auto x = member(*robot, "/robot", "x_m"), y = member(*robot, "/robot", "y_m"),
             heading = member(*robot, "/robot", "heading_rad", &ahead);
  for (const auto* value : {&x, &y, &heading})
    if (!*value) return tl::unexpected(value->error());
  map.start = {*x, *y};
  map.start_heading_rad = *heading;
  return {};
}

}  // namespace

Result<Map> read_map(const Json& document) {
  if (auto ok = object_with(document, "",
                            {"width_m", "height_m", "node_spacing_m", "safety_radius_m", "stop_unseen_nodes",
                             "obstacles", "robot"});
      !ok)
    return tl::unexpected(ok.error());
  Map map;
  struct Length {
    const char* key;
    double& value;
  };
  for (const Length& length :
       {Length{"width_m", map.width_m}, Length{"height_m", map.height_m},
        Length{"node_spacing_m", map.node_spacing_m}, Length{"safety_radius_m", map.safety_radius_m}}) {
    const auto value = member(document, "", length.key, &length.value);
    if (!value) return tl::unexpected(value.error());
    length.value = *value;
  }
  if (const auto stop = document.find("stop_unseen_nodes"); stop != document.end()) {
    if (!stop->is_number_unsigned())
      return invalid("/stop_unseen_nodes", "must be a whole number, at least 0");
    map.stop_unseen_nodes = stop->get<std::size_t>();
  }
  if (const auto obstacles = document.find("obstacles"); obstacles != document.end()) {
    if (!obstacles->is_array())
      return invalid("/obstacles", fmt::format("is {}, must be an array", obstacles->type_name()));
    if (obstacles->size() > max_obstacles) {
      return fail(Fault::too_large, "/obstacles",
                  fmt::format("has {} members, must have at most {}", obstacles->size(), max_obstacles));
    }
    for (std::size_t k = 0; k < obstacles->size(); ++k) {
      auto shape = obstacle((*obstacles)[k], fmt::format("/obstacles/{}", k));
      if (!shape) return tl::unexpected(shape.error());
      map.obstacles.push_back(std::move(*shape));
    }
  }
  if (auto ok = read_robot(document, map); !ok) return tl::unexpected(ok.error());
  if (auto ok = validate(map); !ok) return tl::unexpected(ok.error());
  return map;
}

Result<Map> parse_map(std::string_view text) {
  if (text.size() > max_file_bytes) {
    return fail(Fault::too_large, "",
                fmt::format("has {} bytes, must have at most {}", text.size(), max_file_bytes));
  }
  return parse_json(text).and_then(read_map);
}

Result<Map> load_map(const std::filesystem::path& path) {
  const auto text = read_text_file(path);
  if (!text) return tl::unexpected(text.error());
  auto map = parse_map(*text);
  if (!map) map.error().message = path.string() + ": " + map.error().message;
  return map;
}

Json map_to_json(const Map& map) {
  Json obstacles = Json::array();
  for (const ConvexPolygon& o : map.obstacles) {
    Json corners = Json::array();
    for (const Point& c : o.corners()) corners.push_back({c.x_m, c.y_m});
    obstacles.push_back({{"polygon_m", corners}});
  }
  return {
      {"width_m", map.width_m},
      {"height_m", map.height_m},
      {"node_spacing_m", map.node_spacing_m},
      {"safety_radius_m", map.safety_radius_m},
      {"stop_unseen_nodes", map.stop_unseen_nodes},
      {"obstacles", obstacles},
      {"robot", {{"x_m", map.start.x_m}, {"y_m", map.start.y_m}, {"heading_rad", map.start_heading_rad}}}};
}

}  // namespace joulecast::exploration

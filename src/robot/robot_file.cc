#include "robot/robot_file.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <set>

#include "base/json_text.h"
#include "base/overloaded.h"
#include "base/text_file.h"
#include "base/try.h"
#include "robot/robot_fields.h"

namespace joulecast::robot {
namespace {

using Json = nlohmann::json;

constexpr std::size_t max_file_bytes = 1 << 20;

// Collects problems; a pointer that has one is not reported again by later checks.
class Problems {
 public:
  void add(std::string pointer, std::string text) {
    if (pointers_.insert(pointer).second) list_.push_back({std::move(pointer), std::move(text)});
  }

  // Whether this pointer, one above or one below it has a problem already.
  bool at(std::string_view pointer) const {
    return std::any_of(list_.begin(), list_.end(), [&](const FieldFault& problem) {
      return problem.field == pointer || is_below(problem.field, pointer) || is_below(pointer, problem.field);
    });
  }

  bool none() const { return list_.empty(); }
  const std::vector<FieldFault>& list() const { return list_; }

 private:
  static bool is_below(std::string_view pointer, std::string_view parent) {
    return pointer.size() > parent.size() && pointer.starts_with(parent) && pointer[parent.size()] == '/';
  }

  std::vector<FieldFault> list_;
  std::set<std::string> pointers_;
};

// The pointer of a member.
std::string child(const std::string& pointer, std::string_view key) {
  return pointer + (Json::json_pointer() / std::string(key)).to_string();
}

// Whether the value is of the kind; a problem if not.
bool is_kind(bool fits, std::string_view kind, const Json& value, const std::string& pointer,
             Problems& problems) {
  if (!fits) problems.add(pointer, fmt::format("is {}, must be {}", value.type_name(), kind));
  return fits;
}

// A number out of bounds is a problem and is returned.
std::optional<double> number(const Json& value, const std::string& pointer, const Bounds& bounds,
                             std::string_view key, Problems& problems) {
  if (!is_kind(value.is_number(), "a number", value, pointer, problems)) return std::nullopt;
  const double given = value.get<double>();
  if (!std::isfinite(given) || !bounds.contain(given))
    problems.add(pointer, out_of_bounds(given, bounds, unit_of(key)));
  return given;
}

std::optional<std::vector<double>> numbers(const Json& value, const std::string& pointer,
                                           const Bounds& bounds, std::string_view key, Problems& problems) {
  if (!is_kind(value.is_array(), "an array of numbers", value, pointer, problems)) return std::nullopt;
  std::vector<double> out;
  for (std::size_t i = 0; i < value.size(); ++i) {
    const auto element = number(value[i], fmt::format("{}/{}", pointer, i), bounds, key, problems);
    if (!element) return std::nullopt;
    out.push_back(*element);
  }
  return out;
}

// Reports every other key of the object; false when the value is no object.
bool object_of(const Json& value, const std::string& pointer, const std::set<std::string_view>& known,
               Problems& problems) {
  if (!is_kind(value.is_object(), "an object", value, pointer, problems)) return false;
  for (const auto& [key, unused] : value.items())
    if (!known.contains(key)) problems.add(child(pointer, key), "is an unknown member");
  return true;
}

// ---- reading: shapes into the model, with the bounds of their values ----

void read(const Json& value, const std::string& pointer, const Field&, std::string& out, Problems& problems) {
  if (!is_kind(value.is_string(), "a string", value, pointer, problems)) return;
  out = value.get<std::string>();
  if (!is_robot_id(out))
    problems.add(pointer, fmt::format("is \"{}\", must match {}", out.substr(0, 80), robot_id_pattern));
}

void read(const Json& value, const std::string& pointer, const Field& field, double& out,
          Problems& problems) {
  out = number(value, pointer, field.bounds, field.key(), problems).value_or(out);
}

void read(const Json& value, const std::string& pointer, const Field& field, std::optional<double>& out,
          Problems& problems) {
  out = number(value, pointer, field.bounds, field.key(), problems);
}

void read(const Json& value, const std::string& pointer, const Field& field, std::array<double, 2>& out,
          Problems& problems) {
  if (value.is_array() && value.size() != out.size())
    problems.add(pointer, fmt::format("has {} numbers, must have 2: [right, left]", value.size()));
  else if (const auto both = numbers(value, pointer, field.bounds, field.key(), problems))
    std::copy(both->begin(), both->end(), out.begin());
}

void read(const Json& value, const std::string& pointer, const Field& field, Curve& out, Problems& problems) {
  if (!object_of(value, pointer, {"charge", field.value_key}, problems)) return;
  const auto wrong_count = [&](std::size_t count) {
    problems.add(pointer, fmt::format("has {} points, must have 2 to {}", count, max_curve_points));
  };
  const auto column = [&](std::string_view key, const Bounds& bounds) -> std::optional<std::vector<double>> {
    const std::string at = child(pointer, key);
    const auto found = value.find(key);
    if (found == value.end())
      problems.add(at, "is missing");
    else if (found->size() > max_curve_points)
      wrong_count(found->size());
    else
      return numbers(*found, at, bounds, key, problems);
    return std::nullopt;
  };
  const auto charge = column("charge", fraction), values = column(field.value_key, field.bounds);
  if (!charge || !values) return;
  const std::size_t count = charge->size();
  if (values->size() != count) {
    problems.add(pointer, fmt::format("has {} charge but {} {} numbers, must have as many of each", count,
                                      values->size(), field.value_key));
    return;
  }
  if (count < 2) wrong_count(count);
  for (std::size_t i = 0; i < count; ++i) {
    if (i > 0 && !((*charge)[i] > (*charge)[i - 1]))
      problems.add(
          fmt::format("{}/charge/{}", pointer, i),
          fmt::format("is {}, must be greater than the one before, {}", (*charge)[i], (*charge)[i - 1]));
    out.emplace_back((*charge)[i], (*values)[i]);
  }
}

template <class Element>
void read(const Json& value, const std::string& pointer, const Field&, std::vector<Element>& out,
          Problems& problems) {
  if (!is_kind(value.is_array(), "an array of objects", value, pointer, problems)) return;
  if (value.size() > max_branches)
    problems.add(pointer, fmt::format("has {} elements, must have at most {}", value.size(), max_branches));
  std::set<std::string_view> known;
  for (const auto& field : element_fields<Element>()) known.insert(field.key);
  for (std::size_t i = 0; i < value.size(); ++i) {
    const std::string element_pointer = fmt::format("{}/{}", pointer, i);
    Element& element = out.emplace_back();
    if (!object_of(value[i], element_pointer, known, problems)) continue;
    for (const auto& field : element_fields<Element>()) {
      const std::string member = child(element_pointer, field.key);
      if (const auto found = value[i].find(field.key); found == value[i].end())
        problems.add(member, "is missing");
      else if (const auto given = number(*found, member, field.bounds, field.key, problems))
        element.*field.member = *given;
    }
  }
}

void read(const Json& value, const std::string& pointer, const Field&, std::vector<AdoptedEffect>& out,
          Problems& problems) {
  if (!is_kind(value.is_object(), "an object", value, pointer, problems)) return;
  if (value.size() > max_effects)
    problems.add(pointer, fmt::format("has {} effects, must have at most {}", value.size(), max_effects));
  for (const auto& [id, parameters] : value.items()) {
    const std::string effect_pointer = child(pointer, id);
    AdoptedEffect& effect = out.emplace_back();
    effect.id = id;
    if (!is_effect_name(id))
      problems.add(effect_pointer, fmt::format("is no effect id, must match {}", effect_name_pattern));
    if (!is_kind(parameters.is_object(), "an object", parameters, effect_pointer, problems)) continue;
    if (parameters.size() > max_effect_parameters)
      problems.add(effect_pointer, fmt::format("has {} parameters, must have at most {}", parameters.size(),
                                               max_effect_parameters));
    for (const auto& [name, parameter] : parameters.items()) {
      const std::string name_pointer = child(effect_pointer, name);
      if (!is_effect_name(name))
        problems.add(name_pointer, fmt::format("is no parameter name, must match {}", effect_name_pattern));
      if (const auto given = number(parameter, name_pointer, {}, {}, problems))
        effect.parameters.emplace_back(name, *given);
    }
  }
}

// ---- constraints between fields ----

// Parallel-axis bound: the chassis's mass centre is d ahead of the axle, the wheels l to both sides.
void check_inertia(const RobotModel& model, Problems& problems) {
  if (problems.at("/kinematics") || problems.at("/mass")) return;
  const double d = model.kinematics.com_offset_m;
  const double l = model.kinematics.half_track_m;
  const double least = model.mass.chassis_kg * d * d + 2 * model.mass.wheel_kg * l * l;
  if (model.mass.yaw_inertia_kg_m2 < least)
    problems.add("/mass/yaw_inertia_kg_m2",
                 fmt::format("is {} kg m², must be at least chassis_kg·com_offset_m² + "
                             "2·wheel_kg·half_track_m² = {} kg m² (is com_offset_m = {} m right?)",
                             model.mass.yaw_inertia_kg_m2, least, d));
}

void check_open_circuit_voltage(const Battery& battery, Problems& problems) {
  const std::string pointer = "/battery/open_circuit_voltage";
  const Curve& curve = battery.open_circuit_voltage;
  if (curve.size() < 2 || problems.at(pointer)) return;
  if (curve.front().first != 0 || curve.back().first != 1)
    problems.add(pointer + "/charge", fmt::format("runs from {} to {}, must run from 0 to 1",
                                                  curve.front().first, curve.back().first));
  for (std::size_t i = 1; i < curve.size(); ++i)
    if (curve[i].second < curve[i - 1].second)
      problems.add(fmt::format("{}/voltage_v/{}", pointer, i),
                   fmt::format("is {} V, must be at least the one before, {} V", curve[i].second,
                               curve[i - 1].second));
  const double lowest = curve.front().second;
  const double highest = curve.back().second;
  if (battery.nominal_voltage_v < lowest || battery.nominal_voltage_v > highest)
    problems.add("/battery/nominal_voltage_v",
                 fmt::format("is {} V, must lie in the open-circuit voltage's range, {} V to {} V",
                             battery.nominal_voltage_v, lowest, highest));
}

void check_battery(const Battery& battery, Problems& problems) {
  check_open_circuit_voltage(battery, problems);
  if (problems.at("/battery/nominal_voltage_v")) return;
  if (battery.cutoff_voltage_v && !problems.at("/battery/cutoff_voltage_v") &&
      *battery.cutoff_voltage_v >= battery.nominal_voltage_v)
    problems.add("/battery/cutoff_voltage_v",
                 fmt::format("is {} V, must be below nominal_voltage_v = {} V", *battery.cutoff_voltage_v,
                             battery.nominal_voltage_v));
}

// A source of voltage U behind R gives at most U²/(4R).
void check_idle_power(const RobotModel& model, Problems& problems) {
  if (problems.at("/battery") || problems.at("/idle_power_w")) return;
  const Battery& battery = model.battery;
  if (battery.internal_resistance_ohm == 0) return;
  const double most =
      battery.nominal_voltage_v * battery.nominal_voltage_v / (4 * battery.internal_resistance_ohm);
  if (model.idle_power_w >= most)
    problems.add("/idle_power_w", fmt::format("is {} W, must be less than the battery's greatest power, "
                                              "nominal_voltage_v²/(4·internal_resistance_ohm) = {} W",
                                              model.idle_power_w, most));
}

// ---- the document as a whole ----

bool is_battery_field(const Field& field) {
  return field.pointer.starts_with("/battery/");
}

// The keys allowed in each object of the file, by the object's own pointer.
std::set<std::string_view> keys_below(std::string_view object_pointer) {
  std::set<std::string_view> keys;
  for (const Field& field : fields()) {
    if (!field.pointer.starts_with(object_pointer) || field.pointer[object_pointer.size()] != '/') continue;
    const std::string_view rest = field.pointer.substr(object_pointer.size() + 1);
    keys.insert(rest.substr(0, rest.find('/')));
  }
  return keys;
}

// Reads the rows of the table that `wanted` selects.
template <class Wanted>
void read_document(const Json& document, Wanted wanted, RobotModel& model, Problems& problems) {
  if (!object_of(document, "", keys_below(""), problems)) return;
  std::set<std::string_view> visited;
  for (const Field& field : fields()) {
    if (!wanted(field)) continue;
    const std::string_view parent = field.pointer.substr(0, field.pointer.rfind('/'));
    const Json* object = &document;
    if (!parent.empty()) {
      const auto found = document.find(parent.substr(1));
      if (found == document.end()) {
        problems.add(std::string(parent), "is missing");
        continue;
      }
      if (visited.insert(parent).second) object_of(*found, std::string(parent), keys_below(parent), problems);
      if (!found->is_object()) continue;
      object = &*found;
    }
    const std::string pointer(field.pointer);
    if (const auto value = object->find(field.key()); value != object->end())
      std::visit([&](auto member) { read(*value, pointer, field, member(model), problems); }, field.member);
    else if (field.presence == Presence::required)
      problems.add(pointer, "is missing");
  }
}

Result<Json> parse_text(std::string_view text) {
  if (text.size() > max_file_bytes)
    return fail(Fault::too_large, "",
                fmt::format("is {} bytes, must be at most {}", text.size(), max_file_bytes));
  return parse_json(text);
}

RobotModel read_robot(const Json& document, Problems& problems) {
  RobotModel model;
  read_document(
      document, [](const Field&) { return true; }, model, problems);
  check_inertia(model, problems);
  check_battery(model.battery, problems);
  check_idle_power(model, problems);
  return model;
}

Result<Battery> parse_battery_document(const Json& document) {
  Problems problems;
  RobotModel model;
  read_document(Json::object({{"battery", document}}), is_battery_field, model, problems);
  check_battery(model.battery, problems);
  if (!problems.none()) return tl::unexpected(error_of(problems.list()));
  return model.battery;
}

template <class T>
Result<T> load(const std::filesystem::path& path, Result<T> (*parse)(std::string_view)) {
  return read_text_file(path).and_then(parse).map_error([&](Error error) {
    if (error.field == path.string()) return error;
    if (!error.field.empty()) error.message = error.field + ": " + error.message;
    error.field = path.string();
    return error;
  });
}

// ---- writing ----

Json written(const Curve& curve, std::string_view value_key) {
  Json charge = Json::array();
  Json values = Json::array();
  for (const auto& [at_charge, value] : curve) {
    charge.push_back(at_charge);
    values.push_back(value);
  }
  return {{"charge", std::move(charge)}, {std::string(value_key), std::move(values)}};
}

template <class Element>
Json written(const std::vector<Element>& elements) {
  Json out = Json::array();
  for (const Element& element : elements) {
    Json& object = out.emplace_back(Json::object());
    for (const auto& field : element_fields<Element>())
      object[std::string(field.key)] = element.*field.member;
  }
  return out;
}

Json written(const std::vector<AdoptedEffect>& effects) {
  Json out = Json::object();
  for (const AdoptedEffect& effect : effects) {
    Json& parameters = out[effect.id] = Json::object();
    for (const auto& [name, value] : effect.parameters) parameters[name] = value;
  }
  return out;
}

void write_field(const Field& field, RobotModel& model, Json& document) {
  const Json::json_pointer pointer{std::string(field.pointer)};
  std::visit(Overloaded{[&](std::optional<double>& (*member)(RobotModel&)) {
                          if (member(model)) document[pointer] = *member(model);
                        },
                        [&](Curve& (*member)(RobotModel&)) {
                          if (!member(model).empty())
                            document[pointer] = written(member(model), field.value_key);
                        },
                        [&]<class Element>(std::vector<Element>& (*member)(RobotModel&)) {
                          if (!member(model).empty()) document[pointer] = written(member(model));
                        },
                        [&](auto member) { document[pointer] = member(model); }},
             field.member);
}

std::string dumped(const Json& document, int indent) {
  return document.dump(indent, ' ', false, Json::error_handler_t::replace);
}

}  // namespace

std::vector<FieldFault> problems_of(const Json& document) {
  Problems problems;
  read_robot(document, problems);
  return problems.list();
}

Result<RobotModel> read_robot(const Json& document) {
  Problems problems;
  RobotModel model = read_robot(document, problems);
  if (!problems.none()) return tl::unexpected(error_of(problems.list()));
  return model;
}

Result<RobotModel> parse_robot(std::string_view json_text) {
  return parse_text(json_text).and_then([](const Json& document) { return read_robot(document); });
}

Result<RobotModel> load_robot(const std::filesystem::path& path) {
  return load<RobotModel>(path, parse_robot);
}

Result<void> validate(const RobotModel& model) {
  std::set<std::string> keys;  // of effects and of their parameters
  for (const AdoptedEffect& effect : model.effects) {
    const std::string of_effect = child("/effects", effect.id);
    if (!keys.insert(of_effect).second) return invalid(of_effect, "is given twice");
    for (const auto& [name, value] : effect.parameters)
      if (const std::string key = child(of_effect, name); !keys.insert(key).second)
        return invalid(key, "is given twice");
  }
  TRY(read_robot(robot_to_json(model)));
  return {};
}

Result<Battery> parse_battery(std::string_view json_text) {
  return parse_text(json_text).and_then([](const Json& document) {
    return parse_battery_document(document.is_object() ? document.value("battery", document) : document);
  });
}

Result<Battery> load_battery(const std::filesystem::path& path) {
  return load<Battery>(path, parse_battery);
}

Json robot_to_json(const RobotModel& model) {
  RobotModel copy = model;
  Json document = Json::object();
  for (const Field& field : fields()) write_field(field, copy, document);
  return document;
}

Json battery_to_json(const Battery& battery) {
  RobotModel model;
  model.battery = battery;
  Json document = Json::object();
  for (const Field& field : fields())
    if (is_battery_field(field)) write_field(field, model, document);
  return document["battery"];
}

std::string to_json_text(const RobotModel& model, int indent) {
  return dumped(robot_to_json(model), indent);
}

std::string to_json_text(const Battery& battery, int indent) {
  return dumped(battery_to_json(battery), indent);
}

}  // namespace joulecast::robot

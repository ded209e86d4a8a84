#include "robot/robot_schema.h"

#include <map>

#include "base/overloaded.h"
#include "describe/input.h"
#include "robot/robot_fields.h"

namespace joulecast::robot {
namespace {

using described::of_array;
using described::of_bounds;
using described::of_object;
using described::Schema;
using described::with_words;

Schema of_curve(const Field& field) {
  const auto points = [](const Bounds& bounds) {
    return of_array(of_bounds(bounds), described::of_count({2, max_curve_points}));
  };
  return of_object({}, {},
                   {{"charge", with_words(points(fraction), "states of charge of the points")},
                    {std::string(field.value_key), with_words(points(field.bounds), "values there")}});
}

template <class Element>
Schema of_elements() {
  Schema properties = Schema::object();
  for (const auto& field : element_fields<Element>())
    properties[std::string(field.key)] = with_words(of_bounds(field.bounds), field.words);
  return of_array(of_object({}, {}, properties), described::of_count({0, max_branches}));
}

Schema by_name(Schema values, std::size_t most) {
  return {{"type", "object"},
          {"maxProperties", most},
          {"propertyNames", {{"pattern", effect_name_pattern}}},
          {"additionalProperties", std::move(values)}};
}

Schema schema_of(const Field& field) {
  return std::visit(
      Overloaded{[&](double& (*member)(RobotModel&)) {
                   RobotModel born;
                   Schema schema = of_bounds(field.bounds);
                   if (field.presence == Presence::optional)
                     schema["default"] = described::of_number(member(born));
                   return schema;
                 },
                 [&](std::optional<double>& (*)(RobotModel&)) { return of_bounds(field.bounds); },
                 [&](std::array<double, 2>& (*)(RobotModel&)) {
                   return of_array(of_bounds(field.bounds), described::of_count({2, 2}));
                 },
                 [](std::string& (*)(RobotModel&)) {
                   return Schema{{"type", "string"}, {"pattern", robot_id_pattern}};
                 },
                 [&](Curve& (*)(RobotModel&)) { return of_curve(field); },
                 []<class Element>(std::vector<Element>& (*)(RobotModel&)) { return of_elements<Element>(); },
                 [](std::vector<AdoptedEffect>& (*)(RobotModel&)) {
                   return by_name(by_name(described::of_type("number"), max_effect_parameters), max_effects);
                 }},
      field.member);
}

}  // namespace

Schema robot_schema() {
  struct Object {
    Schema properties = Schema::object();
    std::vector<std::string> required;
    void add(std::string_view name, Schema schema, bool is_required) {
      properties[std::string(name)] = std::move(schema);
      if (is_required) required.emplace_back(name);
    }
  };
  std::map<std::string_view, Object> objects;  // by their pointers
  for (const Field& field : fields())
    objects[field.pointer.substr(0, field.pointer.rfind('/'))].add(
        field.key(), with_words(schema_of(field), field.words), field.presence == Presence::required);
  Object& file = objects[""];
  for (const auto& [pointer, words] : object_words()) {
    const Object& object = objects[pointer];
    file.add(pointer.substr(1), of_object({}, words, object.properties, object.required),
             !object.required.empty());
  }
  return of_object("Robot file", file_words, file.properties, file.required);
}

}  // namespace joulecast::robot

#pragma once

#include <algorithm>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "describe/schema.h"

namespace joulecast::testing {

// Validates JSON with the first of these schemas: types, enumerations, required and unknown members, items,
// `$ref` to another one and `anyOf`. Other keywords are ignored.
class SchemaCheck {
 public:
  explicit SchemaCheck(const described::Schemas& schemas) : first_(schemas.front().second) {
    for (const auto& [name, schema] : schemas) by_file_[name + ".schema.json"] = schema;
  }

  // The violations, each with its location.
  std::vector<std::string> faults(const nlohmann::json& value) const {
    std::vector<std::string> found;
    check(first_, value, "", found);
    return found;
  }

 private:
  using json = nlohmann::json;

  static bool is_of(const json& value, const std::string& type) {
    if (type == "integer") return value.is_number_integer();
    return type == value.type_name();
  }

  void check(const json& schema, const json& value, const std::string& at,
             std::vector<std::string>& found) const {
    if (schema.contains("$ref"))
      return check(by_file_.at(schema["$ref"].get<std::string>()), value, at, found);
    if (schema.contains("anyOf")) {
      const auto fits = [&](const json& option) {
        std::vector<std::string> inner;
        check(option, value, at, inner);
        return inner.empty();
      };
      if (std::ranges::none_of(schema["anyOf"], fits)) found.push_back(at + " fits none of its forms");
      return;
    }
    if (schema.contains("type")) {
      const json types = schema["type"].is_array() ? schema["type"] : json::array({schema["type"]});
      if (std::ranges::none_of(types, [&](const json& type) { return is_of(value, type); })) {
        found.push_back(at + " is " + value.type_name() + ", not " + types.dump());
        return;
      }
    }
    if (schema.contains("enum") && std::ranges::find(schema["enum"], value) == schema["enum"].end())
      found.push_back(at + " is " + value.dump());
    if (value.is_object()) check_members(schema, value, at, found);
    if (!value.is_array()) return;
    if (schema.contains("minItems") && value.size() < schema["minItems"])
      found.push_back(at + " is too short");
    if (schema.contains("maxItems") && value.size() > schema["maxItems"])
      found.push_back(at + " is too long");
    for (std::size_t k = 0; schema.contains("items") && k < value.size(); ++k)
      check(schema["items"], value[k], at + "/" + std::to_string(k), found);
  }

  void check_members(const json& schema, const json& value, const std::string& at,
                     std::vector<std::string>& found) const {
    for (const json& name : schema.value("required", json::array()))
      if (!value.contains(name)) found.push_back(at + "/" + name.get<std::string>() + " is missing");
    const json named = schema.value("properties", json::object()),
               rest = schema.value("additionalProperties", json(true));
    for (const auto& [name, member] : value.items()) {
      if (named.contains(name)) {
        check(named[name], member, at + "/" + name, found);
      } else if (rest.is_object()) {
        check(rest, member, at + "/" + name, found);
      } else if (rest == false) {
        found.push_back(at + "/" + name + " is unknown");
      }
    }
  }

  json first_, by_file_;
};

}  // namespace joulecast::testing

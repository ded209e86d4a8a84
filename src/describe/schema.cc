#include "describe/schema.h"

#include <re2/re2.h>

#include <algorithm>
#include <cmath>

#include "base/bounds.h"
#include "base/nearest_word.h"

namespace joulecast::described {
namespace {

// The same member with its default in its description: generators of clients take one with "default" as
// always present, also in requests.
Schema with_default_in_words(Schema member) {
  const auto fallback = member.find("default");
  if (fallback == member.end()) return member;
  std::string words = member.value("description", "");
  if (*fallback != "") {
    if (!words.empty()) words += "; ";
    words += "default ";
    words += fallback->is_string() ? fallback->get<std::string>() : fallback->dump();
  }
  member.erase("default");
  member["description"] = std::move(words);
  return member;
}

using Json = nlohmann::json;

constexpr std::pair<std::string_view, std::string_view> type_words[] = {{"null", "null"},
                                                                        {"object", "an object"},
                                                                        {"array", "an array"},
                                                                        {"string", "a string"},
                                                                        {"number", "a number"},
                                                                        {"boolean", "true or false"},
                                                                        {"integer", "a whole number"}};

std::string_view words_of_type(std::string_view type) {
  return std::ranges::find(type_words, type, &std::pair<std::string_view, std::string_view>::first)->second;
}

bool is_of_type(const Json& value, const std::string& type) {
  if (type == "integer") return value.is_number_integer();
  return value.is_number() ? type == "number" && std::isfinite(value.get<double>())
                           : type == value.type_name();
}

// Of a number, or of a size with the keywords min<name> and max<name>.
Bounds bounds_of(const Schema& schema, const std::string& name) {
  Bounds bounds;
  bounds.exclusive_minimum = name == "imum" && schema.contains("exclusiveMinimum");
  bounds.minimum = schema.value(bounds.exclusive_minimum ? "exclusiveMinimum" : "min" + name, bounds.minimum);
  bounds.maximum = schema.value("max" + name, bounds.maximum);
  return bounds;
}

std::string list(const Schema& texts, const std::string& between) {
  std::string all;
  for (const Schema& text : texts) all.append(all.empty() ? "" : between).append(text.get<std::string>());
  return all;
}

class Check {
 public:
  explicit Check(const Schema& root) : root_(root) {}
  std::vector<FieldFault> faults;

  void value(const Schema& unresolved, const Json& given, const std::string& at) {
    const Schema schema = resolved(unresolved);
    if (const std::string type = schema.value("type", ""); !type.empty() && !is_of_type(given, type))
      return fault(at, std::string("must be ").append(words_of_type(type)));
    if (schema.contains("enum") && std::ranges::find(schema["enum"], Schema(given)) == schema["enum"].end())
      fault(at, "must be one of " + list(schema["enum"], ", "));
    if (schema.contains("not") && Schema(given) == schema["not"]["const"])
      fault(at, "must not be " + given.dump());
    if (given.is_number()) within(bounds_of(schema, "imum"), given.get<double>(), "", at);
    if (given.is_string()) text(schema, given, at);
    if (given.is_array()) {
      within(bounds_of(schema, "Items"), static_cast<double>(given.size()), "items", at);
      for (std::size_t k = 0; schema.contains("items") && k < given.size(); ++k)
        value(schema["items"], given[k], at + "/" + std::to_string(k));
    }
    if (given.is_object()) members(schema, given, at);
    if (schema.contains("oneOf")) one_of(schema["oneOf"], given, at);
  }

 private:
  void fault(const std::string& at, std::string says) { faults.push_back({at, std::move(says)}); }

  // With the members of the schema that it refers to.
  Schema resolved(const Schema& schema) const {
    if (!schema.contains("$ref")) return schema;
    Schema whole = resolved(root_[Schema::json_pointer(schema["$ref"].get<std::string>().substr(1))]);
    for (const auto& [name, content] : schema.items())
      if (name == "properties" && whole.contains(name))
        whole[name].update(content);
      else if (name == "required" && whole.contains(name))
        whole[name].insert(whole[name].end(), content.begin(), content.end());
      else
        whole[name] = content;
    return whole;
  }

  void within(const Bounds& bounds, double number, const std::string& unit, const std::string& at) {
    if (!bounds.contain(number)) fault(at, requirement(bounds, unit));
  }

  void text(const Schema& schema, const std::string& given, const std::string& at) {
    within(bounds_of(schema, "Length"), static_cast<double>(given.size()), "characters", at);
    const std::string pattern = schema.value("pattern", "");
    if (!pattern.empty() && !RE2::FullMatch(given, pattern))
      fault(at, "must be " + schema.value("description", "of the form " + pattern));
  }

  void members(const Schema& schema, const Json& given, const std::string& at) {
    const Schema named = schema.value("properties", Schema::object());
    const Schema others =
        schema.value("additionalProperties", schema.value("unevaluatedProperties", Schema(true)));
    within(bounds_of(schema, "Properties"), static_cast<double>(given.size()), "members", at);
    std::vector<std::string> names;
    for (const auto& [name, inner] : named.items()) names.push_back(name);
    for (const auto& [name, inner] : given.items()) {
      const std::string here = at + "/" + name;
      if (schema.contains("propertyNames")) value(schema["propertyNames"], name, here);
      if (named.contains(name)) continue;
      if (others == Schema(false))
        fault(here, "is an unknown member" + did_you_mean(name, names));
      else if (others.is_object())
        value(others, inner, here);
    }
    for (const auto& [name, inner] : named.items())
      if (const auto found = given.find(name); found != given.end()) value(inner, *found, at + "/" + name);
    for (const Schema& name : schema.value("required", Schema::array()))
      if (!given.contains(name.get<std::string>())) fault(at + "/" + name.get<std::string>(), "is missing");
  }

  // Forms differ by the type of the value, or by the members that they require.
  void one_of(const Schema& forms, const Json& given, const std::string& at) {
    std::size_t fitting = 0;
    std::string types, required;
    const Schema* of_its_type = nullptr;
    for (const Schema& form : forms) {
      Check alone(root_);
      alone.value(form, given, at);
      fitting += alone.faults.empty();
      const Schema whole = resolved(form);
      const std::string type = whole.value("type", "");
      if (type.empty())
        required.append(required.empty() ? "" : ", ").append(list(whole["required"], " with "));
      else
        types.append(types.empty() ? "" : " or ").append(words_of_type(type));
      if (!type.empty() && is_of_type(given, type)) of_its_type = &form;
    }
    if (fitting == 1) return;
    if (of_its_type != nullptr) return value(*of_its_type, given, at);
    fault(at, types.empty() ? "must have exactly one of " + required : "must be " + types);
  }

  const Schema& root_;
};

}  // namespace

Schema of_type(std::string_view type, bool or_null) {
  if (or_null) return {{"type", {type, "null"}}};
  return {{"type", type}};
}

Schema with_null_numbers(Schema schema) {
  if (schema.value("type", Schema()) == "number") schema["type"] = {"number", "null"};
  if (const auto items = schema.find("items"); items != schema.end())
    *items = with_null_numbers(std::move(*items));
  if (const auto members = schema.find("properties"); members != schema.end())
    for (Schema& member : *members) member = with_null_numbers(std::move(member));
  return schema;
}

Schema of_object(std::string_view title, std::string_view words, const Schema& properties,
                 const std::vector<std::string>& required) {
  Schema schema = Schema::object();
  if (!title.empty()) schema["title"] = title;
  schema["type"] = "object";
  if (!words.empty()) schema["description"] = words;
  schema["properties"] = Schema::object();
  for (const auto& [name, member] : properties.items())
    schema["properties"][name] = with_default_in_words(member);
  schema["required"] = required;
  schema["additionalProperties"] = false;
  return schema;
}

Schema of_object(std::string_view title, std::string_view words, const Schema& properties) {
  std::vector<std::string> required;
  for (const auto& [member, unused] : properties.items()) required.push_back(member);
  return of_object(title, words, properties, required);
}

Schema of_array(Schema items, const Schema& limits) {
  Schema schema{{"type", "array"}, {"items", std::move(items)}};
  schema.update(limits);
  return schema;
}

Schema of_page(std::string_view title, const std::string& name, std::string_view words, const Schema& item,
               Schema more) {
  more[name] = with_words(of_array(item), words);
  more["next_cursor"] = with_words(of_type("string", true), cursor_words);
  return of_object(title, {}, more);
}

Schema of_reference(std::string_view name) {
  return {{"$ref", std::string(name).append(".schema.json")}};
}

Schema or_null(Schema schema, bool with_reference) {
  const auto type = schema.find("type"), all = schema.find("enum");
  if (type != schema.end() && type->is_string()) *type = {*type, "null"};
  if (all != schema.end()) all->push_back(nullptr);
  if (with_reference && schema.contains("$ref"))
    return {{"anyOf", Schema::array({std::move(schema), of_type("null")})}};
  return schema;
}

Schema with_words(Schema schema, std::string_view words, const Schema& limits) {
  schema["description"] = words;
  schema.update(limits);
  return schema;
}

std::vector<FieldFault> schema_faults(const Schema& schema, const Json& document) {
  Check check(schema);
  check.value(schema, document, "");
  return std::move(check.faults);
}

}  // namespace joulecast::described

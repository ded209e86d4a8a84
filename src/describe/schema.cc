#include "describe/schema.h"

namespace joulecast::described {

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

}  // namespace

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

}  // namespace joulecast::described

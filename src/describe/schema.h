#pragma once

#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>
#include <vector>

#include "base/error.h"

// A member, a member's member, or the result of its function, as a function of an object: AT(record.id).
#define AT(path) [](auto& object) -> decltype(auto) { return (object.path); }

// Parts of JSON Schemas (2020-12), with the order of their members kept.
namespace joulecast::described {

using Schema = nlohmann::ordered_json;
using Schemas = std::vector<std::pair<std::string, Schema>>;  // by the name of NAME.schema.json

template <class T>
inline constexpr bool is_optional = false;
template <class T>
inline constexpr bool is_optional<std::optional<T>> = true;

// What an optional holds, or the type itself.
template <class T>
struct Content : std::type_identity<T> {};
template <class T>
struct Content<std::optional<T>> : std::type_identity<T> {};

// {"type": "number"}, or ["number", "null"].
Schema of_type(std::string_view type, bool or_null = false);

// The same schema, in which each number may be null, also those of members and items.
Schema with_null_numbers(Schema schema);

// An object with these members only, and of them the required ones. `title` and `words` may be empty.
Schema of_object(std::string_view title, std::string_view words, const Schema& properties,
                 const std::vector<std::string>& required);
// The same, each member required.
Schema of_object(std::string_view title, std::string_view words, const Schema& properties);

// An array of such items, with what `limits` adds.
Schema of_array(Schema items, const Schema& limits = Schema::object());

inline constexpr const char* cursor_words = "cursor of the next page; null: this is the last";
// A page of a list: the items, and the cursor of the next page. `more` are members before these.
Schema of_page(std::string_view title, const std::string& name, std::string_view words, const Schema& item,
               Schema more = Schema::object());

// A reference to NAME.schema.json.
Schema of_reference(std::string_view name);

// Also null, where the schema has a type or is an enumeration; `with_reference`: a reference too.
Schema or_null(Schema schema, bool with_reference = false);

// The schema with its description, and what `limits` adds.
Schema with_words(Schema schema, std::string_view words, const Schema& limits = Schema::object());

// Of a value that JsonWriter::value() writes. For doubles that may be null: Table::number_or_null().
template <class T>
Schema of_value(bool or_null = false) {
  if constexpr (is_optional<T>)
    return of_value<typename T::value_type>(true);
  else if constexpr (std::is_same_v<T, bool>)
    return of_type("boolean", or_null);
  else if constexpr (std::is_integral_v<T>)
    return of_type("integer", or_null);
  else if constexpr (std::is_floating_point_v<T>)
    return of_type("number", or_null);
  else
    return of_type("string", or_null);
}

// All departures of a JSON document from its schema, in the order of the schema; empty: none. Keywords of
// JSON Schema 2020-12 that are checked: $ref within the schema, type, enum, pattern, bounds of numbers and
// sizes, not with const, items, properties, required, additionalProperties, unevaluatedProperties,
// propertyNames and oneOf. Patterns must be bounded.
std::vector<FieldFault> schema_faults(const Schema& schema, const nlohmann::json& document);

}  // namespace joulecast::described

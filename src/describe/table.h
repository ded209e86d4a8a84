#pragma once

#include <cmath>
#include <functional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "base/json_writer.h"
#include "base/text.h"
#include "describe/schema.h"

namespace joulecast::described {

// The members of an object of an answer, each with its name, value and description. The writer and the JSON
// Schema follow from one table. A value is a member or a function of T; T outlives the call only.
template <class T>
class Table {
 public:
  explicit Table(std::string title = {}, std::string words = {})
      : title_(std::move(title)), words_(std::move(words)) {}

  // A schema of its own, to which others refer by `name`.
  Table& named(std::string name) {
    name_ = std::move(name);
    return *this;
  }

  // A value that JsonWriter::value() writes, null where it is an empty optional. `limits` are further members
  // of its schema, such as {"minimum", 0}.
  template <class Get>
  Table& value(std::string name, Get get, std::string_view words, const Schema& limits = Schema::object()) {
    return add(name, with_words(of_value<Of<Get>>(), words, limits),
               [name, get](JsonWriter& out, const T& object) { out.field(name, std::invoke(get, object)); });
  }
  // A double, null where it is not finite.
  template <class Get>
  Table& number_or_null(std::string name, Get get, std::string_view words,
                        const Schema& limits = Schema::object()) {
    return value(
        name, [get](const T& object) { return std::optional<double>(std::invoke(get, object)); }, words,
        limits);
  }
  // A double, left out where it is not finite, or an optional value, left out where it is empty.
  template <class Get>
  Table& known(std::string name, Get get, std::string_view words, const Schema& limits = Schema::object()) {
    if constexpr (is_optional<Of<Get>>) {
      value(
          std::move(name), [get](const T& object) { return *std::invoke(get, object); }, words, limits);
      return only([get](const T& object) { return std::invoke(get, object).has_value(); });
    } else {
      value(std::move(name), get, words, limits);
      return only([get](const T& object) { return std::isfinite(std::invoke(get, object)); });
    }
  }
  // A text, null where it is empty.
  template <class Get>
  Table& text_or_null(std::string name, Get get, std::string_view words) {
    return value(
        name,
        [get](const T& object) {
          const std::string& text = std::invoke(get, object);
          return text.empty() ? std::nullopt : std::optional(text);
        },
        words);
  }
  // As JsonWriter::time() writes it. `words` describe the microseconds.
  template <class Get>
  Table& time(const std::string& name, Get get, std::string_view words) {
    const bool or_null = is_optional<Of<Get>>;
    const std::string utime_us = name.empty() ? "utime_us" : name + "_utime_us";
    const std::string text = name.empty() ? "time" : name;
    properties_[text] = with_words(of_type("string", or_null), "as " + utime_us + ", in ISO 8601, UTC");
    required_.push_back(text);
    return add(utime_us, with_words(of_type("integer", or_null), words),
               [name, get](JsonWriter& out, const T& object) { out.time(name, std::invoke(get, object)); });
  }
  // The name of a value of an enumeration, one of `names`, which are in its order if `get` returns the value
  // itself; null where it is an empty optional.
  template <class Get, class Names>
  Table& word(std::string name, Get get, const Names& names, std::string_view words) {
    Schema all = Schema::array();
    for (const std::string_view each : names) all.push_back(each);
    if constexpr (std::is_enum_v<Of<Get>>) {
      const auto name_of =
          [get, named = std::vector<std::string_view>(std::begin(names), std::end(names))](const T& object) {
            return named.at(static_cast<std::size_t>(std::invoke(get, object)));
          };
      return value(std::move(name), name_of, words, {{"enum", std::move(all)}});
    } else {
      if (is_optional<Of<Get>>) all.push_back(nullptr);
      return value(std::move(name), get, words, {{"enum", std::move(all)}});
    }
  }
  // An array of a fixed number of doubles, null where it is an empty optional.
  template <class Get>
  Table& numbers(std::string name, Get get, std::string_view words, bool or_null = true) {
    const std::size_t size = std::tuple_size_v<typename Content<Of<Get>>::type>;
    return array(std::move(name), get, words, of_type("number", or_null),
                 {{"minItems", size}, {"maxItems", size}});
  }
  // An array of numbers with at most `places` decimals, null where they are not finite.
  template <class Get>
  Table& column(std::string name, Get get, std::string_view words, int places = 6, bool or_null = false) {
    Schema schema = of_type("array", is_optional<Of<Get>>);
    schema["items"] = of_type("number", or_null);
    return add(name, with_words(std::move(schema), words),
               [name, get, places](JsonWriter& out, const T& object) {
                 unless_absent(out, name, std::invoke(get, object),
                               [&](const auto& items) { out.column(name, items, places); });
               });
  }
  // An array of numbers as JsonWriter::value() writes them, null where they are not finite.
  template <class Get>
  Table& all_digits(std::string name, Get get, std::string_view words, bool or_null = true) {
    return array(std::move(name), get, words, of_type("number", or_null));
  }
  // An array of numbers with all digits, for raw data, null where they are not finite.
  template <class Get>
  Table& exact(std::string name, Get get, std::string_view words) {
    return add(name, with_words(of_array(of_type("number", true)), words),
               [name, get](JsonWriter& out, const T& object) {
                 write_exact(out.key(name), std::invoke(get, object));
               });
  }
  // Such arrays of both sides, [right, left].
  template <class Get>
  Table& exact_sides(std::string name, Get get, std::string_view words) {
    const Schema sides = of_array(of_array(of_type("number", true)), {{"minItems", 2}, {"maxItems", 2}});
    return add(name, with_words(sides, words), [name, get](JsonWriter& out, const T& object) {
      out.key(name).begin_array();
      for (const auto& side : std::invoke(get, object)) write_exact(out, side);
      out.end_array();
    });
  }
  // An array of texts.
  template <class Get>
  Table& texts(std::string name, Get get, std::string_view words, const Schema& limits = Schema::object()) {
    return array(std::move(name), get, words, of_type("string"), limits);
  }
  // An array of integers.
  template <class Get>
  Table& integers(std::string name, Get get, std::string_view words) {
    return array(std::move(name), get, words, of_type("integer"));
  }
  // An array of names of values of an enumeration.
  template <class Get, class Names>
  Table& words_of(std::string name, Get get, const Names& names, std::string_view words) {
    Schema all = Schema::array();
    for (const std::string_view each : names) all.push_back(each);
    return array(std::move(name), get, words, {{"enum", std::move(all)}});
  }
  // The values of a std::map or of pairs, by their names.
  template <class Get>
  Table& map(std::string name, Get get, std::string_view words, bool or_null = false) {
    using One = typename Of<Get>::value_type::second_type;
    Schema each = of_value<One>(or_null);
    if (std::is_integral_v<One>) each["minimum"] = 0;
    return add(name, with_words({{"type", "object"}, {"additionalProperties", std::move(each)}}, words),
               [name, get](JsonWriter& out, const T& object) {
                 out.key(name).begin_object();
                 for (const auto& [key, content] : std::invoke(get, object)) out.field(key, content);
                 out.end_object();
               });
  }
  // Objects of another table, each by its `key`.
  template <class Get, class Key, class Inner>
  Table& map(std::string name, Get get, std::string_view words, Key key, const Table<Inner>& table) {
    return add(name, with_words({{"type", "object"}, {"additionalProperties", table.of_member()}}, words),
               [name, get, key, &table](JsonWriter& out, const T& object) {
                 out.key(name).begin_object();
                 for (const auto& item : std::invoke(get, object))
                   table.write(out.key(std::invoke(key, item)), item);
                 out.end_object();
               });
  }
  // JSON text made elsewhere, of that schema; null where it is empty.
  template <class Get>
  Table& json(std::string name, Get get, std::string_view words, Schema schema) {
    return json(std::move(name), get, words, std::move(schema), &JsonWriter::raw);
  }
  // The same, of a text written for people.
  template <class Get>
  Table& compact_json(std::string name, Get get, std::string_view words, Schema schema) {
    return json(std::move(name), get, words, std::move(schema), &JsonWriter::compact);
  }
  // An object of another table; null where it is an empty optional or a null pointer. With `or_null` its
  // numbers may be null.
  template <class Get, class Inner>
  Table& object(std::string name, Get get, std::string_view words, const Table<Inner>& table,
                bool or_null = false) {
    constexpr bool may_be_absent = is_optional<Of<Get>> || std::is_pointer_v<Of<Get>>;
    Schema schema = or_null ? with_null_numbers(table.of_these()) : table.of_member();
    if (may_be_absent) schema = described::or_null(std::move(schema), true);
    if (!words.empty()) schema = with_words(std::move(schema), words);
    return add(name, std::move(schema), [name, get, &table](JsonWriter& out, const T& object) {
      unless_absent(out, name, std::invoke(get, object),
                    [&](const auto& inner) { table.write(out.key(name), inner); });
    });
  }
  // An array of objects of another table; null where it is an empty optional.
  template <class Get, class Inner>
  Table& list(std::string name, Get get, std::string_view words, const Table<Inner>& table,
              const Schema& limits = Schema::object()) {
    Schema schema = of_type("array", is_optional<Of<Get>>);
    schema["items"] = table.of_member();
    return add(name, with_words(std::move(schema), words, limits),
               [name, get, &table](JsonWriter& out, const T& object) {
                 unless_absent(out, name, std::invoke(get, object), [&](const auto& items) {
                   out.key(name).begin_array();
                   for (const auto& item : items) table.write(out, item);
                   out.end_array();
                 });
               });
  }
  // The last member is left out where the condition is not satisfied.
  Table& only(std::function<bool(const T&)> condition) {
    required_.pop_back();
    writers_.back() = [condition = std::move(condition), write = std::move(writers_.back())](
                          JsonWriter& out, const T& object) {
      if (condition(object)) write(out, object);
    };
    return *this;
  }
  // The last member is not in answers of earlier versions.
  Table& later() {
    required_.pop_back();
    return *this;
  }
  // A member of earlier versions, or one that is added elsewhere.
  Table& elsewhere(const std::string& name, Schema schema, std::string_view words) {
    properties_[name] = with_words(std::move(schema), words);
    return *this;
  }
  // The members of another table, in this object. With `words` their schemas are references.
  template <class Get, class Inner>
  Table& include(const Table<Inner>& table, Get get, std::string_view words = {}) {
    required_.insert(required_.end(), table.required().begin(), table.required().end());
    for (const auto& [name, schema] : table.properties().items())
      properties_[name] = words.empty() ? schema : with_words({{"$ref", "#/properties/" + name}}, words);
    writers_.push_back([get, &table](JsonWriter& out, const T& object) {
      table.write_members(out, std::invoke(get, object));
    });
    return *this;
  }

  JsonWriter& write(JsonWriter& out, const T& object) const {
    write_members(out.begin_object(), object);
    return out.end_object();
  }
  void write_members(JsonWriter& out, const T& object) const {
    for (const auto& writer : writers_) writer(out, object);
  }
  std::string text(const T& object) const {
    JsonWriter out;
    return write(out, object).take();
  }

  // The same as a document, in which doubles are doubles and ill-formed UTF-8 is replaced.
  nlohmann::ordered_json document(const T& object) const {
    using Json = nlohmann::ordered_json;
    JsonWriter out(JsonWriter::Whole::with_point);
    std::string text = write(out, object).take();
    if (!is_utf8(text)) text = Json::parse(Json(text).dump(-1, ' ', false, Json::error_handler_t::replace));
    return Json::parse(text);
  }

  const Schema& properties() const { return properties_; }
  const std::vector<std::string>& required() const { return required_; }
  Schema of_member() const { return name_.empty() ? of_these() : of_reference(name_); }
  Schema of_these() const { return of_object({}, words_, properties_, required_); }
  Schema schema() const { return of_object(title_, words_, properties_, required_); }

 private:
  template <class Get>
  Table& json(std::string name, Get get, std::string_view words, Schema schema,
              JsonWriter& (JsonWriter::*put)(std::string_view)) {
    return add(name, with_words(std::move(schema), words),
               [name, get, put](JsonWriter& out, const T& object) {
                 const std::string& text = std::invoke(get, object);
                 out.key(name);
                 text.empty() ? out.null() : (out.*put)(text);
               });
  }
  template <class Get>
  using Of = std::remove_cvref_t<std::invoke_result_t<Get, const T&>>;

  Table& add(const std::string& name, Schema schema, std::function<void(JsonWriter&, const T&)> writer) {
    properties_[name] = std::move(schema);
    required_.push_back(name);
    writers_.push_back(std::move(writer));
    return *this;
  }
  template <class Get>
  Table& array(std::string name, Get get, std::string_view words, const Schema& items,
               const Schema& limits = Schema::object()) {
    Schema schema = of_array(items, limits);
    if (is_optional<Of<Get>>) schema = described::or_null(std::move(schema));
    return add(name, with_words(std::move(schema), words), [name, get](JsonWriter& out, const T& object) {
      unless_absent(out, name, std::invoke(get, object), [&](const auto& all) { out.array(name, all); });
    });
  }
  static void write_exact(JsonWriter& out, const std::vector<double>& items) {
    out.begin_array();
    for (const double item : items) out.exact(item);
    out.end_array();
  }
  // Null for an empty optional or a null pointer.
  template <class Value, class Write>
  static void unless_absent(JsonWriter& out, const std::string& name, const Value& value, Write write) {
    if constexpr (!is_optional<Value> && !std::is_pointer_v<Value>)
      write(value);
    else if (value)
      write(*value);
    else
      out.key(name).null();
  }

  std::string title_, words_, name_;
  Schema properties_ = Schema::object();
  std::vector<std::string> required_;
  std::vector<std::function<void(JsonWriter&, const T&)>> writers_;
};

}  // namespace joulecast::described

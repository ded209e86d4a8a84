#pragma once

#include <algorithm>
#include <concepts>
#include <functional>
#include <limits>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "base/json_fields.h"
#include "base/try.h"
#include "describe/schema.h"

namespace joulecast::described {

struct Nothing {};

enum class Presence { required, optional };

// How many items an array has, and their noun in messages.
struct Count {
  std::size_t minimum = 0, maximum = 0;
  std::string_view noun = "entries";
};

// The array; null, and a fault, where it is none, has another number of items, or is absent and required.
const nlohmann::json* read_array(Fields& fields, std::string_view name, const Count& count,
                                 Presence presence);

// A whole number without a point.
Schema of_number(double value);
Schema of_bounds(const Bounds& bounds);

// A greatest value, and the member that states it.
struct Limit {
  double value = std::numeric_limits<double>::infinity();
  std::string_view member = {};
};
// "is 10, must be at most 0, limits/payload_kg of the robot file"
std::string above(double value, const Limit& limit);
// {"minItems", "maxItems"}
Schema of_count(const Count& count);

// Calls with the context of a table. One without a context is part of any other.
template <class Context, class Given, class Call>
auto in_context(Given& given, Call call) {
  if constexpr (std::derived_from<Given, Context>) {
    return call(static_cast<Context&>(given));
  } else {
    static_assert(std::is_same_v<Context, Nothing>);
    Context own;
    return call(own);
  }
}

// The members of an object of a request, in the order in which they are read. The checked reader and the JSON
// Schema follow from one table. A target is a member of T, a function that returns a reference to one, or a
// function of T and the value. A member may be absent or null if it has a default or its target is, or takes,
// a std::optional. `Context` is a further argument of the reader.
template <class T, class Context = Nothing>
class Input {
 public:
  using Read = std::function<void(Fields&, T&, Context&)>;
  using Most = std::function<Limit(const T&, const Context&)>;

  explicit Input(std::string title = {}, std::string words = {})
      : title_(std::move(title)), words_(std::move(words)) {}
  // A schema of its own, to which others refer by `name`.
  Input& named(std::string name) {
    name_ = std::move(name);
    return *this;
  }

  // `most` is the maximum where it is not a constant.
  template <class Target>
  Input& number(const char* name, Target target, const Bounds& bounds, std::string_view words,
                std::optional<double> fallback = {}, Most most = {}) {
    const auto read = [name, bounds, most](Fields& fields, const T& object, const Context& context) {
      const double value = fields.number(name, bounds);
      if (const Limit limit = most ? most(object, context) : Limit{}; value > limit.value)
        fields.fault(name, above(value, limit));
      return value;
    };
    return scalar<double>(name, target, of_bounds(bounds), words, fallback, read);
  }
  template <class Target>
  Input& integer(const char* name, Target target, std::int64_t minimum, std::int64_t maximum,
                 std::string_view words, std::optional<std::int64_t> fallback = {}) {
    return scalar<std::int64_t>(
        name, target, {{"type", "integer"}, {"minimum", minimum}, {"maximum", maximum}}, words, fallback,
        [=](Fields& fields, const T&, const Context&) { return fields.integer(name, minimum, maximum); });
  }
  template <class Target>
  Input& boolean(const char* name, Target target, std::string_view words, std::optional<bool> fallback = {}) {
    return scalar<bool>(name, target, of_type("boolean"), words, fallback,
                        [name](Fields& fields, const T&, const Context&) { return fields.boolean(name); });
  }
  template <class Target>
  Input& text(const char* name, Target target, std::size_t max_bytes, std::string_view words,
              std::optional<std::string> fallback = {}, const Schema& limits = Schema::object()) {
    Schema schema{{"type", "string"}, {"maxLength", max_bytes}};
    schema.update(limits);
    return scalar<std::string>(
        name, target, std::move(schema), words, std::move(fallback),
        [=](Fields& fields, const T&, const Context&) { return fields.text(name, max_bytes); });
  }
  // One of the names; the target is the enumerator with the index of that name.
  template <class Target, class Names>
  Input& choice(const char* name, Target target, const Names& names, std::string_view words,
                std::optional<std::size_t> fallback = {}) {
    const std::vector<std::string_view> all(std::begin(names), std::end(names));
    const auto read = [name, all](Fields& fields, const T&, const Context&) -> std::size_t {
      const std::string word = fields.choice(name, all);
      for (std::size_t k = 0; k < all.size(); ++k)
        if (all[k] == word) return k;
      return 0;
    };
    Schema schema{{"enum", all}};
    scalar<std::size_t>(name, target, std::move(schema), words, fallback, read);
    if (fallback) properties_[name]["default"] = all[*fallback];
    return *this;
  }
  // "<name>" in ISO 8601 or "<name>_utime_us"; optional. `words` describe the microseconds.
  template <class Target>
  Input& time(const std::string& name, Target target, std::string_view words) {
    const std::string in_us = name + "_utime_us";
    properties_[name] =
        with_words(of_type("string", true),
                   "a date (2026-11-22) or a time with its zone (2026-11-22T16:45:00Z), instead of " + in_us);
    properties_[in_us] = with_words(
        {{"type", {"integer", "null"}}, {"minimum", 0}, {"maximum", std::int64_t{1} << 53}}, words);
    return row(
        [=](Fields& fields, T& object, Context&) { put<std::int64_t>(target, object, fields.time(name)); });
  }
  // An array of numbers, each within the bounds.
  template <class Target>
  Input& numbers(const char* name, Target target, const Count& count, const Bounds& bounds,
                 std::string_view words, std::optional<std::vector<double>> fallback = {}) {
    return scalar<std::vector<double>>(name, target, of_array(of_bounds(bounds), of_count(count)), words,
                                       std::move(fallback), [=](Fields& fields, const T&, const Context&) {
                                         return fields.numbers(name, count.minimum, count.maximum, bounds);
                                       });
  }
  // An object of another table, Variants or OrText; optional where the target is or `presence` is.
  template <class Target, class Inner>
  Input& object(const char* name, Target target, std::string_view words, const Inner& table,
                Presence presence = Presence::required) {
    using One = typename Inner::Value;
    bool optional = presence == Presence::optional;
    if constexpr (std::is_invocable_v<Target, T&>) optional = optional || is_optional<Of<Target>>;
    member(name, table.of_member(), words, optional);
    return row([=](Fields& fields, T& object, Context& context) {
      const nlohmann::json* given = optional ? fields.member(name) : fields.required(name);
      if (given == nullptr) return;
      const auto read = [&](One& value) {
        table.nested(*given, fields.pointer(name), value, context, fields);
      };
      if constexpr (std::is_invocable_v<Target, T&, One>) {
        One value{};
        read(value);
        if (fields.ok()) std::invoke(target, object, std::move(value));
      } else if constexpr (is_optional<Of<Target>>) {
        read(std::invoke(target, object).emplace());
      } else {
        read(std::invoke(target, object));
      }
    });
  }
  // An array of objects. With a `name_of_list` its schema is that of list_schema() under this name.
  template <class Target, class Inner>
  Input& list(const char* name, Target target, const Count& count, std::string_view words, const Inner& table,
              Presence presence = Presence::required, std::string_view name_of_list = {}) {
    using One = typename Inner::Value;
    member(name, name_of_list.empty() ? list_schema(count, table) : of_reference(name_of_list), words,
           presence == Presence::optional);
    return row([=](Fields& fields, T& object, Context& context) {
      const nlohmann::json* items = read_array(fields, name, count, presence);
      for (std::size_t k = 0; items != nullptr && k < items->size() && fields.ok(); ++k) {
        One value{};
        table.nested((*items)[k], fields.pointer(name) + "/" + std::to_string(k), value, context, fields);
        if constexpr (std::is_invocable_v<Target, T&, One>)
          std::invoke(target, object, std::move(value));
        else
          std::invoke(target, object).push_back(std::move(value));
      }
    });
  }
  template <class Inner>
  static Schema list_schema(const Count& count, const Inner& table) {
    return of_array(table.of_member(), of_count(count));
  }
  // An optional member of a shape of its own.
  Input& custom(const char* name, const Schema& schema, std::string_view words, Read read) {
    member(name, schema, words, true);
    return row(std::move(read));
  }
  // The last member is of the version before.
  Input& deprecated() {
    properties_[last_]["deprecated"] = true;
    return *this;
  }
  // The members of another table, in this object.
  template <class Inner, class InnerContext, class Target>
  Input& include(const Input<Inner, InnerContext>& table, Target target) {
    properties_.update(table.properties());
    required_.insert(required_.end(), table.required().begin(), table.required().end());
    return row([table, target](Fields& fields, T& object, Context& context) {
      table.read(fields, std::invoke(target, object), context);
    });
  }
  // The members of one table where one is given that the other lacks, else those of the other.
  Input& either(const Input& with, const Input& without) {
    std::vector<std::string> own;
    for (const auto& [name, schema] : with.properties_.items())
      if (!without.properties_.contains(name)) own.push_back(name);
    properties_.update(with.properties_);
    for (const auto& [other, schema] : without.properties_.items())
      if (!properties_.contains(other)) properties_[other] = schema;
    return row([=](Fields& fields, T& object, Context& context) {
      const bool stated =
          std::ranges::any_of(own, [&](const std::string& name) { return fields.member(name) != nullptr; });
      (stated ? with : without).read(fields, object, context);
    });
  }
  // A constraint between members, of which those above are read.
  Input& check(Read check) { return row(std::move(check)); }
  // One that is checked last, if all else is valid.
  Input& finally(Read check) {
    finally_ = std::move(check);
    return *this;
  }

  template <class Given>
  void read(Fields& fields, T& object, Given& context) const {
    in_context<Context>(context, [&](Context& own) { read_rows(fields, object, own); });
  }
  // The body of a request.
  Result<T> read(const nlohmann::json& body, T object = {}, Context context = {},
                 const std::string& at = {}) const {
    Fields fields(body, at);
    TRY(finish(fields, object, context));
    return object;
  }

  using Value = T;
  template <class Given>
  void nested(const nlohmann::json& given, std::string at, T& object, Given& context, Fields& outer) const {
    Fields fields(given, std::move(at));
    Result<void> done =
        in_context<Context>(context, [&](Context& own) { return finish(fields, object, own); });
    if (!done) outer.fault(std::move(done.error()));
  }

  const Schema& properties() const { return properties_; }
  const std::vector<std::string>& required() const { return required_; }
  Schema of_member() const { return name_.empty() ? of_these({}) : of_reference(name_); }
  Schema schema() const { return of_these(title_); }

 private:
  template <class Target>
  using Of = std::remove_cvref_t<std::invoke_result_t<Target, T&>>;

  template <class X, class Target>
  static constexpr bool takes_optional() {
    if constexpr (std::is_invocable_v<Target, T&, std::optional<X>>)
      return true;
    else if constexpr (std::is_invocable_v<Target, T&, X>)
      return false;
    else
      return is_optional<Of<Target>>;
  }
  template <class X, class Target>
  static void put(const Target& target, T& object, std::optional<X> value) {
    if constexpr (std::is_invocable_v<Target, T&, std::optional<X>>) {
      std::invoke(target, object, std::move(value));
    } else if constexpr (std::is_invocable_v<Target, T&, X>) {
      if (value) std::invoke(target, object, std::move(*value));
    } else if constexpr (is_optional<Of<Target>>) {
      std::invoke(target, object) = std::move(value);
    } else if (value) {
      std::invoke(target, object) = static_cast<Of<Target>>(std::move(*value));
    }
  }

  template <class X, class Target, class ReadOne>
  Input& scalar(const char* name, Target target, Schema schema, std::string_view words,
                std::optional<X> fallback, ReadOne read) {
    const bool optional = takes_optional<X, Target>() || fallback;
    if constexpr (std::is_same_v<X, double>) {
      if (fallback) schema["default"] = of_number(*fallback);
    } else if constexpr (!std::is_same_v<X, std::size_t> && !std::is_same_v<X, std::vector<double>>) {
      if (fallback) schema["default"] = *fallback;
    }
    member(name, std::move(schema), words, optional);
    return row([=](Fields& fields, T& object, Context& context) {
      if (optional && fields.member(name) == nullptr)
        put<X>(target, object, fallback);
      else
        put<X>(target, object, read(fields, object, context));
    });
  }

  void member(const char* name, Schema schema, std::string_view words, bool optional) {
    if (optional)
      schema = or_null(std::move(schema));
    else
      required_.emplace_back(name);
    properties_[name] = words.empty() ? std::move(schema) : with_words(std::move(schema), words);
    last_ = name;
  }
  Input& row(Read read) {
    rows_.push_back(std::move(read));
    return *this;
  }
  void read_rows(Fields& fields, T& object, Context& context) const {
    for (const Read& each : rows_) each(fields, object, context);
  }
  Result<void> finish(Fields& fields, T& object, Context& context) const {
    read_rows(fields, object, context);
    TRY(fields.finish());
    if (finally_) finally_(fields, object, context);
    return fields.finish();
  }
  Schema of_these(std::string_view title) const { return of_object(title, words_, properties_, required_); }

  std::string title_, words_, name_, last_;
  Schema properties_ = Schema::object();
  std::vector<std::string> required_;
  std::vector<Read> rows_;
  Read finally_;
};

// An object of one of several forms, by the text of one member. V is a std::variant.
template <class V, class Context = Nothing>
class Variants {
 public:
  using Value = V;
  explicit Variants(const char* member) : member_(member) {}

  template <class Form, class FormContext>
  Variants& of(std::string_view name, std::string_view words, const Input<Form, FormContext>& table) {
    Schema properties{{member_, {{"const", name}, {"description", words}}}};
    properties.update(table.properties());
    std::vector<std::string> required = table.required();
    required.insert(required.begin(), member_);
    schema_["oneOf"].push_back(of_object({}, {}, properties, required));
    names_.push_back(name);
    readers_.push_back([table](Fields& fields, V& value, Context& context) {
      table.read(fields, value.template emplace<Form>(), context);
    });
    return *this;
  }

  // The first form is read where the member is at fault.
  template <class Given>
  void nested(const nlohmann::json& given, std::string at, V& value, Given& context, Fields& outer) const {
    Fields fields(given, std::move(at));
    const std::string name = fields.choice(member_, names_);
    std::size_t k = 0;
    while (k < names_.size() && names_[k] != name) ++k;
    in_context<Context>(context,
                        [&](Context& own) { readers_[k < names_.size() ? k : 0](fields, value, own); });
    if (Result<void> done = fields.finish(); !done) outer.fault(std::move(done.error()));
  }
  const Schema& of_member() const { return schema_; }

 private:
  const char* member_;
  std::vector<std::string_view> names_;
  std::vector<std::function<void(Fields&, V&, Context&)>> readers_;
  Schema schema_ = Schema::object();
};

// An object, or the text of its one required member.
template <class T, class Context = Nothing>
class OrText {
 public:
  using Value = T;
  OrText(std::string T::*text, std::string_view words, Input<T, Context> table)
      : text_(text), words_(words), table_(std::move(table)) {}

  template <class Given>
  void nested(const nlohmann::json& given, std::string at, T& object, Given& context, Fields& outer) const {
    if (given.is_string())
      object.*text_ = given.get<std::string>();
    else
      table_.nested(given, std::move(at), object, context, outer);
  }
  Schema of_member() const {
    return {{"oneOf", {with_words(of_type("string"), words_), table_.of_member()}}};
  }

 private:
  std::string T::*text_;
  std::string_view words_;
  Input<T, Context> table_;
};

}  // namespace joulecast::described

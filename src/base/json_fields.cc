#include "base/json_fields.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "base/json_text.h"
#include "base/try.h"
#include "base/utc_time.h"

namespace joulecast {

using Json = nlohmann::json;

namespace {

// The reason why the value is not a number within the bounds; empty when it is.
std::optional<std::string> fault_of_number(const Json& value, const Bounds& bounds) {
  if (!value.is_number()) return "must be a number";
  const double number = value.get<double>();
  if (!std::isfinite(number)) return "must be finite";
  if (!bounds.contain(number)) return out_of_bounds(number, bounds);
  return std::nullopt;
}

}  // namespace

Fields::Fields(const Json& object, std::string at) : object_(object), at_(std::move(at)) {
  if (!object_.is_object()) error_ = Error{Fault::invalid, at_, "must be an object"};
}

bool Fields::has(std::string_view name) const {
  if (!object_.is_object()) return false;
  const auto found = object_.find(name);
  return found != object_.end() && !found->is_null();
}

void Fields::fault(std::string_view name, std::string message) {
  fault(Error{Fault::invalid, pointer(name), std::move(message)});
}

const Json* Fields::member(std::string_view name) {
  read_.emplace(name);
  return has(name) ? &*object_.find(name) : nullptr;
}

const Json* Fields::required(std::string_view name) {
  const Json* found = member(name);
  if (found == nullptr) {
    misses_ = misses_ || ok();
    fault(name, "is required");
  }
  return found;
}

double Fields::number(std::string_view name, const Bounds& bounds) {
  const Json* found = required(name);
  if (found == nullptr) return 0;
  if (auto why = fault_of_number(*found, bounds)) {
    fault(name, std::move(*why));
    return 0;
  }
  return found->get<double>();
}

std::int64_t Fields::integer(std::string_view name, std::int64_t minimum, std::int64_t maximum) {
  const Json* found = required(name);
  if (found == nullptr) return 0;
  if (!found->is_number_integer()) {
    fault(name, "must be an integer");
    return 0;
  }
  const auto value = found->get<std::int64_t>();
  if (value < minimum || value > maximum)
    fault(name, fmt::format("is {}, must be at least {} and at most {}", value, minimum, maximum));
  return value;
}

std::optional<std::int64_t> Fields::time(std::string_view name) {
  const std::string in_us = std::string(name) + "_utime_us";
  std::optional<std::int64_t> utime_us;
  if (member(in_us) != nullptr) utime_us = integer(in_us, 0, std::int64_t{1} << 53);
  if (member(name) == nullptr) return utime_us;
  if (utime_us) fault(name, fmt::format("must not be combined with {}", in_us));
  const auto parsed = parse_utc(text(name, 64));
  if (!parsed) fault(name, fmt::format("must be {}", utc_forms));
  return parsed;
}

bool Fields::boolean(std::string_view name) {
  const Json* found = required(name);
  if (found == nullptr) return false;
  if (!found->is_boolean()) {
    fault(name, "must be true or false");
    return false;
  }
  return found->get<bool>();
}

std::string Fields::text(std::string_view name, std::size_t max_length, std::optional<std::string> fallback) {
  const Json* found = fallback ? member(name) : required(name);
  if (found == nullptr) return fallback.value_or("");
  if (!found->is_string()) {
    fault(name, "must be a text");
    return "";
  }
  std::string value = found->get<std::string>();
  if (value.size() > max_length)
    fault(name, fmt::format("has {} bytes, must have at most {}", value.size(), max_length));
  else if (value.find('\0') != std::string::npos)
    fault(name, "must not contain a NUL character");
  return value;
}

std::string Fields::choice(std::string_view name, const std::vector<std::string_view>& words) {
  std::string value = text(name, 256);
  if (ok() && std::ranges::find(words, value) == words.end())
    fault(name, fmt::format("is \"{}\", must be one of {}", value, fmt::join(words, ", ")));
  return value;
}

std::vector<double> Fields::numbers(std::string_view name, std::size_t minimum, std::size_t maximum,
                                    const Bounds& bounds) {
  const Json* found = required(name);
  std::vector<double> values;
  if (found == nullptr) return values;
  if (!found->is_array() || found->size() < minimum || found->size() > maximum) {
    fault(name, fmt::format("must be an array of {} to {} numbers", minimum, maximum));
    return values;
  }
  values.reserve(found->size());
  for (std::size_t k = 0; k < found->size(); ++k) {
    const Json& item = (*found)[k];
    if (auto why = fault_of_number(item, bounds)) {
      fault(fmt::format("{}/{}", name, k), std::move(*why));
      return values;
    }
    values.push_back(item.get<double>());
  }
  return values;
}

std::vector<std::string> Fields::unknown() const {
  std::vector<std::string> names;
  if (!object_.is_object()) return names;
  for (const auto& [name, content] : object_.items())
    if (!read_.contains(name)) names.push_back(name);
  return names;
}

Result<void> Fields::finish() {
  if (!error_) {
    if (const auto names = unknown(); !names.empty()) {
      // RFC 6901
      std::string escaped;
      for (const char c : names.front()) escaped += c == '~' ? "~0" : c == '/' ? "~1" : std::string(1, c);
      fault(escaped, "is an unknown field");
    }
  } else if (misses_) {
    if (const auto names = unknown(); !names.empty())
      error_->message += fmt::format("; unknown here: {}", fmt::join(names, ", "));
  }
  if (error_) return tl::unexpected(*error_);
  return {};
}

Result<Json> read_list(std::string_view json_text, const std::string& member) {
  TRY_ASSIGN(const auto document, parse_json(json_text));
  if (!document.is_object()) return invalid("", "must be an object with the member " + member);
  Fields fields(document);
  const Json* list = fields.required(member);
  if (list != nullptr && !list->is_array()) fields.fault(member, "must be an array");
  TRY(fields.finish());
  return *list;
}

}  // namespace joulecast

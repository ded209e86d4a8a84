#pragma once

#include <cmath>
#include <nlohmann/json.hpp>

#include "base/json_writer.h"

namespace joulecast {

// A number that may be unknown: null where it is not finite. For .cc files; headers take json_fwd.hpp.
inline nlohmann::json json_number(double value) {
  return std::isfinite(value) ? nlohmann::json(resolved(value)) : nlohmann::json(nullptr);
}

// The text of a document, in which bytes that are no UTF-8 are replaced.
template <class Json>
std::string json_text(const Json& document) {
  return document.dump(-1, ' ', false, Json::error_handler_t::replace);
}

// The number that a value is; NaN for any other value.
inline double number_or_nan(const nlohmann::json& value) {
  return value.is_number() ? value.get<double>() : std::nan("");
}

// The number that a member is; NaN where it is missing or no number.
inline double number_at(const nlohmann::json& object, const char* name) {
  const auto found = object.find(name);
  return found != object.end() ? number_or_nan(*found) : std::nan("");
}

}  // namespace joulecast

#pragma once

#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <set>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "base/bounds.h"
#include "base/error.h"

namespace joulecast {

// Reads one JSON object of a request, field by field, and keeps the first fault: the JSON pointer of the
// field and the constraint that it broke. A null counts as absent. finish() also rejects keys that were not
// read, and lists them together with a missing required one: often one is a misspelling of the other.
class Fields {
 public:
  // `at` is the pointer of the object itself, "" for the whole body.
  explicit Fields(const nlohmann::json& object, std::string at = "");

  double number(std::string_view name, const Bounds& bounds);
  std::int64_t integer(std::string_view name, std::int64_t minimum, std::int64_t maximum);
  // "<name>" in ISO 8601 (base/utc_time.h), or "<name>_utime_us", microseconds since 1970; not both.
  std::optional<std::int64_t> time(std::string_view name);
  bool boolean(std::string_view name);
  std::string text(std::string_view name, std::size_t max_length,
                   std::optional<std::string> fallback = std::nullopt);
  // One of the words; the fault lists them.
  std::string choice(std::string_view name, const std::vector<std::string_view>& words);
  // Numbers of an array, each within the bounds, `minimum` to `maximum` of them.
  std::vector<double> numbers(std::string_view name, std::size_t minimum, std::size_t maximum,
                              const Bounds& bounds);
  // A member for the caller to read; null when absent.
  const nlohmann::json* member(std::string_view name);
  // A required one; null, and a fault, when absent.
  const nlohmann::json* required(std::string_view name);

  bool has(std::string_view name) const;
  std::string pointer(std::string_view name) const { return at_ + "/" + std::string(name); }
  void fault(std::string_view name, std::string message);
  // For constraints between fields, or found by a nested reader.
  void fault(Error error) {
    if (!error_) error_ = std::move(error);
  }
  bool ok() const { return !error_.has_value(); }

  Result<void> finish();

 private:
  std::vector<std::string> unknown() const;

  const nlohmann::json& object_;
  std::string at_;
  std::set<std::string, std::less<>> read_;
  std::optional<Error> error_;
  bool misses_ = false;  // error_ is a required member of this object
};

// The array that is the one member of a document: {"tokens": [...]}.
Result<nlohmann::json> read_list(std::string_view json_text, const std::string& member);

}  // namespace joulecast

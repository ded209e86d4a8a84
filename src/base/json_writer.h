#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <variant>

namespace joulecast {

// Numbers of answers nearer to 0 than this are 0: in SI units no quantity and no probability of the service
// is this accurate, and the remainder of a far tail (1e-223) looks like a value.
inline constexpr double answer_resolution = 1e-18;

constexpr double resolved(double value) {
  return value < answer_resolution && value > -answer_resolution ? 0.0 : value;
}

// Writes JSON text front to back. Doubles that are not finite become null, so that "not measured" is never a
// number. Several times faster than building a document first, which long series need.
class JsonWriter {
 public:
  // Whether a whole double is written as 2 or as 2.0, which readers take for a double again.
  enum class Whole { without_point, with_point };
  explicit JsonWriter(Whole whole = Whole::without_point) : whole_(whole) {}

  JsonWriter& begin_object() { return begin('{'); }
  JsonWriter& end_object() { return end('}'); }
  JsonWriter& begin_array() { return begin('['); }
  JsonWriter& end_array() { return end(']'); }
  JsonWriter& key(std::string_view name);

  // resolved(), in the shortest text that reads back
  JsonWriter& value(double number) { return exact(resolved(number)); }
  JsonWriter& exact(double number);  // as it is, for evidence: the text reads back as the same double
  JsonWriter& value(std::int64_t number);
  JsonWriter& value(std::uint64_t number);
  JsonWriter& value(int number) { return value(static_cast<std::int64_t>(number)); }
  JsonWriter& value(bool truth) { return raw(truth ? "true" : "false"); }
  JsonWriter& value(std::string_view text);
  JsonWriter& value(const char* text) { return value(std::string_view(text)); }
  JsonWriter& value(const std::string& text) { return value(std::string_view(text)); }
  JsonWriter& value(const std::variant<double, std::string>& either) {
    return std::visit([this](const auto& one) -> JsonWriter& { return value(one); }, either);
  }
  JsonWriter& null() { return raw("null"); }
  // JSON text made elsewhere.
  JsonWriter& raw(std::string_view text);
  // JSON text written for people: without the space between its parts.
  JsonWriter& compact(std::string_view text);

  template <class T>
  JsonWriter& field(std::string_view name, const T& content) {
    key(name);
    return value(content);
  }
  template <class T>
  JsonWriter& field(std::string_view name, const std::optional<T>& content) {
    key(name);
    return content ? value(*content) : null();
  }
  // A time for people and for programs: "<name>" in ISO 8601 and "<name>_utime_us", or "time" and "utime_us"
  // for an empty name; both null for an absent time.
  JsonWriter& time(std::string_view name, std::optional<std::int64_t> utime_us);
  // An array of values that value() accepts.
  template <class Range>
  JsonWriter& array(std::string_view name, const Range& items) {
    key(name).begin_array();
    for (const auto& item : items) value(item);
    return end_array();
  }

  // An array of numbers rounded to `places` decimals: series in which the digits behind are noise.
  JsonWriter& column(std::string_view name, std::span<const double> numbers, int places = 6);

  std::string take() { return std::move(text_); }
  const std::string& text() const { return text_; }

 private:
  void separate();
  JsonWriter& begin(char bracket);
  JsonWriter& end(char bracket);

  std::string text_;
  Whole whole_;
  bool comma_ = false;
};

}  // namespace joulecast

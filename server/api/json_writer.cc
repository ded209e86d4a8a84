#include "server/api/json_writer.h"

#include <array>
#include <charconv>
#include <cmath>

namespace joulecast::api {
namespace {

constexpr std::array<double, 13> powers = {1e0, 1e1, 1e2, 1e3,  1e4,  1e5, 1e6,
                                           1e7, 1e8, 1e9, 1e10, 1e11, 1e12};

template <class Number>
void append_number(std::string& text, Number number) {
  std::array<char, 32> buffer{};
  const auto [end, fault] = std::to_chars(buffer.data(), buffer.data() + buffer.size(), number);
  text.append(buffer.data(), end);
}

}  // namespace

void JsonWriter::separate() {
  if (comma_) text_ += ',';
  comma_ = true;
}

JsonWriter& JsonWriter::begin_object() {
  separate();
  text_ += '{';
  comma_ = false;
  return *this;
}

JsonWriter& JsonWriter::end_object() {
  text_ += '}';
  comma_ = true;
  return *this;
}

JsonWriter& JsonWriter::begin_array() {
  separate();
  text_ += '[';
  comma_ = false;
  return *this;
}

JsonWriter& JsonWriter::end_array() {
  text_ += ']';
  comma_ = true;
  return *this;
}

JsonWriter& JsonWriter::key(std::string_view name) {
  value(name);
  text_ += ':';
  comma_ = false;
  return *this;
}

JsonWriter& JsonWriter::value(double number) {
  if (!std::isfinite(number)) return null();
  separate();
  append_number(text_, number);
  return *this;
}

JsonWriter& JsonWriter::value(std::int64_t number) {
  separate();
  append_number(text_, number);
  return *this;
}

JsonWriter& JsonWriter::value(std::uint64_t number) {
  separate();
  append_number(text_, number);
  return *this;
}

JsonWriter& JsonWriter::value(bool truth) {
  separate();
  text_ += truth ? "true" : "false";
  return *this;
}

JsonWriter& JsonWriter::null() {
  separate();
  text_ += "null";
  return *this;
}

JsonWriter& JsonWriter::raw(std::string_view json) {
  separate();
  text_ += json;
  return *this;
}

JsonWriter& JsonWriter::value(std::string_view text) {
  separate();
  text_ += '"';
  for (const char c : text) {
    const auto byte = static_cast<unsigned char>(c);
    if (c == '"' || c == '\\') {
      text_ += '\\';
      text_ += c;
    } else if (byte < 0x20) {
      constexpr std::string_view hex = "0123456789abcdef";
      text_ += "\\u00";
      text_ += hex[byte >> 4];
      text_ += hex[byte & 15];
    } else {
      text_ += c;
    }
  }
  text_ += '"';
  return *this;
}

void JsonWriter::rounded(double number, double scale, int places) {
  const double scaled = number * scale;
  constexpr double exact = 9e15;  // integers below are exact doubles
  if (!(std::fabs(scaled) < exact)) {
    std::isfinite(number) ? value(number) : null();
    return;
  }
  separate();
  auto integer = static_cast<std::int64_t>(std::nearbyint(scaled));
  if (integer < 0) {
    text_ += '-';
    integer = -integer;
  }
  std::array<char, 24> digits{};
  const auto [end, fault] = std::to_chars(digits.data(), digits.data() + digits.size(), integer);
  const auto count = static_cast<int>(end - digits.data());
  const int whole = count - places;
  if (whole <= 0) {
    text_ += '0';
  } else {
    text_.append(digits.data(), static_cast<std::size_t>(whole));
  }
  std::array<char, 24> fraction{};
  int length = places;
  for (int k = 0; k < places; ++k)
    fraction[static_cast<std::size_t>(k)] = whole + k < 0 ? '0' : digits[static_cast<std::size_t>(whole + k)];
  while (length > 0 && fraction[static_cast<std::size_t>(length - 1)] == '0') --length;
  if (length > 0) {
    text_ += '.';
    text_.append(fraction.data(), static_cast<std::size_t>(length));
  }
}

JsonWriter& JsonWriter::column(std::string_view name, std::span<const double> numbers, int places) {
  key(name);
  begin_array();
  text_.reserve(text_.size() + numbers.size() * 10);
  const double scale = powers[static_cast<std::size_t>(places)];
  for (const double number : numbers) rounded(number, scale, places);
  return end_array();
}

}  // namespace joulecast::api

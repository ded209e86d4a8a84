#include "base/json_writer.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <cmath>

#include "base/utc_time.h"

namespace joulecast {
namespace {

constexpr std::array<double, 13> powers = {1e0, 1e1, 1e2, 1e3,  1e4,  1e5, 1e6,
                                           1e7, 1e8, 1e9, 1e10, 1e11, 1e12};

template <class Number>
void append_number(std::string& text, Number number) {
  std::array<char, 32> buffer{};
  const auto [end, fault] = std::to_chars(buffer.data(), buffer.data() + buffer.size(), number);
  text.append(buffer.data(), end);
}

// Writes `number` with at most `places` digits after the point and returns the end; at most 31 characters.
char* put_rounded(char* at, double number, double scale, int places) {
  const double scaled = number * scale;
  constexpr double exact = 9e15;  // integers below are exact doubles
  if (!(std::fabs(scaled) < exact)) {
    if (std::isfinite(number)) return std::to_chars(at, at + 31, number).ptr;
    return std::copy_n("null", 4, at);
  }
  auto integer = static_cast<std::int64_t>(std::nearbyint(scaled));
  if (integer == 0) {
    *at++ = '0';
    return at;
  }
  if (integer < 0) {
    *at++ = '-';
    integer = -integer;
  }
  for (; places > 0 && integer % 10 == 0; --places) integer /= 10;
  std::array<char, 24> digits;
  char* end = std::to_chars(digits.data(), digits.data() + digits.size(), integer).ptr;
  const auto count = static_cast<int>(end - digits.data()), whole = count - places;
  if (whole > 0) {
    at = std::copy_n(digits.data(), whole, at);
    if (places > 0) *at++ = '.';
    return std::copy(digits.data() + whole, end, at);
  }
  *at++ = '0';
  *at++ = '.';
  at = std::fill_n(at, -whole, '0');
  return std::copy(digits.data(), end, at);
}

}  // namespace

void JsonWriter::separate() {
  if (comma_) text_ += ',';
  comma_ = true;
}

JsonWriter& JsonWriter::begin(char bracket) {
  separate();
  text_ += bracket;
  comma_ = false;
  return *this;
}

JsonWriter& JsonWriter::end(char bracket) {
  text_ += bracket;
  comma_ = true;
  return *this;
}

JsonWriter& JsonWriter::key(std::string_view name) {
  value(name);
  text_ += ':';
  comma_ = false;
  return *this;
}

JsonWriter& JsonWriter::time(std::string_view name, std::optional<std::int64_t> utime_us) {
  key(name.empty() ? "time" : name);
  utime_us ? value(utc_text(*utime_us)) : null();
  return field(name.empty() ? "utime_us" : std::string(name) + "_utime_us", utime_us);
}

JsonWriter& JsonWriter::exact(double number) {
  if (!std::isfinite(number)) return null();
  separate();
  const std::size_t begin = text_.size();
  append_number(text_, number);
  if (whole_ == Whole::with_point && text_.find_first_of(".e", begin) == std::string::npos) text_ += ".0";
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

JsonWriter& JsonWriter::raw(std::string_view text) {
  separate();
  text_ += text;
  return *this;
}

JsonWriter& JsonWriter::compact(std::string_view text) {
  separate();
  bool quoted = false, escaped = false;
  for (const char c : text) {
    const bool space = c == ' ' || c == '\n' || c == '\t' || c == '\r';
    if (space && !quoted) continue;
    text_ += c;
    if (c == '"' && !escaped) quoted = !quoted;
    escaped = quoted && c == '\\' && !escaped;
  }
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

JsonWriter& JsonWriter::column(std::string_view name, std::span<const double> numbers, int places) {
  key(name);
  begin_array();
  const double scale = powers[static_cast<std::size_t>(places)];
  constexpr std::size_t longest = 32;  // of one number and its comma
  const std::size_t before = text_.size();
  text_.resize(before + numbers.size() * longest);
  char* at = text_.data() + before;
  for (const double number : numbers) {
    if (comma_) *at++ = ',';
    comma_ = true;
    at = put_rounded(at, number, scale, places);
  }
  text_.resize(static_cast<std::size_t>(at - text_.data()));
  return end_array();
}

}  // namespace joulecast

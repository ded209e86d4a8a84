#pragma once

#include <algorithm>
#include <charconv>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "base/error.h"
#include "base/text.h"

// Text of the HTTP frame and the settings: words, lists, numbers, targets of requests.
namespace joulecast::http {

constexpr char lower(char c) {
  return c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c;
}

constexpr bool equals_ignoring_case(std::string_view a, std::string_view b) {
  return std::ranges::equal(a, b, {}, lower, lower);
}

// The items between commas, without empty ones.
inline std::vector<std::string> listed(std::string_view text) {
  std::vector<std::string> items;
  while (!text.empty())
    if (const auto item = take_item(text, ','); !item.empty()) items.emplace_back(item);
  return items;
}

// Whether a header's list ("gzip, br;q=0") admits an item: the list contains it or "*", without q=0. Weak
// validators (W/"x") count as strong ones.
inline bool lists(std::string_view header, std::string_view wanted) {
  bool by_star = false;
  while (!header.empty()) {
    std::string_view item = trimmed(take_item(header, ','));
    const auto semicolon = item.find(';');
    const bool refused = semicolon != std::string_view::npos &&
                         item.substr(semicolon).find("q=0") != std::string_view::npos &&
                         item.substr(semicolon).find_first_of("123456789") == std::string_view::npos;
    item = trimmed(item.substr(0, semicolon));
    if (item.starts_with("W/")) item.remove_prefix(2);
    if (equals_ignoring_case(item, wanted)) return !refused;
    if (item == "*" && !refused) by_star = true;
  }
  return by_star;
}

// Shortest text that reads back as the same number.
inline std::string number_text(double value) {
  char buffer[32];
  const auto [end, code] = std::to_chars(buffer, buffer + sizeof buffer, value);
  return code == std::errc{} ? std::string(buffer, end) : std::string("?");
}

// Significant digits of the numbers in answers: a micrometre in ten kilometres, a tenth of a millijoule in a
// megajoule, and finer than any sensor. A double has 17.
inline constexpr int usual_digits = 10;
inline constexpr int all_digits = 17;

// The JSON text, or number, with its numbers that have a fraction or an exponent rounded to at most `digits`
// significant ones, half away from zero; digits before the point stay. Integers, text and the text's layout
// stay as they are.
std::string rounded(std::string json, int digits = usual_digits);

struct Target {
  std::vector<std::string> segments;  // of the path, decoded one by one: "%2F" stays inside its segment
  std::vector<std::pair<std::string, std::string>> query;
};

// Splits the origin form "/a/b?x=1" of a request target; a fragment is an error, like a repeated query key.
// The absolute form is accepted, its authority ignored. Errors name the offending key or segment.
Result<Target> parse_target(std::string_view target);

}  // namespace joulecast::http

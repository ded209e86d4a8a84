#pragma once

#include <algorithm>
#include <charconv>
#include <cmath>
#include <optional>
#include <string>
#include <string_view>
#include <type_traits>
#include <vector>

// Small pieces of text work shared by the HTTP frame and the settings.
namespace joulecast::http {

constexpr char lower(char c) {
  return c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c;
}

constexpr bool equals_ignoring_case(std::string_view a, std::string_view b) {
  return std::ranges::equal(a, b, {}, lower, lower);
}

constexpr std::string_view trim(std::string_view text) {
  while (!text.empty() && (text.front() == ' ' || text.front() == '\t')) text.remove_prefix(1);
  while (!text.empty() && (text.back() == ' ' || text.back() == '\t')) text.remove_suffix(1);
  return text;
}

// Takes the text before the first separator, or all of it, and the separator from the beginning of a list.
inline std::string_view take_item(std::string_view& list, char separator) {
  const std::string_view item = list.substr(0, list.find(separator));
  list.remove_prefix(std::min(list.size(), item.size() + 1));
  return item;
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
    std::string_view item = trim(take_item(header, ','));
    const auto semicolon = item.find(';');
    const bool refused = semicolon != std::string_view::npos &&
                         item.substr(semicolon).find("q=0") != std::string_view::npos &&
                         item.substr(semicolon).find_first_of("123456789") == std::string_view::npos;
    item = trim(item.substr(0, semicolon));
    if (item.starts_with("W/")) item.remove_prefix(2);
    if (equals_ignoring_case(item, wanted)) return !refused;
    if (item == "*" && !refused) by_star = true;
  }
  return by_star;
}

// The whole text as one finite number, independent of the locale; nullopt otherwise.
template <class T>
std::optional<T> parse_number(std::string_view text) {
  T value{};
  const auto [end, code] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (code != std::errc{} || end != text.data() + text.size() || text.empty()) return std::nullopt;
  if constexpr (std::is_floating_point_v<T>)
    if (!std::isfinite(value)) return std::nullopt;
  return value;
}

// Shortest text that reads back as the same number.
inline std::string number_text(double value) {
  char buffer[32];
  const auto [end, code] = std::to_chars(buffer, buffer + sizeof buffer, value);
  return code == std::errc{} ? std::string(buffer, end) : std::string("?");
}

}  // namespace joulecast::http

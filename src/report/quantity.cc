#include "report/quantity.h"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <cmath>
#include <numbers>
#include <utility>

#include "gap/verdict/words.h"

namespace joulecast::report {

using namespace gap;

namespace {

constexpr std::string_view unknown = "–";

constexpr auto degrees = std::to_array<std::pair<std::string_view, std::string_view>>(
    {{"rad", "°"}, {"rad/s", "°/s"}, {"rad/s²", "°/s²"}, {"rad/s^2", "°/s²"}});

// Ends of names that state a unit; the longer ones first, as "rad_s" ends in "_s".
constexpr auto units = std::to_array<std::pair<std::string_view, std::string_view>>({{"_rad_s", "rad/s"},
                                                                                     {"_m_s2", "m/s²"},
                                                                                     {"_m_s", "m/s"},
                                                                                     {"_rad", "rad"},
                                                                                     {"_kg", "kg"},
                                                                                     {"_m", "m"},
                                                                                     {"_s", "s"}});

std::string spaced(std::string_view unit) {
  return unit.empty() || unit == "1" ? std::string() : fmt::format(" {}", unit);
}

}  // namespace

std::string_view degrees_of(std::string_view unit) {
  const auto* found = std::ranges::find(degrees, unit, &decltype(degrees)::value_type::first);
  return found == degrees.end() ? std::string_view() : found->second;
}

double in_degrees(double radians) {
  return radians * 180 / std::numbers::pi;
}

std::string_view unit_of(std::string_view name) {
  for (const auto& [end, unit] : units) {
    if (name.ends_with(end)) return unit;
  }
  return {};
}

std::string_view without_unit(std::string_view name) {
  for (const auto& [end, unit] : units) {
    if (name.ends_with(end)) return name.substr(0, name.size() - end.size());
  }
  return name;
}

std::string quantity(double value, double deviation, std::string_view unit) {
  if (!std::isfinite(value)) return std::string(unknown);
  std::string text = with_deviation(value, deviation, unit);
  if (const std::string_view sign = degrees_of(unit); !sign.empty())
    text += fmt::format(" ({}{})", with_deviation(in_degrees(value), in_degrees(deviation), ""), sign);
  return text;
}

std::string quantity(double value, std::string_view unit) {
  return quantity(value, 0, unit);
}

std::string quantity_range(double from, double to, std::string_view unit) {
  if (!std::isfinite(from + to)) return std::string(unknown);
  std::string text = brief_range(from, to) + spaced(unit);
  if (const std::string_view sign = degrees_of(unit); !sign.empty())
    text += fmt::format(" ({}{})", brief_range(in_degrees(from), in_degrees(to)), sign);
  return text;
}

std::string share_text(double fraction) {
  return std::isfinite(fraction) ? percent(fraction) : std::string(unknown);
}

std::string share_text(double fraction, const std::array<double, 2>& interval) {
  if (!std::isfinite(interval[0] + interval[1])) return share_text(fraction);
  return fmt::format("{} [{}, {}]", share_text(fraction), percent(interval[0]), percent(interval[1]));
}

std::string chance_text(double probability) {
  return std::isfinite(probability) ? probability_text(probability) : std::string(unknown);
}

std::string count_text(std::size_t count, std::string_view noun) {
  return fmt::format("{} {}{}", count, noun, count == 1 ? "" : "s");
}

std::string capital(std::string text) {
  if (!text.empty()) text.front() = static_cast<char>(std::toupper(static_cast<unsigned char>(text.front())));
  return text;
}

}  // namespace joulecast::report

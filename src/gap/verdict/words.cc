#include "gap/verdict/words.h"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <cmath>

namespace joulecast::gap {

std::string brief(double value, int digits) {
  if (!std::isfinite(value)) return "–";
  const double size = std::fabs(value);
  if (size != 0 && (size < 1e-4 || size >= 1e7)) return fmt::format("{:.{}e}", value, digits - 1);
  const int before = size < 1e-12 ? 1 : static_cast<int>(std::floor(std::log10(size))) + 1;
  std::string text = fmt::format("{:.{}f}", value, std::clamp(digits - before, 0, 8));
  if (text.find('.') != std::string::npos) {
    text.erase(text.find_last_not_of('0') + 1);
    if (text.back() == '.') text.pop_back();
  }
  if (text == "-0") text = "0";
  if (text.front() == '-') text.replace(0, 1, "−");
  return text;
}

std::string brief_range(double low, double high) {
  const double width = std::fabs(high - low);
  const int places = width > 0 ? std::clamp(1 - static_cast<int>(std::floor(std::log10(width))), 0, 6) : 3;
  const auto end = [&](double value) {
    std::string text = fmt::format("{:.{}f}", value, places);
    if (text.front() == '-')
      text = text.find_first_not_of("-0.") == std::string::npos ? text.substr(1) : "−" + text.substr(1);
    return text;
  };
  return end(low) + " to " + end(high);
}

std::string words_of(std::string_view id) {
  constexpr std::string_view outside = "outside:", covariate = "covariate:";
  if (id.starts_with(outside)) return "something unknown that follows " + words_of(id.substr(outside.size()));
  if (id.starts_with(covariate)) return "the covariate " + words_of(id.substr(covariate.size()));
  std::string words(id);
  std::ranges::replace(words, '_', ' ');
  return words;
}

int places_of(double deviation) {
  return std::clamp(1 - static_cast<int>(std::floor(std::log10(deviation))), 0, 6);
}

std::string with_deviation(double value, double deviation, std::string_view unit) {
  std::string text;
  if (std::isfinite(deviation) && deviation > 0) {
    const int places = places_of(deviation);
    text = fmt::format("{:.{}f} ± {:.{}f}", value, places, deviation, places);
    if (text.front() == '-') text.replace(0, 1, "−");
  } else {
    text = brief(value);
  }
  if (unit != "1" && !unit.empty()) text += fmt::format(" {}", unit);
  return text;
}

std::string percent(double fraction, int digits) {
  if (!std::isfinite(fraction)) return brief(fraction);
  return brief(100 * fraction, digits) + "\u00a0%";
}

std::string probability_text(double p) {
  if (p > 0.97) return "> 97\u00a0%";
  if (p < 0.005) return "< 1\u00a0%";
  return percent(std::round(100 * p) / 100);
}

std::string enumerate(std::span<const std::string> items, std::string_view last) {
  std::string text;
  for (std::size_t k = 0; k < items.size(); ++k) {
    if (k > 0) text += k + 1 == items.size() ? fmt::format(" {} ", last) : ", ";
    text += items[k];
  }
  return text;
}

std::string sentence(std::string text) {
  text.front() = static_cast<char>(std::toupper(static_cast<unsigned char>(text.front())));
  return text + '.';
}

}  // namespace joulecast::gap

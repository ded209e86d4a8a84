#include "base/json_hint.h"

#include <algorithm>
#include <array>

namespace joulecast {

std::string not_finite_hint(std::string_view text, std::size_t byte) {
  constexpr std::array<std::string_view, 3> words{"nan", "infinity", "inf"};
  constexpr std::size_t furthest = 2;  // a parser that takes it for "null" notices a letter later
  const auto lower = [](char c) { return c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c; };
  for (std::size_t back = 1; back <= furthest && back <= byte; ++back) {
    for (const std::string_view word : words) {
      if (byte - back > text.size()) continue;
      const std::string_view here = text.substr(byte - back, word.size());
      if (here.size() < word.size() ||
          !std::equal(word.begin(), word.end(), here.begin(), [&](char a, char b) { return a == lower(b); }))
        continue;
      return "; JSON has no " + std::string(word == "nan" ? "NaN" : "Infinity") +
             ": write null for an unknown number, or leave it out";
    }
  }
  return {};
}

}  // namespace joulecast

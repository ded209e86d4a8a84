#pragma once

#include <functional>
#include <string>
#include <string_view>
#include <vector>

namespace joulecast {

// "; did you mean X?" with the candidate nearest to a misspelt word by edits; empty when none is near enough.
std::string did_you_mean(std::string_view word, const std::vector<std::string>& candidates);

// The same among named items.
template <class Range, class Name>
std::string did_you_mean(std::string_view word, const Range& known, Name name) {
  std::vector<std::string> names;
  for (const auto& each : known) names.emplace_back(std::invoke(name, each));
  return did_you_mean(word, names);
}

}  // namespace joulecast

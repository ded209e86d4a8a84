#pragma once

#include <CLI/CLI.hpp>
#include <string>
#include <utility>
#include <vector>

namespace joulecast::client {

// Checks of an option's value. Each is described as the help prints it, "{a,b}" or "0 to 1" (value_kind()),
// and refuses with that description.

[[nodiscard]] CLI::Validator one_of(const std::vector<std::string>& words);

// Both ends included.
[[nodiscard]] CLI::Validator between(double least, double most);
[[nodiscard]] CLI::Validator positive();
[[nodiscard]] CLI::Validator not_negative();

// Accepts the names of an enumeration's values.
template <class T>
[[nodiscard]] CLI::Validator one_of(const std::vector<std::pair<std::string, T>>& values) {
  std::vector<std::string> words;
  for (const auto& [word, value] : values) words.push_back(word);
  const CLI::Validator known = one_of(words);
  return {[known, values](std::string& text) {
            std::string wrong = known(std::as_const(text));
            for (const auto& [word, value] : values)
              if (wrong.empty() && word == text) {
                text = std::to_string(static_cast<int>(value));
                break;
              }
            return wrong;
          },
          known.get_description()};
}

}  // namespace joulecast::client

#pragma once

#include <array>
#include <cstddef>
#include <nlohmann/json_fwd.hpp>
#include <string>

namespace joulecast::trial {

// Hits of a number of tries.
struct Rate {
  std::size_t hits = 0, tries = 0;

  void count(bool hit) {
    hits += hit ? 1 : 0;
    ++tries;
  }
  double value() const { return tries > 0 ? static_cast<double>(hits) / static_cast<double>(tries) : 0; }
  // 95 % interval (Wilson 1927); [0, 1] without a try.
  std::array<double, 2> interval() const;
};

// "18/20 90 % [70, 97]", the interval being Wilson's; "-" without a try.
[[nodiscard]] std::string rate_text(const Rate& rate);
[[nodiscard]] nlohmann::json rate_json(const Rate& rate);

// Stated probabilities of one range, against how often they came true.
struct ReliabilityBin {
  double sum = 0;  // of the probabilities stated
  Rate right;
  double mean() const { return right.tries > 0 ? sum / static_cast<double>(right.tries) : 0; }
};

}  // namespace joulecast::trial

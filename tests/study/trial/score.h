#pragma once

#include <array>
#include <cstddef>
#include <map>
#include <span>
#include <string>
#include <vector>

#include "tests/study/trial/outcome.h"
#include "tests/study/trial/rate.h"

namespace joulecast::trial {

inline constexpr std::size_t strength_classes = 4;

// Held-out shrinkage compared with that of the true effects: sum over sum, and the number of cases that reach
// the share required for their strength.
struct ShrinkageScore {
  double diagnosed = 0, oracle = 0;
  Rate reached;
  double ratio() const { return oracle > 0 ? diagnosed / oracle : 0; }
};

// The yardsticks, by strength of the weakest effect in a case.
struct StrengthRow {
  Rate single_first, single_exact;
  Rate pair_exact, pair_first;
  Rate strength_close;   // named effects with a strength within 10 % or a 95 % interval that contains the
                         // truth
  Rate strength_within;  // within 10 %
  Rate interval_covers;  // 95 % interval holds the truth
  ShrinkageScore shrinkage;
};

struct VariantRow {
  Rate with, without;  // exactly right, in cases with that variant and in cases without any
};

struct Score {
  // [0] with motor channels, [1] without
  std::array<std::array<StrengthRow, strength_classes>, 2> rows;
  Rate not_this_robot;  // that verdict, in all cases
  Rate none_alarm;      // verdict "effects", "outside" or "not_this_robot"
  Rate none_inconclusive;
  Rate outside_called;                                 // "outside" or "inconclusive"
  Rate outside_misled;                                 // a name with a probability above 0.9
  std::array<ReliabilityBin, 10> effect_reliability;   // probability of a named effect; right: it is there
  std::array<ReliabilityBin, 10> verdict_reliability;  // probability of a verdict; right: as exactly_right
  std::map<std::string, std::map<std::string, std::size_t>> confusion;  // truth -> answer -> cases
  std::map<std::string, VariantRow> variants;
  double median_s = 0, longest_s = 0;
};

// One way of judging, over the cases with effects of 2 % of the gap and more.
struct ComparisonRow {
  std::string name;
  Rate none_clear;  // no gap: nothing reported
  Rate single_exact, single_first, pair_exact, outside_called;
  double shrinkage_over_oracle = 0;
};

// The method first, then the other methods.
[[nodiscard]] std::vector<ComparisonRow> compare(std::span<const CaseOutcome> outcomes);

[[nodiscard]] Score score_of(std::span<const CaseOutcome> outcomes);

}  // namespace joulecast::trial

#pragma once

#include <array>
#include <cstddef>
#include <map>
#include <span>
#include <string>

#include "tests/study/trial/motion/motion_run.h"
#include "tests/study/trial/rate.h"

namespace joulecast::trial::motion {

inline constexpr double confident = 0.9;
inline constexpr double named_from =
    0.5;  // below it, an effect reported with another verdict than "effects" is no name

// Whether a reported effect is this one, or these data cannot distinguish it from this one and at most one
// more.
[[nodiscard]] bool stands_for(const NamedEffect& reported, std::string_view id);
// Whether it is an effect that is there.
[[nodiscard]] bool holds(const MotionTruth& truth, std::string_view id);
// Whether it, or its group of three, is.
[[nodiscard]] bool is_there(const MotionTruth& truth, const NamedEffect& reported);

// One class of added gap.
struct GapRow {
  // Single: the first name is it; is it or its group contains it; any name or its group; the first listed
  // effect, even if it is no name.
  Rate first, first_group, reported, listed_first;
  // Two: every effect by a name of its own; and no name more.
  Rate pair_both, pair_exact;
};

struct ReferenceScore {
  Rate within;        // at most 1.05 of the referee's error
  double median = 0;  // of the ratio
};

struct MotionScore {
  std::array<GapRow, gap_classes.size()> rows;
  // Of all cases, and of those with the verdict "effects": by the errors on held-out parts that the diagnosis
  // reports; by the trial's own regression compared with the robot file with the adopted effects.
  ReferenceScore stated_all, stated_found, own_all, own_found;
  Rate misled;  // named at 0.9 or more, and not there
  std::map<std::string, Rate> misled_by_kind;
  Rate none_named, none_outside, none_clear;
  Rate outside_called;            // "outside" or "inconclusive"
  Rate told_apart;                // single of 10 % and more, likeness below 0.9: first or its group
  Rate catalogue_form, own_form;  // single, first or its group
  Rate not_this_robot;            // that verdict, in all cases
  std::array<ReliabilityBin, 4> reliability;  // from 0, 0.5, 0.7, 0.9; right: the id itself
  std::map<std::string, std::map<std::string, std::size_t>> confusion;  // truth -> answer -> cases
  std::size_t refused = 0;
  double median_s = 0, longest_s = 0;
};
inline constexpr std::array reliability_from{0.0, 0.5, 0.7, 0.9};

// The correct verdict: effects with a name for each that is there and no other name, "none" without effects,
// "outside" or "inconclusive" for a load that no effect describes.
[[nodiscard]] bool verdict_right(const MotionOutcome& outcome);

[[nodiscard]] MotionScore motion_score_of(std::span<const MotionOutcome> outcomes);

}  // namespace joulecast::trial::motion

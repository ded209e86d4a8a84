#pragma once

#include <array>
#include <map>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <utility>
#include <vector>

#include "tests/study/trial/kept/kept_run.h"
#include "tests/study/trial/rate.h"

namespace joulecast::trial::kept {

// A cause is named where it is stated at this probability or more, under any verdict.
inline constexpr double named_from = 0.5;
inline constexpr double sure_from = 0.9;
// Lower bounds of the classes of stated probabilities.
inline constexpr std::array reliability_from{0.5, 0.7, 0.9, 0.97};

// Scores of an engine on one group of cases with one channel set, or on all.
struct KeptScore {
  Rate none_named, none_outside;  // nothing planted: a cause is named; verdict "outside"
  // One effect: the first name is it; is it or its group of at most three contains it; the same for the first
  // listed effect at any probability; verdict "effects" with this name or its group alone.
  Rate first, in_group, listed_first, exact;
  // Two effects: the first name or its group is one of them; each has a name of its own; that and no other
  // name.
  Rate pair_first, pair_named, pair_exact;
  Rate outside_or_inconclusive, outside;  // cause outside the catalogue: by verdict
  Rate sure_and_wrong;  // a cause at 0.9 or more that is not there, nor its group; of real recordings: misled
  Rate strength_close;  // true causes: strength within 10 %, or inside its 95 % interval
  Rate real_right, real_wrong, real_inconclusive;  // of real recordings with known causes
  Rate halves_agree;  // halves of one recording: the same names and the same verdict
  Rate held_out;  // explanation's error at most 1.05 of the regression's, by the engine's own held-out parts
  std::array<ReliabilityBin, reliability_from.size()> effect_true, group_true;  // planted cases
  Rate refused;
  double median_s = 0, longest_s = 0;  // processor time
};

// The class of the verdict on a real recording: "misled": a refuted cause, or a refuted "outside", at 0.9 or
// more; "right": a true cause named, or a true correction, or "outside" for a cause outside the catalogue;
// "inconclusive" by its verdict; "wrong": all else.
[[nodiscard]] std::string real_class(const KeptTruth& truth, const EngineAnswer& answer);

// Scores by group and channel set, in the order of the cases; of several the last is of all together. Cases
// without an answer do not count.
[[nodiscard]] std::vector<std::pair<std::string, KeptScore>> score_kept(const std::vector<KeptCase>& cases,
                                                                        const Answers& answers);

// One table for each group with a column for each set of answers.
[[nodiscard]] std::string score_table(const std::vector<KeptCase>& cases,
                                      const std::vector<std::pair<std::string, Answers>>& columns);
[[nodiscard]] nlohmann::json kept_score_json(const KeptScore& score);

}  // namespace joulecast::trial::kept

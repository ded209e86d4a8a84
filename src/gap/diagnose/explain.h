#pragma once

#include <set>
#include <span>
#include <string>
#include <vector>

#include "gap/diagnose/mixture.h"

namespace joulecast::gap {

struct ExplainSettings {
  std::size_t most_members = 4;   // of the catalogue and covariates
  std::size_t most_families = 2;  // of functions outside them
  std::size_t beam = 10;
  // Whether a set says something that matters: members move less than this share of the mean power, unless
  // the data leave no doubt.
  double least_share = 0.011, least_share_for_certain = 0.007;
  double least_outside_share = 0.012;
  bool candidate = false;  // where no effect is likely, the likeliest is a member
  bool predictive = true;  // false: evidence alone, while a linearisation is sought
};

inline constexpr double least_named = 0.5;     // probability of a name
inline constexpr std::size_t most_stated = 2;  // alternatives that an answer names

// Something else that would explain the data nearly as well in a member's place.
struct Alternative {
  std::size_t hypothesis = 0;
  double odds = 0;  // over the member
};

// One member of an explanation.
struct Member {
  std::size_t hypothesis = 0;
  // Probability that it is there: by the evidence of all data, and by how blocks are predicted that have no
  // part in the fit. `group`: that it or one of the alternatives that are stated is; `any`: or one of all.
  double by_evidence = 0, by_prediction = 0;
  double group_by_evidence = 0, group_by_prediction = 0;
  double any_by_evidence = 0, any_by_prediction = 0;
  double wander =
      0;             // of its strength along the recordings: posterior mean of the standard deviation over it
  double share = 0;  // of the mean power that it moves
  bool candidate = false;  // not likely to be there, but likelier than any other cause
  std::vector<double> coefficients, sd;
  std::vector<Alternative> alternatives;  // likeliest first

  std::span<const Alternative> stated() const {
    return std::span(alternatives).first(std::min(alternatives.size(), most_stated));
  }
  double there_probability() const { return std::min(any_by_evidence, any_by_prediction); }
  double group_probability() const { return std::min(group_by_evidence, group_by_prediction); }
  // Which of a group it is, only the evidence says.
  double probability() const { return std::min(by_evidence, group_probability()); }
};

// What the data prefer, by two judges that share no assumption on noise: the evidence of all blocks, and how
// well each block is predicted by the others (the smallest set within one standard error of the best).
struct Explanation {
  std::vector<Member> members;  // of the likeliest set
  double none = 0;              // probability that nothing that matters is there, by evidence
  double none_by_prediction = 0;
  double outside = 0;  // that something outside the catalogue is, by evidence
  double outside_by_prediction = 0;
  HypothesisSet whole;  // the set with what does not matter by itself
};

// Ids of a member and of the alternatives that an answer names beside it.
std::set<std::string> stated_ids(const Problem& problem, const Member& member);

// Whether an explanation has one of these, likelier there than not.
bool finds(const Explanation& explanation, const Problem& problem, const std::set<std::string>& ids);

// Of all blocks that are not left out.
Explanation explain(const Problem& problem, const std::vector<bool>& left_out = {},
                    const ExplainSettings& settings = {});

// The same with the evidence at hand.
Explanation explain(const Mixture& mixture, const std::vector<bool>& left_out,
                    const ExplainSettings& settings);

}  // namespace joulecast::gap

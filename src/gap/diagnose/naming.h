#pragma once

#include <span>
#include <vector>

#include "gap/diagnose/explain.h"
#include "gap/diagnose/linear.h"

namespace joulecast::gap {

inline constexpr double most_wander = 0.8;     // of a strength, over the strength, that still is that cause
inline constexpr double steady_wander = 0.45;  // up to which it stands still
// What comes back when a cause is left out that the gap needs: of the gap, and of the mean power.
inline constexpr double least_necessary_part = 0.05,
                        least_necessary_share = ExplainSettings{}.least_share_for_certain;

// Whether both judges see this function outside the catalogue.
bool told_outside(const Hypothesis& hypothesis, const Member& member);

// Whether a cause has to show in battery power (or in the motors') to be worth a name. The others are seen by
// other channels however little power they move.
bool shows_in_power(const Hypothesis& hypothesis);

// Share of the power that a cause has to move to be surely seen: the median over causes that show in power of
// what is so many standard deviations of each by itself.
double seen_share(const Mixture& mixture);

// Of an explanation, those that are there, or one that the data cannot tell from them, with even odds or
// better by both judges, and that stand still.
HypothesisSet likely_causes(const Problem& problem, const Explanation& explanation);

// Causes to name, with the strengths that they have by themselves where everything is linear.
struct Named {
  HypothesisSet set;
  std::vector<Cause> causes;  // in the order of the set
};

// The likely causes that the gap needs; where none is likely, the candidate. `power_w`: measured, of the
// windows.
Named name_causes(const Material& material, const Equations& equations, const Problem& problem,
                  const Explanation& explanation, std::span<const double> power_w);

// The strengths with which these causes alone leave least: by all equations, and where power from motion
// stands alone, by how much of it they leave.
std::vector<Cause> strengths_of(const Equations& equations, const Problem& problem,
                                const HypothesisSet& named);

// Of each window what is left of battery power by the named and the functions outside the catalogue that the
// explanation has beside them [W]; NaN where power from motion does not speak, empty where no function does.
std::vector<double> left_with_functions(const Equations& equations, const Problem& problem,
                                        const Explanation& explanation, const HypothesisSet& named,
                                        std::size_t windows);

// The named beside what every robot has; of one effect in both the shape of the base stays.
std::vector<Cause> joined(std::vector<Cause> base, std::span<const Cause> named);

}  // namespace joulecast::gap

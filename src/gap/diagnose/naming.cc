#include "gap/diagnose/naming.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <string>

#include "gap/diagnose/power_fit.h"
#include "gap/equations/power.h"
#include "gap/traits.h"
#include "statistics/robust.h"

namespace joulecast::gap {
namespace {

// Causes that only the motors' readings show, not battery power.
bool moves_motors_alone(const Hypothesis& h) {
  const std::string id = h.id();
  return (id == "current_sensor_gain" || id == "current_sensor_bias" || id == "voltage_sensor_gain") &&
         h.effect.values[2] == 0;
}

// In the order of the set's columns.
Eigen::VectorXd coefficients_of(const Equations& e, const Problem& problem, const HypothesisSet& set) {
  std::vector<std::size_t> own = columns_of(problem.hypotheses, set);
  std::ranges::sort(own);
  const Eigen::VectorXd mean = Mixture(problem, e.left_out, own).estimate(set).mean;
  return power_speaks_alone(e) ? fitted_to_power(e, set, mean) : mean;
}

std::vector<Chosen> chosen_of(const Problem& problem, const HypothesisSet& set,
                              const Eigen::VectorXd& coefficients) {
  std::vector<Chosen> chosen;
  Eigen::Index at = 0;
  for (const std::size_t h : set) {
    Chosen c{h, {}};
    for (std::size_t k = 0; k < problem.hypotheses[h].candidate.columns.size(); ++k)
      c.coefficients.push_back(coefficients[at++]);
    chosen.push_back(std::move(c));
  }
  return chosen;
}

}  // namespace

bool told_outside(const Hypothesis& hypothesis, const Member& member) {
  return hypothesis.outside() && std::min(member.by_evidence, member.by_prediction) >= least_named;
}

bool shows_in_power(const Hypothesis& hypothesis) {
  return !hypothesis.is_effect() ||
         (!traits_of(hypothesis.id()).elsewhere && !moves_motors_alone(hypothesis));
}

double seen_share(const Mixture& mixture) {
  constexpr double deviations = 3.5;
  const Problem& problem = mixture.problem();
  std::map<std::string, double> shares;
  for (std::size_t h = 0; h < problem.hypotheses.size(); ++h) {
    const Hypothesis& hypothesis = problem.hypotheses[h];
    if (hypothesis.outside() || !shows_in_power(hypothesis) || shares.contains(hypothesis.id())) continue;
    shares[hypothesis.id()] = problem.moved(hypothesis, deviations * mixture.estimate({h}).sd);
  }
  std::vector<double> values;
  for (const auto& [id, share] : shares) values.push_back(share);
  return values.empty() ? missing : statistics::median(std::move(values));
}

HypothesisSet likely_causes(const Problem& problem, const Explanation& explanation) {
  HypothesisSet set;
  for (const Member& member : explanation.members) {
    if (!problem.hypotheses[member.hypothesis].outside() && member.there_probability() >= least_named &&
        member.wander < most_wander)
      set.push_back(member.hypothesis);
  }
  std::ranges::sort(set);
  return set;
}

std::vector<Cause> joined(std::vector<Cause> base, std::span<const Cause> named) {
  for (const Cause& cause : named) {
    if (std::ranges::none_of(base, [&](const Cause& b) { return b.same_kind(cause); })) base.push_back(cause);
  }
  return base;
}

std::vector<Cause> strengths_of(const Equations& e, const Problem& problem, const HypothesisSet& named) {
  if (named.empty()) return {};
  return e.columns.causes_of(chosen_of(problem, named, coefficients_of(e, problem, named)));
}

std::vector<double> left_with_functions(const Equations& e, const Problem& problem,
                                        const Explanation& explanation, const HypothesisSet& named,
                                        std::size_t windows) {
  const ChannelRows& r = e.rows[index_of(Channel::power)];
  if (!power_speaks_alone(e)) return {};
  HypothesisSet set = named;
  for (const Member& m : explanation.members) {
    if (told_outside(problem.hypotheses[m.hypothesis], m)) set.push_back(m.hypothesis);
  }
  if (set.size() == named.size()) return {};
  std::ranges::sort(set);
  std::vector<double> left(windows, missing);
  const Eigen::VectorXd rest = r.y - moved_power(e, set, coefficients_of(e, problem, set));
  for (std::size_t k = 0; k < r.window.size(); ++k) left[r.window[k]] = rest[static_cast<Eigen::Index>(k)];
  return left;
}

Named name_causes(const Material& m, const Equations& e, const Problem& problem,
                  const Explanation& explanation, std::span<const double> power_w) {
  HypothesisSet set = likely_causes(problem, explanation);
  const auto candidate = std::ranges::find(explanation.members, true, &Member::candidate);
  if (set.empty() && candidate != explanation.members.end()) set = {candidate->hypothesis};
  std::vector<double> measured;
  std::vector<Window> windows;
  for (std::size_t k = 0; k < m.windows.size(); ++k) {
    if (!std::isfinite(power_w[k]) || e.leaves_out(m.windows[k].block)) continue;
    windows.push_back(m.windows[k]);
    measured.push_back(power_w[k]);
  }
  const auto gap_with = [&](const HypothesisSet& some) {
    const std::vector<Cause> causes = strengths_of(e, problem, some);
    return gap_size(measured, modelled_power(m.robot, m.adopted, causes, windows)).absolute_relative;
  };
  if (!windows.empty() && set.size() > 1) {
    const double least = std::max(least_necessary_part * gap_with({}), least_necessary_share);
    while (set.size() > 1) {
      const double all = gap_with(set);
      double opened = least;
      std::optional<std::size_t> spare;
      for (const std::size_t h : set) {
        if (!shows_in_power(problem.hypotheses[h])) continue;
        if (const double o = gap_with(without(set, h)) - all; o < opened) opened = o, spare = h;
      }
      if (!spare) break;
      std::erase(set, *spare);
    }
  }
  return {set, strengths_of(e, problem, set)};
}

}  // namespace joulecast::gap

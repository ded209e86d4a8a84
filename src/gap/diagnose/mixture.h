#pragma once

#include <vector>

#include "gap/diagnose/problem.h"
#include "statistics/evidence.h"

namespace joulecast::gap {

// Evidence of some blocks of a problem, averaged over its circumstances.
class Mixture {
 public:
  // Of all blocks that are not left out. Circumstances that neither nothing nor any single hypothesis makes
  // plausible are dropped.
  explicit Mixture(const Problem& problem, const std::vector<bool>& left_out = {});
  // The same under plain circumstances alone, for sets of these columns (ascending): what each set predicts
  // by itself, without what formulas that are off could add to it.
  Mixture(const Problem& problem, const std::vector<bool>& left_out, const std::vector<std::size_t>& columns);

  const Problem& problem() const { return *problem_; }

  // Log of prior times density of the data.
  double log_joint(const HypothesisSet& set) const;
  // The same over that of nothing.
  double log_odds(const HypothesisSet& set) const { return log_joint(set) - log_joint({}); }

  // Strengths of the set's columns in order; averaged over the circumstances.
  struct Estimate {
    Eigen::VectorXd mean, sd;
  };
  Estimate estimate(const HypothesisSet& set) const;

  // How the wander of one member's strength along the recordings, as a standard deviation over the strength
  // itself, is distributed: probabilities of the values in wander_grid.
  std::vector<double> wander(const HypothesisSet& set, std::size_t member) const;

  double mean_wander(const HypothesisSet& set, std::size_t member) const;

  // First coefficient of one member in every block, as far as each block says something beyond what all
  // together do: the strength of all, drawn to what the block alone would have, with the wander that is
  // likeliest. NaN: left out.
  std::vector<double> by_block(const HypothesisSet& set, std::size_t member) const;

 private:
  struct Part {
    const Circumstances* circumstances;
    double log_weight;  // prior, and density of the data with nothing there
    statistics::Evidence evidence;
  };
  std::vector<double> log_terms(const HypothesisSet& set) const;
  std::vector<statistics::Information> stretches_of(std::size_t noise,
                                                    const std::vector<std::size_t>& columns) const;
  const Part& likeliest(const HypothesisSet& set) const;

  const Problem* problem_;
  std::vector<bool> left_out_;
  std::vector<Part> parts_;
};

inline constexpr std::array wander_grid{0.0, 0.1, 0.2, 0.3, 0.45, 0.6, 0.8, 1.1, 1.5};
// Before any data: half normal.
inline constexpr double usual_wander = 0.4;

}  // namespace joulecast::gap

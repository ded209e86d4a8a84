#pragma once

#include "gap/posterior/walk.h"

namespace joulecast::gap::posterior {

// Posterior of each model, averaged over resamples of the blocks (Huggins and Miller, Reproducible model
// selection using bagged posteriors, Bayesian Analysis, 2023).
Eigen::VectorXd bagged(const Prior& prior, const Grams& grams, std::span<const Model> models,
                       int draws = resamples);

// Whether a hypothesis is visible in other channels than power: its size is measured there.
bool shows_elsewhere(const Fit& fit, const Hypothesis& hypothesis);

// Effects and functions of a model that move more than a threshold.
struct Content {
  std::vector<std::string> ids;  // ascending
  std::optional<std::size_t> function;
  double function_share = 0;  // of mean power
};
std::vector<Content> contents(const Fit& fit);

// An effect with its probability.
struct Found {
  std::string id;
  double probability = 0;                 // bagged, before constancy
  std::vector<std::string> alternatives;  // that replace it where it is absent
  double group = 0;                       // probability of it or of one of them
  std::size_t model = 0;                  // the likeliest with it in its likeliest shape
  std::size_t member = 0;                 // its place in that model's set
};

struct Summary {
  double none = 0, outside = 0;         // probabilities
  std::vector<Found> effects;           // of the likeliest set
  std::optional<std::size_t> function;  // the likeliest outside the catalogue
  double function_share = 0;
};
Summary summarise(const Fit& fit, const Eigen::VectorXd& probability);

// How constant a strength is over the blocks, formula (5).
struct Constancy {
  double probability = 1;  // that it differs between blocks by less than half of itself
  double scatter = 0;      // posterior mean of rho
};
Constancy constancy(const Fit& fit, std::span<const std::size_t> set, std::size_t member);

}  // namespace joulecast::gap::posterior

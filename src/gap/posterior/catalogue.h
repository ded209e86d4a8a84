#pragma once

#include <cmath>
#include <limits>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "gap/posterior/data.h"

namespace joulecast::gap {

// A further variable that a cause follows: a covariate, by its distance from `centre`.
struct Modulation {
  std::size_t covariate = 0;  // index in Window::covariates
  double centre = 0;

  // 0 where the covariate is missing, as if it were at its centre.
  double of(const Window& w) const {
    const double value = covariate < w.covariates.size() ? w.covariates[covariate] : missing;
    return std::isfinite(value) ? value - centre : 0;
  }
};

// Each covariate that is finite in at least half of the windows and differs among them.
std::vector<Modulation> modulations_of(std::span<const Window> windows);

// A cause found, with its strength: an effect in force, or an effect with parameter `parameter` as its
// strength per unit of a covariate.
struct Cause {
  dynamics::ActiveEffect effect;
  std::size_t parameter = 0;
  std::optional<Modulation> by;
};

// An effect of the catalogue in one of its shapes, or a covariate with the effect that carries it.
struct Hypothesis : Cause {
  std::vector<std::size_t> columns;
  double least = -std::numeric_limits<double>::infinity();  // bounds of the strength
  double most = std::numeric_limits<double>::infinity();
  std::string covariate;  // name; empty: the strength is constant
  std::string unit;       // of a covariate's coefficient

  bool is_effect() const { return effect.effect != nullptr && covariate.empty(); }
  std::string id() const {
    return is_effect() ? std::string(effect.effect->info().id) : "covariate:" + covariate;
  }
};

}  // namespace joulecast::gap

namespace joulecast::gap::posterior {

// One coefficient of a hypothesis: a parameter of the effect at strength zero, or its slope over a covariate.
struct EffectColumn : Cause {
  std::size_t hypothesis = 0;
};

// Every effect that these recordings can show, each in some shapes. A hypothesis has one column, or two a
// quarter turn apart (slope). Its bounds apply to the strength added to the robot file's own.
struct Catalogue {
  std::vector<Hypothesis> hypotheses;
  std::vector<EffectColumn> columns;
  std::size_t ids = 0;  // effects that share the prior, where other rows show more of them

  std::size_t first_column(std::size_t hypothesis) const { return hypotheses[hypothesis].columns[0]; }
};

Catalogue make_catalogue(const Data& data);

// The effects in force with these strengths of all columns (covariates excepted, which are linear).
std::vector<dynamics::ActiveEffect> in_force(const Data& data, const Catalogue& catalogue,
                                             const Eigen::VectorXd& strengths);

// Returns the strengths, each clamped to the bounds of its hypothesis.
Eigen::VectorXd bounded(const Catalogue& catalogue, Eigen::VectorXd strengths);

// Whether a strength is within `bound_part` of an end of its range that is not zero: it is no estimate.
bool at_bound(const Hypothesis& hypothesis, double strength);

}  // namespace joulecast::gap::posterior

#pragma once

#include <compare>
#include <optional>

#include "gap/posterior/gram.h"

namespace joulecast::gap::posterior {

// Some hypotheses and at most one function outside the catalogue.
struct Model {
  std::vector<std::size_t> set;              // hypotheses, ascending
  std::optional<std::size_t> configuration;  // of a function

  auto operator<=>(const Model&) const = default;
};

// A function with one width of its prior.
struct Configuration {
  std::size_t function = 0;
  double share = 0;
};

// Log evidence, over that of no effect, and posterior of the strengths of a set.
struct SetEvidence {
  double log_evidence = 0;
  Eigen::VectorXd mean, sd;
};

// Formula (4) for strengths with prior N(0, sd^2) truncated to [least, most] and a likelihood
// exp(b't - t'Gt/2) (MacKay, Information Theory, 2003, chapter 28).
SetEvidence evidence_of(const Eigen::MatrixXd& g, const Eigen::VectorXd& b, const Eigen::VectorXd& sd,
                        const Eigen::VectorXd& least, const Eigen::VectorXd& most);

// The prior of sets, functions and strengths, and the pairs that are excluded from one set.
class Prior {
 public:
  // `gap`: residual of the file, of the power; `raw`: sum of the Gram matrices.
  Prior(const Catalogue& catalogue, const Equations& equations, const std::vector<Function>& functions,
        double gap, bool power_alone, const Eigen::MatrixXd& raw);

  std::size_t size() const { return log_prior_.size(); }
  double log_prior(std::size_t hypothesis) const { return log_prior_[hypothesis]; }
  // Standard deviation of a strength that moves this share of the power.
  double slab(std::size_t hypothesis, double share) const;
  bool excludes(std::size_t a, std::size_t b) const { return excludes_[a * size() + b]; }
  const std::vector<Configuration>& configurations() const { return configurations_; }
  double log_configuration() const { return log_configuration_; }
  const Equations& equations() const { return e_; }
  const Catalogue& catalogue() const { return c_; }

 private:
  const Catalogue& c_;
  const Equations& e_;
  double widest_;
  std::vector<double> log_prior_;
  std::vector<Configuration> configurations_;
  double log_configuration_ = 0;
  std::vector<bool> excludes_;
};

// A reduced Gram matrix; the two columns of a slope are turned to its likeliest direction.
class View {
 public:
  View(const Prior& prior, const Reduced& reduced);

  // Evidence over no effect of a set, its prior included, averaged over the widths `shares`.
  SetEvidence evidence(std::span<const std::size_t> set, std::optional<std::size_t> configuration,
                       std::span<const double> shares) const;
  // Log evidence of no effect with a function, over that without one; its prior included.
  double log_evidence(std::optional<std::size_t> configuration) const;
  // Coefficients [E F] of a set with strengths t, and a function at its posterior mean.
  Eigen::VectorXd coefficients(std::span<const std::size_t> set, const Eigen::VectorXd& t,
                               std::optional<std::size_t> configuration) const;
  double precision(std::size_t hypothesis) const;

 private:
  struct Under {  // E with the functions of a configuration integrated out
    Information information;
    double log_evidence = 0;
  };
  const Under& under(std::optional<std::size_t> configuration) const;

  const Prior& prior_;
  Information all_;
  std::vector<double> cost_;                          // of a slope's other direction
  std::vector<std::array<double, 2>> direction_;      // of each hypothesis: cosine and sine
  mutable std::vector<std::optional<Under>> unders_;  // none, and each configuration
};

// Returns the models worth keeping by all the data, with their subsets and every single effect.
std::vector<Model> enumerate(const Prior& prior, const Reduced& reduced);

// Log posterior of each model, up to a constant, for one factor; strengths on request.
Eigen::VectorXd log_posteriors(const View& view, const Reduced& reduced, std::span<const Model> models,
                               std::vector<SetEvidence>* strengths = nullptr);

// Posterior of each model with the factor summed out, and of the factors.
struct Probabilities {
  Eigen::VectorXd model, factor;
  Eigen::VectorXd log_joint;    // of each model, up to a constant
  std::size_t best_factor = 0;  // of the likeliest model
};
Probabilities probabilities(const Prior& prior, const ReducedByFactor& reduced,
                            std::span<const Model> models);

}  // namespace joulecast::gap::posterior

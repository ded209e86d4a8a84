#pragma once

#include <Eigen/Dense>
#include <span>
#include <string>
#include <vector>

#include "dynamics/catalogue.h"

namespace joulecast::gap {

// Something that may be behind the energies of runs: an effect of the catalogue (one of its parameters, one
// variant of its shapes), or a trend over a condition that stands for what the catalogue does not know.
struct RunCandidate {
  dynamics::ActiveEffect effect;  // strength zero; null effect: outside
  std::size_t parameter = 0;      // whose coefficient the column has
  std::string variable;           // outside only: the condition that it follows
  std::vector<std::size_t> columns;
  double expected = 1;         // sd of each coefficient beforehand
  double least = 0, most = 0;  // bounds of a coefficient
  double log_prior = 0;

  bool outside() const { return effect.effect == nullptr; }
  std::string id() const { return outside() ? "outside:" + variable : std::string(effect.effect->info().id); }
};

// One equation: relative energy that the model misses = columns . coefficients + scatter.
struct RunEquation {
  std::size_t table = 0;
  bool difference = false;  // right minus left motor; otherwise their sum, or the battery
  Eigen::VectorXd values;   // the columns, the common scale of the model, the response
};

// What energies scatter by beside any effect, as standard deviations relative to a run's energy: from run to
// run (sums and side differences apart) and from table to table. Unknown: evidence is averaged over a grid.
struct RunScatter {
  double run = 0, difference = 0, table = 0;
};

// Sums over equations that all evidence is made of; equations can be taken out again.
class RunSums {
 public:
  RunSums(std::size_t tables, std::size_t columns);
  void add(const RunEquation& equation, double sign = 1);
  bool with_differences() const;  // between the motors

  // Precision-weighted products of columns, response last, with the table's shifts and the common scale
  // integrated out, and the log of the density's normalisation.
  struct Products {
    Eigen::MatrixXd gram;
    double log_scale = 0;
  };
  Products products(const RunScatter& scatter) const;

 private:
  struct Part {
    double count = 0;
    Eigen::MatrixXd square;
    Eigen::VectorXd sum;
  };
  std::size_t columns_;
  std::vector<Part> parts_;  // two a table: sums, differences
};

struct RunExplanation {
  std::vector<std::size_t> candidates;  // ascending
  double log_evidence = 0;              // prior odds included
};

struct RunEstimate {
  Eigen::VectorXd mean, sd;  // of the candidates' columns in their order
  RunScatter scatter;
};

// Evidence for sets of candidates: Gaussian integrals with each strength inside its bounds, averaged over the
// scatters that the data leave plausible.
class RunEvidence {
 public:
  // `sought`: the scatters that these need are looked at; empty: those that any single candidate needs.
  RunEvidence(std::span<const RunCandidate> candidates, const RunSums& sums,
              std::span<const std::size_t> sought = {});

  double log_evidence(std::span<const std::size_t> set) const;
  RunEstimate estimate(std::span<const std::size_t> set) const;
  // Cosine between what two candidates do to the runs, scatter and common scale apart; of their first
  // columns.
  double likeness(std::size_t a, std::size_t b) const;
  // Beam search up to `most_effects`, the empty set among the answers, best first.
  std::vector<RunExplanation> search(std::size_t most_effects) const;

 private:
  struct Point {
    RunScatter scatter;
    RunSums::Products products;
  };
  struct Gaussian {
    Eigen::VectorXd mean;        // in units of what is expected
    Eigen::MatrixXd covariance;  // the same
    double log_evidence = 0;
  };
  Gaussian integrate(const Point& point, std::span<const std::size_t> set) const;
  std::vector<std::size_t> columns_of(std::span<const std::size_t> set) const;

  std::span<const RunCandidate> candidates_;
  std::vector<Point> points_;
};

}  // namespace joulecast::gap

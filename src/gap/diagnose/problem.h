#pragma once

#include <Eigen/Dense>
#include <functional>
#include <span>
#include <vector>

#include "gap/equations/hypothesis.h"
#include "statistics/information.h"

namespace joulecast::gap {

// One guess at what nobody knows beforehand: how well the robot keeps to its file, how far formulas hold, how
// much energies scatter. Evidence is averaged over all of them, each weighed by what the data say of it.
struct Circumstances {
  double log_prior = 0;
  Eigen::VectorXd tolerance;  // of every column
  std::size_t noise = 0;      // which of Problem::blocks holds
};

// What may be behind a set of data, and what the data say of it, block by block. Recordings, tables of runs
// and comparisons between groups come to this; what is decided of them is decided from it alone.
struct Problem {
  std::vector<Hypothesis> hypotheses;
  std::vector<Circumstances> circumstances;
  // What to predict with: a robot that is its file's and formulas that hold, so that nothing but what is
  // named can explain anything; only sensors' offsets and the like are free.
  Circumstances plain;
  std::vector<std::vector<statistics::Information>> blocks;  // by noise, then block
  // Share of the mean power (or energy) that a hypothesis moves with these coefficients of its columns.
  std::function<double(const Hypothesis&, const Eigen::VectorXd&)> moved;
  // What members of a set move one by one, over what they move together, in the channel where that is
  // largest: far above one where they undo each other.
  std::function<double(const HypothesisSet&, const Eigen::VectorXd&)> cancelling;
  // How alike two hypotheses are: the least correlation about zero, over channels, of what they move there.
  std::function<double(const Hypothesis&, const Hypothesis&)> likeness;

  // Whether these data show both as the same, so that which of them it is hangs on how noise is described.
  bool alike(std::size_t a, std::size_t b) const {
    constexpr double same = 0.99;
    return likeness && likeness(hypotheses[a], hypotheses[b]) > same;
  }

  std::size_t block_count() const { return blocks.empty() ? 0 : blocks.front().size(); }
};

}  // namespace joulecast::gap

#pragma once

#include <Eigen/Core>
#include <functional>
#include <span>
#include <vector>

// The evidence of a nonlinear problem with several witnesses, each compared relative to the size of its own
// readings, so that hypotheses that rescale readings are comparable.
namespace joulecast::gap::corrections {

// The part of a reading below which differences do not count.
inline constexpr double floor_share = 0.1;

// A parameter with a prior around 0: Student's t with 3 degrees of freedom, and Gaussian beyond `wall`; or
// Gaussian.
struct Unknown {
  double sd = 1, wall = 1e9;
  bool positive = false, heavy = true;
};

// Residuals of all witnesses at one point, and the readings to which they are relative: rows by witnesses,
// NaN where there is none.
struct Comparison {
  Eigen::ArrayXXd residual, reading;
};

struct Problem {
  std::vector<Unknown> unknowns;
  std::vector<double> independent;  // rows of each witness
  std::vector<double> fewest;       // rows without which a witness counts as not explained at all
  std::function<void(const Eigen::VectorXd&, Comparison&)> compare;
  std::size_t rescaling = 0;  // the last unknowns, which change `reading`
};

struct Maximum {
  Eigen::VectorXd at, deviation;
  double log_evidence = 0;  // -minus log posterior at the maximum - half log determinant
  double minus_log_prior = 0, half_log_determinant = 0;
  Comparison comparison;
  std::vector<double> relative;  // residual of each witness over its reading
};

// 1.25 times the mean |residual| over the root mean square of the reading, with weights of rows; 1 with fewer
// than `fewest` rows. A Gaussian residual of the reading's size has the value 1.
double relative_residual(double sum_abs, double sum_square, double rows, double fewest);

// minus log likelihood of a witness: 1/2 n log(relative^2 + floor^2).
double surprise(double independent, double relative);

// The maximum of the posterior by at most `steps` Gauss-Newton steps for absolute residuals, from `start`,
// and Laplace's approximation of the evidence there. Determinants are relative to the deviations of the
// priors.
Maximum maximise(const Problem& problem, Eigen::VectorXd start, int steps);

}  // namespace joulecast::gap::corrections

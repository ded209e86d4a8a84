#pragma once

#include <Eigen/Dense>
#include <vector>

namespace joulecast::statistics {

// Information of whitened equations y = X b + e, e ~ N(0, 1), on their coefficients: sufficient for Gaussian
// inference.
struct Information {
  Eigen::MatrixXd xx;    // X'X
  Eigen::VectorXd xy;    // X'y
  double yy = 0;         // y'y
  double log_scale = 0;  // log of the density's factor that whitening took out, -sum log sigma

  Information() = default;
  explicit Information(Eigen::Index columns);

  Information& operator+=(const Information& other);
  Information& operator*=(double factor);

  // Rows with these columns, each once; X'X is kept whole, both triangles.
  void add(const Eigen::Ref<const Eigen::MatrixXd>& x, const Eigen::Ref<const Eigen::VectorXd>& y,
           const std::vector<Eigen::Index>& columns);

  // Adds to these columns a deviation of this information's own, N(0, sd^2) each, and integrates it out: a
  // random effect of one mission or block. Columns with sd 0 are left alone.
  void integrate_out(const Eigen::VectorXd& sd);
};

}  // namespace joulecast::statistics

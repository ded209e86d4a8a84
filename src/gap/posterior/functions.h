#pragma once

#include <array>
#include <string>
#include <vector>

#include "gap/posterior/data.h"

namespace joulecast::gap::posterior {

// A smooth function of one variable in one channel: it represents a cause outside the catalogue that follows
// this variable.
struct Function {
  Channel channel = Channel::power;  // the right-hand one of a pair
  std::string variable;
  std::array<Eigen::MatrixXd, 2>
      basis;              // of each side: rows of power (Channel::power) or windows, by coefficients
  double unit = 1;        // coefficient that moves mean power by 100 %
  bool for_noise = true;  // is used in the fit for the noise

  std::size_t size() const { return ux(basis[0].cols()); }
};

// Hat functions: 1 at their knot, 0 at its neighbours, linear between; constant beyond the ends. Rows by
// knots.
Eigen::MatrixXd hats(const Eigen::VectorXd& values, const std::vector<double>& knots);

// The functions that these recordings can show.
std::vector<Function> make_functions(const Data& data);

}  // namespace joulecast::gap::posterior

#pragma once

#include <Eigen/Dense>
#include <span>
#include <vector>

#include "gap/columns.h"

namespace joulecast::gap {

// The whitened equations of one channel: response and regressors in units of their noise. Regressors that
// never speak in this channel are left out.
struct ChannelDesign {
  std::vector<std::size_t> columns;  // global column of each of ours
  std::vector<std::size_t> window;   // of each row
  std::vector<std::size_t> mission;  // of each row
  Eigen::MatrixXd x;                 // rows by columns
  Eigen::VectorXd y;
  double sigma = 0;      // of one row before whitening, in the channel's unit
  double inflation = 1;  // of the variance by what is correlated over many windows
};

struct Design {
  std::array<ChannelDesign, channel_count> channels;
  std::size_t missions = 0;
};

// Evaluates all windows and whitens each channel: a second-order autoregression and a robust spread from what
// a fit of everything leaves over, weights that bound the say of outliers, and a variance inflation for what
// stays correlated over seconds.
// Without whitening, the spread alone is divided out.
Design make_design(const ColumnSet& columns, std::span<const Window> windows, bool whitening = true);

// What data say about the coefficients: y'y, X'y, X'X in whitened units.
struct Information {
  Eigen::MatrixXd xx;
  Eigen::VectorXd xy;
  double yy = 0;

  Information& operator+=(const Information& other);
  Information& operator*=(double factor);
};

// One for each mission, with the coefficients' own deviations in that mission (Column::scatter) integrated
// out.
std::vector<Information> mission_information(const ColumnSet& columns, const Design& design);

}  // namespace joulecast::gap

#pragma once

#include <Eigen/Dense>
#include <span>
#include <vector>

#include "gap/equations/columns.h"
#include "statistics/information.h"

namespace joulecast::gap {

// The equations of one channel as they are, in its own unit: a row a window that speaks. Regressors that
// never speak in this channel are left out.
struct ChannelRows {
  std::vector<std::size_t> columns;  // global column of each of ours
  std::vector<std::size_t> window;   // of each row
  std::vector<std::size_t> block;    // of each row
  std::vector<bool> resting;         // both wheels stand
  Eigen::MatrixXd x;                 // rows by columns
  Eigen::VectorXd y;
};
using Rows = std::array<ChannelRows, channel_count>;

// Evaluates all windows. Channels with too few rows stay empty.
Rows make_rows(const ColumnSet& columns, std::span<const Window> windows);

// How one channel's equations err: learnt from what a fit of everything leaves over, with every coefficient
// held by what is expected of it (Huber weights, a robust spread by class of size), and from how much more
// the scores of whole blocks scatter than those of single rows: the inflation is the factor by which
// correlated rows count for less.
struct ChannelNoise {
  double sigma = 0;          // of one row, in the channel's unit; 0: the channel is silent
  double inflation = 1;      // of the variance, by blocks
  Eigen::VectorXd spread;    // of each row, in the channel's unit
  Eigen::VectorXd weight;    // of each row in units of its spread, less for outliers
  Eigen::VectorXd residual;  // of the fit of everything, in the channel's unit
};
using Noise = std::array<ChannelNoise, channel_count>;

// From the rows of blocks that are not left out alone; the others get no weight.
Noise learn_noise(const ColumnSet& columns, const Rows& rows, const std::vector<bool>& left_out = {});

// Responses of every channel in place of the rows' own; empty: the channel is silent.
using Responses = std::array<Eigen::VectorXd, channel_count>;

// Weighted rows as information, one a block; rows of left out blocks give none. `response`: in place of the
// rows' own, if given.
std::vector<statistics::Information> block_information(const ColumnSet& columns, const Rows& rows,
                                                       const Noise& noise, std::size_t blocks,
                                                       const Responses* response = nullptr);

}  // namespace joulecast::gap

#pragma once

#include <vector>

#include "gap/posterior/catalogue.h"
#include "gap/posterior/functions.h"

namespace joulecast::gap::posterior {

// Prior of one coefficient of y = E theta + F beta + Z nu + e.
struct Column {
  double tolerance = 0;  // sd in a robot that matches its file, times the common factor
  double scatter = 0;    // sd between blocks, times the common factor
  double unit = 1;   // strength that moves mean power (of motor sensors: motor power) by 100 %; 0: nuisance
  double usual = 0;  // sd of a strength worth a name (traits.h); 0: by power alone
  bool of_file = false;  // a calibration of the robot file estimates it
};

// The rows of one channel, both sides of a pair together.
struct ChannelRows {
  Channel channel = Channel::power;
  std::vector<Eigen::Index> columns;  // global column of each of x's; the others are zero
  Eigen::MatrixXd x;
  Eigen::VectorXd y;  // measured minus modelled at the point, plus the part explained there
  std::vector<std::size_t> block, mission;
  std::vector<bool> resting;

  void add(const Window& window);  // block, mission and rest of one more row
};

// Returns rows of battery power at these rows, without columns and readings.
ChannelRows channel_rows(const PowerRows& power);

// The model equation, linear about a point. Columns: E effects, F functions, Z nuisances.
struct Equations {
  std::size_t effects = 0, functions = 0, nuisances = 0;
  std::array<double, tolerance_factors.size()> factor_prior = tolerance_factor_prior;
  std::vector<Column> columns;
  std::vector<std::vector<std::size_t>> function_columns;  // of each function
  std::vector<Eigen::MatrixXd> function_power;             // Z'Z / rows / unit^2 of each
  std::vector<ChannelRows> channels;
  Eigen::VectorXd point;       // strengths of the effects at which it is linear
  Eigen::VectorXd modelled_w;  // by row of power, at the point
  Eigen::MatrixXd moved;       // rows of power by effects: d power / d strength [W]
  Eigen::VectorXd share;       // of each effect: mean |d power / d strength| over mean power
  Eigen::VectorXd moves;  // the same of the channel that the effect moves most, over its readings' spread

  std::size_t size() const { return columns.size(); }
};

// Evaluates all rows at a point: the effects' strengths. `functions` are the same at every point.
Equations linearise(const Data& data, const Catalogue& catalogue, const std::vector<Function>& functions,
                    const Eigen::VectorXd& point);

// Battery power by row at these strengths, exactly but for covariates, which are linear [W].
Eigen::VectorXd power_at(const Data& data, const Catalogue& catalogue, const Equations& equations,
                         const Eigen::VectorXd& strengths);

}  // namespace joulecast::gap::posterior

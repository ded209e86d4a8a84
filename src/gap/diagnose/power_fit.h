#pragma once

#include <Eigen/Dense>
#include <span>
#include <vector>

#include "gap/diagnose/linear.h"

namespace joulecast::gap {

// Whether battery power from motion (Channel::power) is all that says something of power.
bool power_speaks_alone(const Equations& equations);

// Whether another channel than power shows this hypothesis.
bool shown_elsewhere(const Equations& equations, const Hypothesis& hypothesis);

// All columns of a set, in its order.
std::vector<std::size_t> columns_of(std::span<const Hypothesis> hypotheses, const HypothesisSet& set);

// Where each column stands among a channel's; -1: it does not speak there.
std::vector<Eigen::Index> places_of(const ChannelRows& rows, std::span<const std::size_t> columns);

// What a set with these coefficients, in the order of its columns, makes of power from motion, row by row
// [W].
Eigen::VectorXd moved_power(const Equations& equations, const HypothesisSet& set,
                            const Eigen::VectorXd& coefficients);

// The coefficients of a set that leave least of power from motion by Huber's estimator. Evidence weighs every
// row by its size, so that a robot at rest says as much as one that drives; what is missed then is not least.
// Each is held by what is expected of it and within its bounds; what other channels show stays as `start` has
// it, and so does everything where nothing is gained.
Eigen::VectorXd fitted_to_power(const Equations& equations, const HypothesisSet& set,
                                const Eigen::VectorXd& start);

}  // namespace joulecast::gap

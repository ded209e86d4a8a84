#pragma once

#include <array>
#include <cstddef>

// Boost.Math's distributions behind plain functions, so that its headers stay out of everybody else's.
namespace joulecast::statistics {

double normal_cdf(double z);
// log Phi(z), exact far below zero too.
double log_normal_cdf(double z);
// Log of the probability that a normal variable lies in [least, most]; either may be infinite.
double log_normal_within(double mean, double sd, double least, double most);
// z with Phi(z) = probability; 0 < probability < 1.
double normal_quantile(double probability);
// t with P(T < t) = probability for `freedom` > 0 degrees of freedom.
double student_t_quantile(double probability, double freedom);
// P(X > x) of a chi-squared variable.
double chi_squared_tail(double x, double freedom);

// 95 % interval of a probability of which `tries` trials saw `hits` (Wilson 1927); [0, 1] without a try.
std::array<double, 2> wilson_interval(std::size_t hits, std::size_t tries);

}  // namespace joulecast::statistics

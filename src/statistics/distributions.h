#pragma once

// Boost.Math's distributions behind plain functions, so that other files do not include its headers.
namespace joulecast::statistics {

// log Phi(z), exact far below zero too.
double log_normal_cdf(double z);
// Log of the probability that a normal variable lies in [least, most]; either may be infinite.
double log_normal_within(double mean, double sd, double least, double most);
// z with Phi(z) = probability; 0 < probability < 1.
double normal_quantile(double probability);
// t with P(T < t) = probability for `freedom` > 0 degrees of freedom; 0 < probability < 1.
double student_t_quantile(double probability, double freedom);

}  // namespace joulecast::statistics

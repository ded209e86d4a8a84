#pragma once

#include <span>
#include <vector>

namespace joulecast::statistics {

// The middle value, of an even number the mean of the two in the middle; `values` must not be empty.
double median(std::vector<double> values);

// The value below which this fraction of the values lies, linear between neighbours; `values` must not be
// empty.
double quantile(std::vector<double> values, double fraction);

// A standard deviation of values about zero that a tenth of outliers does not change: from the mean size of
// the other nine tenths. (The median of sizes would be zero where most readings are zeros of a resting
// robot.) 0 without values.
double spread_about_zero(std::span<const double> values);

// Weight of a residual in Huber's estimator: 1 within `bound` spreads, falling as their inverse beyond it.
double huber_weight(double residual, double spread, double bound);

}  // namespace joulecast::statistics

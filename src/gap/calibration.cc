#include "gap/calibration.h"

#include <algorithm>
#include <cmath>

namespace joulecast::gap {
namespace {

// Log odds = slope * log odds of the posterior + shift.
struct Move {
  double slope, shift;
};

// Fitted by tests/benchmarks/fit_probabilities.py to 377 cases of development trials (seeds 611 and 614
// mixed, 612 and 613 outside alone; 296 names). Names that stand alone came true a little more often than
// their posterior said, 232 of 235 against 228; they are left as they are, because the robots of the trial
// are this project's own.
Move move_of(Standing standing) {
  switch (standing) {
    case Standing::alone:
      return {1, 0};
    case Standing::grouped:
      return {0.82, -0.19};
    case Standing::inconclusive:
      return {0.62, -0.71};
    case Standing::outside:
      return {0.95, -2.41};
  }
  return {1, 0};
}

}  // namespace

double stated_probability(double posterior, Standing standing) {
  const double p = std::clamp(posterior, 0.01, 0.99);
  const Move move = move_of(standing);
  return 1 / (1 + std::exp(-move.slope * std::log(p / (1 - p)) - move.shift));
}

}  // namespace joulecast::gap

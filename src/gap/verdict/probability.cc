#include "gap/verdict/probability.h"

#include <cmath>

namespace joulecast::gap {

double stated_probability(double posterior, Standing standing) {
  const ProbabilityBin* below = nullptr;
  for (const ProbabilityBin& bin : probability_table) {
    if (bin.standing != standing) continue;
    if (posterior <= bin.posterior) {
      // Below the lowest bin nothing was learnt: in proportion to it.
      const double from = below == nullptr ? 0 : below->posterior,
                   p = below == nullptr ? 0 : below->probability;
      const double width = bin.posterior - from;
      return width > 0 ? std::lerp(p, bin.probability, (posterior - from) / width) : bin.probability;
    }
    below = &bin;
  }
  return below == nullptr ? posterior : below->probability;
}

}  // namespace joulecast::gap

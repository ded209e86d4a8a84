#pragma once

#include <memory>

#include "gap/posterior/walk.h"

namespace joulecast::gap {

// Contrast of each group: its strength relative to the mean over all rows, as 1 or 0 less the share of the
// rows. Of two groups one contrast is enough.
struct Contrasts {
  std::vector<double> share;  // of the rows, by group
  std::size_t count() const { return share.size() == 2 ? 1 : share.size(); }
  double of(std::size_t contrast, std::size_t group) const {
    const std::size_t own = share.size() == 2 ? 1 : contrast;
    return (group == own ? 1 : 0) - share[own];
  }
};

// The posterior of the differences between groups, about the point of all recordings or runs. A hypothesis is
// that an effect has another strength in one group than in the others.
struct Contrasted {
  std::unique_ptr<posterior::Fit> fit;  // columns: the effects of `base` for each contrast, then themselves
  Contrasts contrasts;
  std::vector<std::size_t> hypothesis;  // of the base's catalogue, of each hypothesis
};

// Groups are those of the data (posterior::Data::group).
Contrasted contrast(const posterior::Fit& base);

}  // namespace joulecast::gap

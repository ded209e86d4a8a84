#pragma once

#include "gap/groups/compare.h"
#include "gap/posterior/data.h"

namespace joulecast::gap {

// The data of a comparison: rows of missions (or runs) in groups (posterior::Data::group).
struct GroupedData {
  posterior::Data data;
  // Of each row of power: J for one of its watts, its part of the way, and energy that is not in its power
  // [J].
  std::vector<double> joule, way_m, offset_j;
};

// Fills effects, difference and diagnosis of a comparison with named groups. Fault::conflict when cancelled.
Result<void> compare_groups(GroupedData grouped, const CompareSettings& settings, Comparison& comparison);

}  // namespace joulecast::gap

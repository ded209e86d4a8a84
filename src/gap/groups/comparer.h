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

// Returns the group of each item by its name, and sets the names of the comparison's groups.
std::vector<std::size_t> name_groups(std::span<const std::string> group_of_item, Comparison& comparison);

// Fills effects, difference and diagnosis of a comparison with named groups.
void compare_groups(GroupedData grouped, const Progress& progress, Comparison& comparison);

}  // namespace joulecast::gap

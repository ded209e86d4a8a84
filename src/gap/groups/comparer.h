#pragma once

#include <functional>
#include <optional>
#include <vector>

#include "gap/diagnose/held_out.h"
#include "gap/groups/compare.h"
#include "gap/groups/contrast.h"

namespace joulecast::gap {

// One thing that was measured: a window of a recording, or a run.
struct Item {
  std::size_t group = 0, block = 0;
  double measured = 0;         // power or energy; NaN: not known
  double weight = 1;           // of its error
  double energy_per_unit = 1;  // J for one of what is measured
  double way_m = 0, time_s = 0;
};

// A comparison without what its data are.
struct GroupedData {
  const robot::RobotModel& robot;
  Problem base{};
  std::vector<std::size_t> group_of_block{};
  std::vector<Item> items{};
  ExplainSettings explain{};    // of differences
  std::vector<Cause> around{};  // everything is linear around these
  // The cause that a hypothesis is with these coefficients.
  std::function<Cause(std::size_t hypothesis, const Eigen::VectorXd& coefficients)> cause{};
  // Of every item, by the model with these causes in its group.
  std::function<std::vector<double>(const std::vector<std::vector<Cause>>& by_group)> predict{};
  // A plain regression, in each group, of `missed` (of each item) on motion, fitted where `use` holds.
  std::function<std::vector<double>(const std::vector<double>& missed, const std::vector<bool>& use)>
      referee{};
  // What the base problem is without these blocks, where that is another one.
  std::function<Problem(const std::vector<bool>& left_out)> without{};
};

// Fills effects, difference and diagnosis of a comparison whose groups are known, with the energies that were
// measured there. False: cancelled.
bool compare_groups(const GroupedData& data, const CompareSettings& settings, Comparison& comparison);

}  // namespace joulecast::gap

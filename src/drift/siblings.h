#pragma once

#include <array>
#include <cstddef>
#include <span>
#include <string>
#include <vector>

#include "drift/marks.h"

namespace joulecast::drift {

// One robot among others of its kind.
struct SiblingRatio {
  std::string robot_id;
  std::size_t missions = 0;
  double ratio = 1;                  // median over its missions
  std::array<double, 2> interval{};  // of the median, 95 %
  double deviation = 0;              // robust standard deviations from the kind's median
  bool stands_out = false;           // more than chance allows, and by more than least_change
};

struct RobotRatios {
  std::string robot_id;
  std::vector<MissionRatio> missions;
};

// Compares the median ratios of robots of one kind; robots with fewer than least_missions missions are left
// out, and among fewer than three none is marked. By robot id.
std::vector<SiblingRatio> compare_siblings(std::span<const RobotRatios> robots, const Settings& settings);

}  // namespace joulecast::drift

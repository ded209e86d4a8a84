#pragma once

#include <cstddef>
#include <span>
#include <string_view>
#include <vector>

#include "dynamics/catalogue.h"
#include "gap/equations/ranges.h"
#include "robot/robot_model.h"
#include "windows/windows.h"

namespace joulecast::gap {

struct Zone {
  double x_m = 0, y_m = 0, radius_m = 0;
};

// The inputs of variants.
struct ShapeSetting {
  const robot::RobotModel& robot;
  const Ranges& ranges;
  std::vector<Zone> zones{};  // found for floor_resistance_zone
  double fastest_rad_s = 0;   // of a wheel, 98 %
  bool battery_alone = false;
};

// One form in which an effect may be present.
struct Variant {
  dynamics::EffectValues<double> values;  // of all parameters but the strength
  std::size_t parameter = 0;              // the strength
  bool two_components = false;            // strength and direction: two columns, a quarter turn apart
};

// Whether the gyro and the map show an effect, which battery power barely depends on.
bool is_kinematic(std::string_view id);

// The forms in which these recordings could show an effect; empty where they cannot.
std::vector<Variant> variants_of(const dynamics::Effect& effect, const ShapeSetting& setting);

}  // namespace joulecast::gap

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

// The shapes that effects are tried with; each is a variant of its effect.
struct Shapes {
  std::vector<Zone> zones;  // found for floor_resistance_zone
  std::vector<double> scrub_rates_rad_s{0.01, 0.03, 0.1, 0.3};
  std::vector<double> stribeck_speeds_m_s;  // empty: parts of the fastest speed of a wheel
  std::vector<double> stribeck_exponents{1, 2};
  std::vector<double> winding_time_constants_s{windows::heat_time_constants_s.begin(),
                                               windows::heat_time_constants_s.end()};
};

// The inputs of variants.
struct ShapeSetting {
  const robot::RobotModel& robot;
  const Ranges& ranges;
  const Shapes& shapes;
  FromMotion from_motion;
};

// One form in which an effect may be present.
struct Variant {
  dynamics::EffectValues<double> values;  // of all parameters but the strength
  std::size_t parameter = 0;              // the strength
  double against = 1;                     // of how many it is one: prior odds are divided by it
  bool two_components = false;            // strength and direction: two columns, a quarter turn apart
};

// Whether the gyro and the map show an effect, which battery power barely depends on.
bool is_kinematic(std::string_view id);

// The forms in which these recordings could show an effect; empty where they cannot.
std::vector<Variant> variants_of(const dynamics::Effect& effect, const ShapeSetting& setting);

}  // namespace joulecast::gap

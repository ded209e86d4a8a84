#pragma once

#include <array>
#include <span>

#include "gap/checks/observation.h"
#include "gap/checks/products.h"
#include "gap/recordings.h"

namespace joulecast::gap {

// One motor by itself, all at the wheel: V = R i + K w + c sgn(w), and the current that it takes at a steady mean
// speed. Robust over blocks of some seconds; unknown where its channels or the motion do not tell.
struct MotorConstants {
  Estimate resistance_ohm;         // R
  Estimate constant_v_s_rad;       // K, gear included
  Estimate drop_v;                 // c
  Estimate steady_current_a;       // at mean_speed_rad_s, driving the way the wheel turns
  Estimate current_per_rad_s2_a;   // for accelerating both wheels alike
  double mean_speed_rad_s = 0;     // while it turns
};

// [0] right, [1] left. The same of every robot of a kind are its siblings' to compare with.
std::array<MotorConstants, 2> motor_constants(std::span<const Observation> observations);
std::array<MotorConstants, 2> motor_constants(const RecordingSet& recordings, const robot::RobotModel& robot);

}  // namespace joulecast::gap

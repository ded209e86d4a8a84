#pragma once

#include <array>
#include <optional>
#include <span>
#include <vector>

#include "gap/checks/observation.h"
#include "gap/checks/products.h"

namespace joulecast::gap {

// One motor by itself, all at the wheel: V = R i + K w + c sgn(w), and the current that it takes at a steady
// mean speed. Robust over blocks of some seconds; unknown where its channels or the motion do not tell.
struct MotorConstants {
  Estimate resistance_ohm;        // R
  Estimate constant_v_s_rad;      // K, gear included
  Estimate drop_v;                // c
  Estimate steady_current_a;      // at mean_speed_rad_s, driving the way the wheel turns
  Estimate current_per_rad_s2_a;  // for accelerating both wheels alike
  double mean_speed_rad_s = 0;    // while it turns
};

// By how much the motors' currents surely lag the wheel speeds: beyond a row and a half and half the time
// that readings are held. Currents that lead are no delay: they do at every start, as contacts bend and gears
// wind up.
std::optional<Delay> motor_delay(std::span<const Observation> observations);

// V on i, w and sign of one motor, or of i and w of the differences of the sides: R, K and c. The speed is
// that of when the electrical readings were taken, w - delay a; where the delay is not known (NaN) it is
// estimated with them.
BlockFit fit_armature(std::span<const Observation> observations, Relation relation, double delay_s);

// [0] right, [1] left. The same of every robot of a kind are its siblings' to compare with.
std::array<MotorConstants, 2> motor_constants(std::span<const Observation> observations, double delay_s);

}  // namespace joulecast::gap

#pragma once

#include <array>
#include <optional>
#include <span>
#include <vector>

#include "plausibility/observation.h"
#include "plausibility/products.h"

namespace joulecast::plausibility {

// Constants of one motor, all at the wheel: V = R i + K w + c sgn(w), and its current at a steady mean speed.
// Robust over blocks of some seconds; unknown where its channels or the motion do not determine them.
struct MotorConstants {
  Estimate resistance_ohm;        // R
  Estimate constant_v_s_rad;      // K, gear included
  Estimate drop_v;                // c
  Estimate steady_current_a;      // at mean_speed_rad_s, positive in the direction of the wheel
  Estimate current_per_rad_s2_a;  // for equal acceleration of both wheels
  double mean_speed_rad_s = 0;    // while it turns
};

// Lag of the motor currents behind the wheel speeds, if its whole interval exceeds a row and a half plus half
// the time for which readings are held. Leading currents are not a delay: currents lead at every start, as
// contacts bend and gears wind up.
std::optional<Delay> motor_delay(std::span<const Observation> observations);

// Regresses V on i, w and sign of one motor, or on i and w of the differences of the sides: R, K and c. The
// speed is taken at the instant of the electrical readings, w - delay a; an unknown delay (NaN) is estimated
// with them.
BlockFit fit_armature(std::span<const Observation> observations, Relation relation, double delay_s);

// [0] right, [1] left. Comparable between robots of one kind.
std::array<MotorConstants, 2> motor_constants(std::span<const Observation> observations, double delay_s);

}  // namespace joulecast::plausibility

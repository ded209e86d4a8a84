#pragma once

#include <optional>
#include <span>

#include "dynamics/catalogue.h"
#include "robot/robot_model.h"
#include "telemetry/log_recordings.h"

namespace joulecast::gap {

// A pattern that repeats with the angle of a wheel: cogging, a tooth, an oval wheel. Windows average it out
// and keep its mean, which then looks like dry friction.
struct Ripple {
  double per_turn = 0;       // cycles a turn of the wheel
  double power_share = 0;    // mean power of the oscillation, over the mean battery power
  double contrast = 0;       // its power over that of neighbouring frequencies
  std::size_t found_in = 0;  // surrogates with a similar line
};

// Searches the residuals of the motor currents, or of the battery power when `motors` is false, sample by
// sample, by the model with these effects (the robot file's among them): the mean periodogram over the
// wheel's angle, in segments of a few turns, on a grid of frequencies. Nothing when no frequency exceeds its
// neighbours beyond chance. A line that is also found after the residuals are shifted along the mission by
// seconds does not belong to the wheel: `surrogates` of such shifts are tried.
std::optional<Ripple> find_ripple(const telemetry::RecordingSet& set, const robot::RobotModel& robot,
                                  std::span<const dynamics::ActiveEffect> effects, bool motors,
                                  std::size_t surrogates);

}  // namespace joulecast::gap

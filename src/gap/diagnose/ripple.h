#pragma once

#include <optional>
#include <span>

#include "dynamics/catalogue.h"
#include "robot/robot_model.h"
#include "telemetry/recording_set.h"

namespace joulecast::gap {

// Something that repeats with the angle of a wheel: cogging, a tooth, an oval wheel. Windows average it out
// and keep its mean, which then looks like dry friction.
struct Ripple {
  double per_turn = 0;         // cycles a turn of the wheel
  double power_share = 0;      // mean power that it moves to and fro, over the mean battery power
  double contrast = 0;         // its power over that of neighbouring frequencies
  std::size_t surrogates = 0;  // with the same leftovers, turned against the wheel's angle,
  std::size_t found_in = 0;    // in which a line stands out as well
};

// Looks for it sample by sample in what the model with these effects (the robot file's among them) leaves of
// the motor currents, or of the battery power when `motors` is false (both read `delay_s` late): the mean
// periodogram over the wheel's angle, in stretches of a few turns, on a grid of frequencies. Nothing when no
// frequency stands out of its neighbours beyond chance. What comes back when the leftovers are moved along
// the mission by seconds does not belong to the wheel: `surrogates` of such moves are tried.
std::optional<Ripple> find_ripple(const telemetry::RecordingSet& set, const robot::RobotModel& robot,
                                  std::span<const dynamics::ActiveEffect> effects, bool motors,
                                  double delay_s, std::size_t surrogates);

}  // namespace joulecast::gap

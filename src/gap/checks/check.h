#pragma once

#include <array>
#include <cstddef>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "gap/checks/observation.h"
#include "robot/robot_model.h"
#include "telemetry/recording_set.h"

// What is wrong with a robot's recordings before any effect is judged: signs, units, scales, channels,
// motors, kinematics, clock and the robot file.
namespace joulecast::gap {

// One thing found, told in a sentence.
struct Check {
  // What kind of thing: "battery_current_reversed", "wheel_velocity_scale", "dead_channel",
  // "constant_channel", "held_samples", "track_against_gyro", "step_between_missions", ...
  std::string id;
  // Field of robot_telemetry_t with the side or part where it has one: "battery_current",
  // "motor_current.right", "wheel_velocity", "pose.heading"; several are separated by ", ". Empty: none.
  // "utime": the clock.
  std::string channel;
  double value = 0;                  // the number that says it: a ratio, a period [s], a step
  std::array<double, 2> interval{};  // of the value, 95 %; NaN where none applies
  std::string says;                  // what was found, against what, its likely cause, what joulecast expects
  // The channel takes no part in the diagnosis. A contradicted "utime" leaves nothing to be diagnosed.
  bool contradicted = false;
  // Of `step_between_missions`: the first mission after the step, in the order given. Missions before it and
  // from it on can be judged apart.
  std::optional<std::size_t> first_mission{};
  // Of what holds for few of several missions: which, in the order given; the channel takes no part there.
  std::vector<std::size_t> few_missions{};
};

// Most fundamental first, about a dozen at most; what follows from another check is not repeated. None needs
// more than the sums of a single pass over each mission (observation.h), so that all can be asked while it
// goes on.
//
// A battery voltage that never moves is told as `constant_channel` and not contradicted where it is near the
// nominal voltage: power is still the current times it, but nothing may be learnt from the voltage itself.
std::vector<Check> check_recordings(const telemetry::RecordingSet& recordings,
                                    const robot::RobotModel& robot);

// The same from observations made before, in the order of the missions.
std::vector<Check> check_observations(std::span<const Observation> observations,
                                      const robot::RobotModel& robot);

// Of these checks those that need one mission alone and no delays, to be asked while it goes on: clock,
// signs, units, sides, silent channels, limits and readings that are thrown for a row. Observations may be
// without lags.
std::vector<Check> check_contradictions(std::span<const Observation> observations,
                                        const robot::RobotModel& robot);

// Missions before a `step_between_missions` and from it on, each side with three at least; empty where no
// check tells of a step. `checks` are of these recordings. Notes and what could not be read belong to the
// whole and stay out.
std::optional<std::array<telemetry::RecordingSet, 2>> split_at_step(const telemetry::RecordingSet& recordings,
                                                                    std::span<const Check> checks);

// NaN for every reading of a contradicted channel, of something that holds for few missions in these. "utime"
// is left as it is.
void silence_contradicted(telemetry::RecordingSet& recordings, std::span<const Check> checks);

}  // namespace joulecast::gap

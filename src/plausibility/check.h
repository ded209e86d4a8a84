#pragma once

#include <array>
#include <cstddef>
#include <limits>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "robot/robot_model.h"
#include "telemetry/log_recordings.h"

// Checks of a robot's recordings before any physics is estimated: signs, units, scales, channels, motors,
// kinematics, the clock and the robot file.
namespace joulecast::plausibility {

struct Observation;

// A finding, described in one sentence.
struct Check {
  // Kind of finding: "battery_current_reversed", "wheel_velocity_scale", "dead_channel", "constant_channel",
  // "held_samples", "track_against_gyro", "step_between_missions", ...
  std::string id;
  // Field of robot_telemetry_t, with its side or part if any: "battery_current", "motor_current.right",
  // "wheel_velocity", "pose.heading"; several are separated by ", ". Empty: none. "utime": the clock.
  std::string channel;
  double value = 0;                  // measured: a ratio, a period [s], a step
  std::array<double, 2> interval{};  // of the value, 95 %; NaN where none applies
  std::string says;                  // the finding, its reference, its likely cause, the expected convention
  // The channel is excluded from the diagnosis. With a contradicted "utime" there is no diagnosis.
  bool contradicted = false;
  // Of `step_between_missions`: the first mission after the step, in the order given. Missions before it and
  // from it on can be diagnosed separately.
  std::optional<std::size_t> first_mission{};
  // Indices of the affected missions, in the order given, if few of several are affected; the channel is
  // excluded there. Empty: all missions.
  std::vector<std::size_t> few_missions{};
  // The factor by which a contradicted channel is wrong: one that at least two independent readings confirm,
  // or that of a sign or unit that is likelier than all other explanations together and agrees with its
  // measurement.
  std::optional<double> factor{};
  bool swapped = false;  // the sides of the channel, or both of its channels, are exchanged
  // Of a sign or unit: probability that the readings have any error in its place and, where the channel is
  // contradicted, that they have this one.
  double error = std::numeric_limits<double>::quiet_NaN();
  double probability = std::numeric_limits<double>::quiet_NaN();
};

// Returns the findings, most fundamental first, about a dozen at most. Consequences of another finding are
// not repeated. Each check needs only the sums of a single pass over each mission (observation.h), so that
// all can run during a mission.
//
// A constant battery voltage near the nominal voltage is reported as `constant_channel` and is not
// contradicted: power is still the current times this voltage, but the voltage itself must not be used for
// estimation.
std::vector<Check> check_recordings(const telemetry::RecordingSet& recordings,
                                    const robot::RobotModel& robot);

// The checks that need one mission only and no delays, for use during a mission: clock, signs, units, sides,
// silent channels, limits and readings that jump for a single row.
std::vector<Check> check_contradictions(std::span<const Observation> observations,
                                        const robot::RobotModel& robot);

// Splits missions into those before a `step_between_missions` and those from it on, at least three on each
// side; empty where no check reports a step. `checks` are of these recordings. Notes and unreadable parts
// belong to the whole set and are left out.
std::optional<std::array<telemetry::RecordingSet, 2>> split_at_step(const telemetry::RecordingSet& recordings,
                                                                    std::span<const Check> checks);

// Takes readings out that the robot cannot have (telemetry/impossible.h) and returns a check for each
// channel, with the number of samples as its value. For recordings before check_recordings.
std::vector<Check> drop_impossible(telemetry::RecordingSet& recordings, const robot::RobotModel& robot);

// Sets every reading of a contradicted channel to NaN, in the affected missions only where few are affected;
// a channel with a factor is divided by it instead, and swapped ones are exchanged. "utime" is unchanged.
void silence_contradicted(telemetry::RecordingSet& recordings, std::span<const Check> checks);

}  // namespace joulecast::plausibility

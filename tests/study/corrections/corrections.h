#pragma once

#include <optional>
#include <string>
#include <vector>

#include "robot/robot_model.h"
#include "telemetry/recording_set.h"

// Errors of units, signs, delays and channels compete, with the physical parameters free, before a diagnosis.
namespace joulecast::gap {

// An error of a channel that explains the readings better than any physical parameters.
struct ReadingCorrection {
  std::string channel;      // field of robot_telemetry_t: "wheel_velocity.left"
  std::string kind;         // scale, sign, rectified, delay, supply or swapped
  double factor = 1;        // of the reading over the truth
  double deviation = 0;     // of a factor that was estimated; NaN of a listed one
  double delay_s = 0;       // of the reading behind the wheels
  double probability = 0;   // of it and of all hypotheses that agree within a fifth
  double contradicted = 0;  // probability that anything is wrong with the channel
  bool applied = false;     // the diagnosis uses corrected readings
  bool left_out = false;    // the channel is wrong, but how is not sure: the diagnosis leaves it out
  std::string says;         // one sentence or two
};

struct CorrectedReadings {
  std::vector<ReadingCorrection> found;               // those at 0.5 or more
  std::optional<telemetry::RecordingSet> recordings;  // corrected; empty: nothing was corrected
  std::size_t hypotheses = 0, fitted = 0;             // single errors, and sets that were not pruned
};

// Finds sets of at most three errors. A channel that is contradicted with a probability of 0.9 or more is
// corrected where the error has a probability of 0.75, and left out otherwise; a supply voltage is left out.
// Delays are found but not removed. A delay below 0.5 s, an offset and a scale of less than a quarter compete
// but are effects, and are not found, and nothing is found without motion. `prune` = false fits every
// hypothesis.
CorrectedReadings correct_readings(const telemetry::RecordingSet& recordings, const robot::RobotModel& robot,
                                   bool prune = true);

}  // namespace joulecast::gap

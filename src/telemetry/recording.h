#pragma once

#include <cmath>
#include <cstddef>
#include <string>
#include <vector>

#include "base/error.h"
#include "dynamics/climb.h"
#include "dynamics/parameters.h"
#include "signals/covariates.h"
#include "signals/gaps.h"
#include "signals/sample.h"
#include "telemetry/event_log.h"

namespace joulecast::telemetry {

// The payload with which a mission's samples are accounted, kg, in their order: the sample's value; if that
// is NaN, the last value of the mission; before the first value, the load declared at the mission's start. A
// robot that leaves its field at 0 and declares a load at the start contradicts itself: such a 0 is treated
// as NaN until a sample of the mission has a load. After that, 0 means that the load was set down.
class MissionPayload {
 public:
  MissionPayload() = default;
  // `declared_kg` at the mission's start, NaN: none. `told`: earlier samples had a load or a valid 0.
  explicit MissionPayload(double declared_kg, bool told = false) : kg_(declared_kg), told_(told) {}

  // Whether the sample's 0 contradicts the mission's start.
  bool contradicts(double said_kg) const { return said_kg == 0 && !told_ && kg_ > 0; }

  // NaN: the sample, the samples before it and the start contain no payload.
  double take(double said_kg) {
    if (std::isnan(said_kg) || contradicts(said_kg)) return kg_;
    told_ = true;
    kg_ = said_kg;
    return kg_;
  }

 private:
  double kg_ = signals::unmeasured;
  bool told_ = false;
};

// One robot's samples over one mission, in time order.
struct Recording {
  std::string robot_id;
  std::string mission_id;
  double payload_kg = signals::unmeasured;
  std::vector<signals::Sample> samples;
  std::vector<signals::CovariateSeries> covariates = {};
  bool implicit = false;  // no STARTED declared it
};

// From the first sample to the last, of a recording that has some.
inline double length_s(const Recording& recording) {
  return 1e-6 * static_cast<double>(recording.samples.back().utime_us - recording.samples.front().utime_us);
}

// Sorts samples by time and drops those with the time of another one; returns the number dropped.
std::size_t put_in_order(std::vector<signals::Sample>& samples);

// Append to the log as the robot would have published it: STARTED at the first sample, every sample with the
// covariates that change by then before it, FINISHED at the last, and that the covariates are unknown from
// there on, so that they do not hold in the recording that follows; stamped with the robot's clock.
// Fault::invalid for a recording without samples or with ids or names out of bounds.
Result<void> write_recording(EventLogWriter& log, const Recording& recording);

// Samples in order of time as dynamics/climb.h reads them, on a robot of these parameters. Pitch that is
// measured less often than samples come is held between gaps.
class ClimbReader {
 public:
  dynamics::ClimbReading at(const dynamics::Parameters<double>& parameters, const signals::Sample& sample,
                            double height_m, signals::Step step);

 private:
  signals::HeldReading pitch_;
};

// The climb at each sample of a recording (dynamics::climb_along): from its pitch, else covariate height_m.
[[nodiscard]] std::vector<double> climb_of(const Recording& recording,
                                           const dynamics::Parameters<double>& parameters);

}  // namespace joulecast::telemetry

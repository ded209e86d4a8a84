#pragma once

#include "base/error.h"
#include "gap/verdict/diagnosis.h"
#include "telemetry/log_recordings.h"

namespace joulecast::gap {

// Takes out readings that the robot cannot have; divides or exchanges those of contradicted channels where
// the error is known, and sets them to NaN otherwise; divides a wrong wheel radius. Returns the checks, with
// a sentence on what was corrected.
std::vector<Check> check_and_correct(telemetry::RecordingSet& recordings, robot::RobotModel& robot);

// Moves voltages and currents back by their delay relative to the other channels [s]; negative: they lead.
// Linear between rows; NaN where the moved reading is outside the mission. `battery_alone`: those of the
// battery, else those of the motors, too.
void move_back(telemetry::Recording& mission, double delay_s, bool battery_alone);

// Diagnoses recordings of one robot. Fault::invalid for unusable recordings or a robot file with effects that
// the catalogue rejects, Fault::conflict when cancelled.
Result<Diagnosis> diagnose(const telemetry::RecordingSet& recordings, const robot::RobotModel& robot,
                           const Progress& progress = {});

}  // namespace joulecast::gap

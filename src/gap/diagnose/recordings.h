#pragma once

#include <functional>

#include "base/error.h"
#include "gap/verdict/diagnosis.h"
#include "telemetry/recording_set.h"

namespace joulecast::gap {

struct DiagnosisSettings {
  std::function<bool(double)> progress;  // called with 0..1; false cancels
};

// Diagnoses recordings of one robot. Fault::invalid for unusable recordings or a robot file with effects that
// the catalogue rejects, Fault::conflict when cancelled.
Result<Diagnosis> diagnose(const telemetry::RecordingSet& recordings, const robot::RobotModel& robot,
                           const DiagnosisSettings& settings = {});

}  // namespace joulecast::gap

#pragma once

#include <functional>

#include "base/error.h"
#include "gap/verdict/diagnosis.h"
#include "telemetry/recording_set.h"

namespace joulecast::gap {

struct DiagnosisSettings {
  std::size_t controls = 20;             // surrogates for each finding; 0: none are made
  std::size_t threads = 1;               // that controls may take
  double prior_factor = 1;               // on what strengths are expected to differ by in a robot as filed
  std::function<bool(double)> progress;  // called with 0..1; false cancels
};

// From recordings of one robot. Fault::invalid for unusable recordings or a robot file whose effects the
// catalogue rejects, Fault::conflict when cancelled.
Result<Diagnosis> diagnose(const telemetry::RecordingSet& recordings, const robot::RobotModel& robot,
                           const DiagnosisSettings& settings = {});

}  // namespace joulecast::gap

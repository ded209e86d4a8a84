#pragma once

#include <cstdint>
#include <string>

#include "signals/sample.h"

namespace joulecast::signals {

enum class MissionPhase : std::int8_t { started = 1, finished = 2, aborted = 3 };

// mission_event_t, free of LCM.
struct MissionEvent {
  std::int64_t utime_us = 0;
  std::string mission_id;
  MissionPhase phase = MissionPhase::started;
  double payload_kg = unmeasured;
  std::string note;
};

}  // namespace joulecast::signals

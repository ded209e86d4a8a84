#include <cstring>

#include "fuzz.h"
#include "signals/sample.h"
#include "telemetry/mission_tracker.h"
#include "telemetry/sequence_tracker.h"
#include "telemetry/validation.h"

using namespace joulecast;

// A step has nine bytes: the kind of input and a number. Missions open and close alternately, and current()
// is set while one is open.
JOULECAST_FUZZ_TARGET(missions) {
  telemetry::MissionTracker missions;
  telemetry::SequenceTracker sequence;
  bool open = false;
  const auto carry_out = [&](const telemetry::MissionActions& actions) {
    for (const telemetry::MissionAction& action : actions) {
      testing::require(open == (action.kind == telemetry::MissionAction::Kind::close));
      open = !open;
    }
    testing::require(open == missions.current().has_value());
  };
  for (std::size_t at = 0; at + 9 <= size; at += 9) {
    std::int64_t number = 0;
    std::memcpy(&number, data + at + 1, sizeof number);
    // Any time that passes validation, or one within the same minutes.
    const std::int64_t utime_us = data[at] & 16 ? std::abs(number % telemetry::year_2200_us)
                                                : 1'700'000'000'000'000 + number % 100'000'000;
    switch (data[at] % 5) {
      case 0:
        carry_out(missions.on_sample(utime_us, 0).actions);
        (void)sequence.place(number % 1000, utime_us);
        break;
      case 1:
        carry_out(missions.on_silence(std::abs(number % 1'000'000'000)));
        break;
      case 2:
        missions.on_clock_step(utime_us);
        break;
      default:
        signals::MissionEvent event;
        event.utime_us = utime_us;
        event.mission_id = "m" + std::to_string(data[at] / 5 % 4);
        event.phase = static_cast<signals::MissionPhase>(1 + data[at + 1] % 3);
        carry_out(missions.on_event(event));
    }
  }
}

#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "battery/charge_filter.h"
#include "battery/charging.h"
#include "robot/robot_model.h"
#include "signals/sample.h"

namespace joulecast::ingest {

// The state of a robot's battery at one moment.
struct ChargeView {
  battery::ChargeEstimate estimate;
  battery::ChargingPhase phase = battery::ChargingPhase::none;
  battery::ChargingStay stay;     // the present or the last one
  battery::ChargingTime to_full;  // until the charger's end; away from it, if the robot went there now
  battery::ChargingHabit habit;
};

// Removes the samples that a ChargeWatch would assign to the charger; returns how many it removed.
// `capacity_ah` is that of the robot's battery.
std::size_t drop_charging(double capacity_ah, std::vector<signals::Sample>& samples);

// Estimates one robot's state of charge and detects its stays at chargers. Its memory survives restarts.
class ChargeWatch {
 public:
  explicit ChargeWatch(const robot::RobotModel& robot);

  // The owner of a sample. A robot at rest with current into its battery may be charging: its samples wait
  // until that is decided, two seconds at most.
  enum class Share { robot, undecided, charger };

  // Samples in order of time; `modelled_power_w` replaces an unmeasured current (NaN: not available).
  Share add(const signals::Sample& sample, double modelled_power_w);
  void interrupt() { tracker_.interrupt(); }

  ChargeView view() const;
  const battery::ChargeEstimate& estimate() const { return tracker_.estimate(); }
  std::optional<battery::ChargingStay> take_ended() { return charging_.take_ended(); }

  // The state that must survive a restart, and its restoration. A `text` of another form changes nothing.
  std::string memory_json() const;
  void recall(const std::string& text);
  // The charge as last stored, where that is newer than the memory.
  void recall(std::int64_t utime_us, double charge);
  // The robot's time up to which the memory extends; 0 before the first sample.
  std::int64_t utime_us() const { return utime_us_; }

  // Goes on under another model of the same robot.
  void take_over(const ChargeWatch& old);

 private:
  battery::ChargeTracker tracker_;
  battery::ChargingObserver charging_;
  std::int64_t utime_us_ = 0;
};

}  // namespace joulecast::ingest

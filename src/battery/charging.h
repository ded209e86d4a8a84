#pragma once

#include <cstdint>
#include <limits>
#include <optional>
#include <string_view>

namespace joulecast::battery {

// A quantity observed a few times: mean and spread, the latest counting at least a twelfth.
struct Seen {
  double count = 0;
  double mean = 0;
  double variance = 0;

  void add(double value);
};

// How a robot's charger treats its battery: a constant current up to some charge, then a constant voltage
// under which the current dies away exponentially, to an end.
struct ChargingHabit {
  Seen current_a;      // of the first part, into the battery
  Seen taper_charge;   // charge at which the current begins to fall, 0 to 1
  Seen taper_time_s;   // in which it falls to 1/e
  Seen end_current_a;  // at which charging ends
};

struct ChargingTime {
  double duration_s = std::numeric_limits<double>::quiet_NaN();
  double sd_s = std::numeric_limits<double>::quiet_NaN();
};

// Time from a charge to the charger's end, by the habit. Quantities not yet observed have usual values (the
// taper begins at 0.85 +- 0.08 of the charge, charging ends at a twentieth of the current) with a matching
// deviation. NaN while no current was observed.
ChargingTime time_to_full(const ChargingHabit& habit, double capacity_ah, double charge, double charge_sd);

enum class ChargingPhase { none, suspected, constant_current, taper, full };
std::string_view name(ChargingPhase phase);
// Whether a charger feeds the robot, or has filled its battery; not where that is only suspected.
constexpr bool at_charger(ChargingPhase phase) {
  return phase != ChargingPhase::none && phase != ChargingPhase::suspected;
}

// One stay at a charger.
struct ChargingStay {
  std::int64_t start_utime_us = 0;
  std::int64_t end_utime_us = 0;
  double start_charge = std::numeric_limits<double>::quiet_NaN();
  double charged_ah = 0;  // into the battery
  double charged_j = 0;   // at its terminals
  bool complete = false;  // to the charger's end
};

// Distinguishes charging from regeneration, follows it, and learns the charger's habit: current into the
// battery of a robot that stands. Depends on the readings' clock alone.
class ChargingObserver {
 public:
  explicit ChargingObserver(double capacity_ah) : capacity_ah_(capacity_ah) {}

  struct Reading {
    std::int64_t utime_us = 0;
    double voltage_v = std::numeric_limits<double>::quiet_NaN();
    double current_a = std::numeric_limits<double>::quiet_NaN();  // positive discharging
    bool moving = false;
    double charge = std::numeric_limits<double>::quiet_NaN();
  };
  // Readings in order of time. Returns the phase that the reading belongs to: after `suspected` comes either
  // a charging phase, which began with the first suspected reading, or `none`.
  ChargingPhase add(const Reading& reading);

  ChargingPhase phase() const { return phase_; }
  bool charging() const {
    return phase_ == ChargingPhase::constant_current || phase_ == ChargingPhase::taper;
  }
  const ChargingStay& stay() const { return stay_; }  // the present or the last one
  // The stay that has ended since the last call.
  std::optional<ChargingStay> take_ended();
  double current_a() const { return smooth_a_; }  // into the battery, smoothed

  // Time until the charger's end, from this stay and earlier ones; NaN unless charging.
  ChargingTime remaining(double charge, double charge_sd) const;

  const ChargingHabit& habit() const { return habit_; }
  void recall(const ChargingHabit& habit) { habit_ = habit; }

 private:
  void begin(const Reading& reading);
  void follow(const Reading& reading, double interval_s);
  void end(bool complete);
  double least_current_a() const;
  std::optional<double> observed_taper_s() const;

  double capacity_ah_;
  ChargingPhase phase_ = ChargingPhase::none;
  ChargingHabit habit_;
  ChargingStay stay_;
  std::optional<ChargingStay> ended_;
  std::optional<Reading> last_;
  double phase_s_ = 0;   // since the suspicion began
  double absent_s_ = 0;  // without charging current
  double smooth_a_ = 0, plateau_a_ = 0;
  double fallen_s_ = 0;       // below the plateau
  double fallen_charge_ = 0;  // charge when that began
  // Regression of the logarithm of the current over time in the taper.
  double taper_s_ = 0, n_ = 0, t_ = 0, tt_ = 0, y_ = 0, ty_ = 0, first_log_ = 0;
};

}  // namespace joulecast::battery

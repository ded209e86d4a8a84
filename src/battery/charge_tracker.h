#pragma once

#include <cstdint>
#include <limits>
#include <optional>
#include <string>
#include <string_view>

#include "battery/charge_filter.h"

namespace joulecast::battery {

// One robot's battery at one instant; NaN: not measured.
struct ChargeReading {
  std::int64_t utime_us = 0;
  double voltage_v = std::numeric_limits<double>::quiet_NaN();
  double current_a = std::numeric_limits<double>::quiet_NaN();
  double modelled_power_w =
      std::numeric_limits<double>::quiet_NaN();  // used where the current is not measured
};

// The present source of the charge.
enum class ChargeSource { unknown, voltage_and_current, voltage_and_model, current, model };
std::string_view name(ChargeSource source);

struct ChargeEstimate {
  double charge = std::numeric_limits<double>::quiet_NaN();
  double sd = std::numeric_limits<double>::quiet_NaN();
  ChargeSource source = ChargeSource::unknown;
  bool default_curve = false;  // the robot file has no open-circuit curve: a typical one is used
  bool flat_curve = false;     // here the voltage barely depends on the charge: it is only counted
  double current_bias_a = 0;
  double current_bias_sd_a = std::numeric_limits<double>::quiet_NaN();
};

// Why the voltage determines the charge poorly, as a sentence; empty where it does not.
std::string limitation_of(const ChargeEstimate& estimate);

// The charge filter over time: takes a robot's readings as they arrive, averages them, and bridges missing
// ones (current by the model's power, voltage by counting, silence by a larger deviation). Depends only on
// the readings' clock.
class ChargeTracker {
 public:
  ChargeTracker(const robot::Battery& battery, double idle_power_w);

  // Readings in order of time.
  void add(const ChargeReading& reading);
  // Call when the clock was set: the time between the last reading and the next is unknown.
  void interrupt() { last_.reset(); }
  // Call when the charger has ended: the battery is full.
  void observe_full();

  const ChargeEstimate& estimate() const { return estimate_; }
  const ChargeFilter& filter() const { return filter_; }

  struct Memory {
    ChargeFilter::Memory filter;
    std::int64_t utime_us = 0;  // of the last reading in it
  };
  std::optional<Memory> memory() const;  // absent before the first reading
  // To be called before the first reading. False when the memory is invalid.
  bool recall(const Memory& memory);

 private:
  void update();
  void refresh();

  ChargeFilter filter_;
  double idle_power_w_;
  bool default_curve_;
  ChargeSource source_ = ChargeSource::unknown;
  ChargeEstimate estimate_;
  std::optional<ChargeReading> last_;
  std::int64_t counted_utime_us_ = 0;  // up to which the filter has come
  // Sums since then.
  double duration_s_ = 0, charge_as_ = 0, modelled_as_ = 0, voltage_vs_ = 0, voltage_s_ = 0;
};

}  // namespace joulecast::battery

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "plausibility/evaluation.h"
#include "plausibility/motors.h"

namespace joulecast::plausibility {
namespace {

Check delay_check(const char* id, const char* channel, const char* name, const Delay& delay,
                  const char* against = "the wheel speeds") {
  return {id,
          channel,
          delay.value_s,
          delay.interval,
          fmt::format("{} {} {} by {:.0f} ms ({:.0f} to {:.0f}): joulecast expects the readings "
                      "of one message "
                      "to be of one instant.",
                      name, delay.value_s > 0 ? "lag" : "lead", against, 1e3 * std::fabs(delay.value_s),
                      1e3 * std::min(std::fabs(delay.interval[0]), std::fabs(delay.interval[1])),
                      1e3 * std::max(std::fabs(delay.interval[0]), std::fabs(delay.interval[1]))),
          false};
}

}  // namespace

void check_delays(const CheckContext& c, Checks& checks) {
  if (!c.heard({0, 1})) return;
  constexpr std::array motors{Late::current_right, Late::current_left};
  constexpr std::array battery{Late::battery_power}, by_motors{Late::battery_by_motors}, yaw{Late::yaw_rate};
  std::optional<Delay> late;
  if (c.heard({4, 5})) {
    if ((late = motor_delay(c.seen)))
      checks.push_back(delay_check("electrical_delay", "motor_current", "The motor currents", *late));
  }
  if (c.heard({reading::battery_voltage, reading::battery_current})) {
    const double least = least_delay_s(c.seen, {reading::battery_voltage, reading::battery_current});
    const auto behind = c.heard({2, 3, 4, 5}) ? delay_of(c.seen, by_motors) : std::nullopt;
    // If the motor currents lead, the shape of the load causes the apparent delay.
    const auto own = c.has({4, 5}) ? delay_of(c.seen, motors) : std::nullopt;
    const auto d = delay_of(c.seen, battery);
    // Wrong currents differ in shape from the battery's power; every lag then fits a little. The interval
    // must be narrow.
    const bool sharp = behind && behind->interval[1] - behind->interval[0] < 0.5 * std::fabs(behind->value_s);
    if (sharp && (behind->interval[0] > least || behind->interval[1] < -least)) {
      checks.push_back(delay_check("electrical_delay", "battery_current",
                                   "Voltage and current of the battery", *behind, "the motors' power"));
    } else if (!late && d && d->interval[0] > least && !(own && own->interval[1] < 0)) {
      checks.push_back(
          delay_check("electrical_delay", "battery_current", "Voltage and current of the battery", *d));
    }
  }
  if (!c.heard({reading::yaw_rate})) return;
  const double least = least_delay_s(c.seen, {reading::yaw_rate});
  if (const auto d = delay_of(c.seen, yaw); d && (d->interval[0] > least || d->interval[1] < -least)) {
    checks.push_back(delay_check("yaw_rate_delay", "yaw_rate", "The gyro's readings", *d));
  }
}

}  // namespace joulecast::plausibility

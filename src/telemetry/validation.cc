#include "telemetry/validation.h"

#include <fmt/format.h>

#include <array>
#include <cmath>
#include <cstddef>

namespace joulecast::telemetry {
namespace {

// In the order of signals::sample_fields.
constexpr std::array<PlausibleRange, signals::sample_numbers> ranges{{
    {"wheel_velocity[0]", -1e3, 1e3},  // rad/s: 100 m/s on a 0.1 m wheel
    {"wheel_velocity[1]", -1e3, 1e3},
    {"motor_voltage[0]", -1e3, 1e3},  // V
    {"motor_voltage[1]", -1e3, 1e3},
    {"motor_current[0]", -2e3, 2e3},  // A
    {"motor_current[1]", -2e3, 2e3},
    {"battery_voltage", -1.0, 1e3},      // V; an offset of a sensor may read just below zero
    {"battery_current", -2e3, 2e3},      // A
    {"velocity_command[0]", -100, 100},  // m/s
    {"velocity_command[1]", -1e3, 1e3},  // rad/s
    {"yaw_rate", -100, 100},  // rad/s: five times the range of a common gyro of 2000 deg/s, rounded
    {"pitch", -3.2, 3.2},     // rad: just over half a turn either way
    {"pose[0]", -1e7, 1e7},   // m: map frames may carry a projection's easting and northing
    {"pose[1]", -1e7, 1e7},
    {"pose[2]", -1e6, 1e6},              // rad: headings may be unwrapped
    {"motor_temperature[0]", -90, 500},  // degrees Celsius
    {"motor_temperature[1]", -90, 500},
    {"payload_mass", 0, 1e5},  // kg
}};

constexpr std::size_t wheel_channels = 2;

// Units that are mistaken for those wanted, and how many of them make one.
struct MistakenUnit {
  std::string_view field, unit;
  double factor;
};
constexpr MistakenUnit mistaken_units[] = {{"motor_voltage", "mV", 1000},
                                           {"motor_current", "mA", 1000},
                                           {"battery_voltage", "mV", 1000},
                                           {"battery_current", "mA", 1000},
                                           {"yaw_rate", "degrees a second", 57.3},
                                           {"pitch", "degrees", 57.3},
                                           {"payload_mass", "g", 1000},
                                           {"wheel_velocity", "rpm of the motor shaft", 9.55}};

std::string_view mistaken_unit(const Implausible& fault, const PlausibleRange& range) {
  for (const MistakenUnit& u : mistaken_units) {
    const double value = fault.value / u.factor;
    if (range.field.starts_with(u.field) && value >= range.low && value <= range.high) return u.unit;
  }
  return {};
}

std::optional<Implausible> check_clock(std::int64_t utime_us) noexcept {
  if (utime_us >= 0 && utime_us < year_2200_us) return std::nullopt;
  return Implausible{Implausibility::bad_clock, "utime", static_cast<double>(utime_us)};
}

std::optional<Implausible> check_value(double value, const PlausibleRange& range, bool required) noexcept {
  if (value >= range.low && value <= range.high) return std::nullopt;
  if (std::isnan(value)) {
    if (!required) return std::nullopt;
    return Implausible{Implausibility::missing, range.field, value};
  }
  return Implausible{std::isinf(value) ? Implausibility::infinite : Implausibility::out_of_range, range.field,
                     value};
}

}  // namespace

std::span<const PlausibleRange> plausible_ranges() noexcept {
  return ranges;
}

std::optional<Implausible> check_plausible(const signals::Sample& sample) noexcept {
  if (auto fault = check_clock(sample.utime_us)) return fault;
  if (sample.sequence < 0)
    return Implausible{Implausibility::bad_sequence, "sequence", static_cast<double>(sample.sequence)};
  const auto values = signals::numbers_of(sample);
  for (std::size_t i = 0; i < values.size(); ++i)
    if (auto fault = check_value(*values[i], ranges[i], i < wheel_channels)) return fault;
  return std::nullopt;
}

std::optional<Implausible> check_plausible(const signals::MissionEvent& event) noexcept {
  if (auto fault = check_clock(event.utime_us)) return fault;
  return check_value(event.payload_kg, ranges.back(), false);
}

std::optional<Implausible> check_plausible(const signals::CovariateMessage& message) noexcept {
  return check_clock(message.utime_us);
}

std::optional<Implausible> check_plausible(const signals::Covariate& covariate) noexcept {
  const double value = covariate.value;
  if (std::isinf(value)) return Implausible{Implausibility::infinite, "value", value};
  if (signals::is_label(covariate.name) && !std::isnan(value) && value != 0 && value != 1)
    return Implausible{Implausibility::out_of_range, "value", value};
  return std::nullopt;
}

std::string describe(const Implausible& fault) {
  std::string text(fault.field);
  switch (fault.why) {
    case Implausibility::missing:
      return text + " must be measured";
    case Implausibility::infinite:
      return text + " is infinite";
    case Implausibility::bad_clock:
      return text + " lies before 1970 or after 2200" + (fault.value > 0 ? "; is it in ns?" : "");
    case Implausibility::bad_sequence:
      return text + " is negative";
    case Implausibility::out_of_range:
      break;
  }
  for (const PlausibleRange& range : ranges) {
    if (range.field != fault.field) continue;
    text += fmt::format(" is {:.6g}; no robot reports values outside {:g} to {:g}", fault.value, range.low,
                        range.high);
    if (const std::string_view unit = mistaken_unit(fault, range); !unit.empty())
      text.append("; is it in ").append(unit).append("?");
    return text;
  }
  return text + " of a label is neither 0 nor 1";
}

}  // namespace joulecast::telemetry

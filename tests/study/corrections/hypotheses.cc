#include "tests/study/corrections/hypotheses.h"

#include <fmt/format.h>

#include <cmath>
#include <limits>
#include <numbers>

#include "gap/diagnose/late_battery.h"

namespace joulecast::gap::corrections {
namespace {

using Q = Quantity;
using K = Kind;

constexpr double pi = std::numbers::pi, nan = std::numeric_limits<double>::quiet_NaN();

// Log prior odds: 1 in 1,000 for a common error, 1 in 3,000 for an odd one, 1 in 20,000 for factors of 2 or 4
// of a current, a voltage or one side, which have no known reason.
constexpr double common = -6.9, odd = -8.1, rare = -9.9;

constexpr double least_factor = 1.25;  // nearer to 1 a scale is a matter of calibration

class List {
 public:
  void scale(Q of, double factor, std::string cause, double log_prior,
             std::array<bool, 2> side = {true, true}) {
    if (std::fabs(std::log(factor)) > std::log(least_factor))
      all.push_back({of, K::scale, side, factor, 0, std::move(cause), log_prior});
  }
  void free(Q of, double log_prior, std::array<bool, 2> side = {true, true}) {
    all.push_back({of, K::scale, side, nan, 0, "", log_prior});
  }
  void sign(Q of, std::array<bool, 2> side = {true, true}) {
    all.push_back({of, K::sign, side, -1, 0, "with the opposite sign", common});
  }
  void kind(Q of, K kind, std::string cause, double log_prior, double delay_s = 0) {
    all.push_back(
        {of, kind, {true, true}, kind == K::offset ? nan : 1, delay_s, std::move(cause), log_prior});
  }
  std::vector<Hypothesis> all;
};

constexpr std::array<std::array<bool, 2>, 2> one_side{{{true, false}, {false, true}}};

void add_wheels(List& list, const robot::RobotModel& robot) {
  const double r = robot.kinematics.wheel_radius_m, g = robot.motor.gear_ratio, rpm = 30 / pi;
  const Q w = Q::wheel_velocity;
  list.scale(w, rpm, "in rpm", common);
  list.scale(w, 1 / rpm, "as if they had been converted from rpm twice", odd);
  list.scale(w, 1 / (2 * pi), "in revolutions a second", common);
  list.scale(w, 2 * pi, "as if they had been multiplied by 2 pi twice", odd);
  list.scale(w, 60, "per minute instead of per second", odd);
  list.scale(w, 180 / pi, "in degrees a second", common);
  list.scale(w, r, "in m/s", common);
  list.scale(w, 3.6 * r, "in km/h instead of rad/s", odd);
  list.scale(w, 1e3 * r, "in mm/s", odd);
  list.scale(w, 3.6, "in km/h", common);
  list.scale(w, 1 / 3.6, "as if they had been converted from km/h twice", odd);
  list.scale(w, g, "at the motor shaft", common);
  list.scale(w, 1 / g, "as if they had been divided by the gear ratio twice", odd);
  list.scale(w, g * rpm, "at the motor shaft in rpm", odd);
  for (const double f : {2.0, 0.5, 4.0, 0.25})
    list.scale(w, f, fmt::format("with {:.3g} times the counts of a turn", f), common);
  list.scale(w, 1e3, "in thousandths", odd);
  list.scale(w, 1e-3, "as if they had been divided by 1000 twice", odd);
  list.free(w, odd);
  list.sign(w);
  list.kind(w, K::swapped, "with right and left exchanged", odd);
  for (const auto& side : one_side) {
    list.sign(w, side);
    list.free(w, odd, side);
    for (const double f : {2.0, 0.5, 4.0, 0.25})
      list.scale(w, f, fmt::format("with {:.3g} times the counts of a turn", f), rare, side);
  }
}

void add_motors(List& list, const Measured& measured) {
  for (const Q of : {Q::motor_voltage, Q::motor_current}) {
    if (!(of == Q::motor_voltage ? measured.motor_voltages : measured.motor_currents)) continue;
    list.scale(of, 1e3, of == Q::motor_voltage ? "in mV" : "in mA", common);
    list.scale(of, 1e-3, "as if they had been divided by 1000 twice", odd);
    for (const double f : {2.0, 0.5}) list.scale(of, f, "", rare);
    list.free(of, odd);
    list.sign(of);
    list.kind(of, K::swapped, "with right and left exchanged", odd);
    for (const auto& side : one_side) {
      list.sign(of, side);
      list.free(of, odd, side);
    }
  }
  if (measured.motor_currents) {
    if (!measured.motor_currents_negative)
      list.kind(Q::motor_current, K::rectified, "without their sign", common);
    list.kind(Q::motor_current, K::offset, "with an offset", odd);
  }
  if (measured.motor_voltages && measured.battery_voltage)
    list.kind(Q::motor_voltage, K::supply, "as the voltage of their supply", common);
}

void add_battery(List& list, const robot::RobotModel& robot, const Measured& measured) {
  const auto decimals = [&](Q of, const char* milli) {
    list.scale(of, 1e3, milli, common);
    list.scale(of, 1e-3, "as if it had been divided by 1000 twice", odd);
    list.scale(of, 10, "in tenths", odd);
    list.scale(of, 100, "in hundredths", odd);
    list.scale(of, 0.1, "in tens", odd);
    list.scale(of, 0.01, "in hundreds", odd);
    for (const double f : {2.0, 0.5}) list.scale(of, f, "", rare);
  };
  if (measured.battery_voltage) decimals(Q::battery_voltage, "in mV");
  if (!measured.battery_current) return;
  const Q i = Q::battery_current;
  decimals(i, "in mA");
  list.scale(i, robot.battery.nominal_voltage_v, "in W", common);
  for (const double f : {4.0, 0.25}) list.scale(i, f, "", rare);
  list.free(i, rare);
  list.sign(i);
  if (!measured.battery_current_negative) list.kind(i, K::rectified, "without its sign", common);
  for (const double d : {0.2, 0.3, 0.5, 1.0, 2.0}) {
    if (d > measured.battery_period_s) list.kind(Q::battery_power, K::delay, "late", -8, d);
  }
}

}  // namespace

bool Hypothesis::free() const {
  return std::isnan(factor);
}

double Hypothesis::factor_at(double value) const {
  return kind == K::offset ? 1 : free() ? std::exp(value) : factor;
}

bool Hypothesis::excludes(const Hypothesis& other) const {
  if ((kind == K::offset) != (other.kind == K::offset) || of != other.of) return false;
  return (side[0] && other.side[0]) || (side[1] && other.side[1]);
}

std::string Hypothesis::channel() const {
  constexpr std::array names{"wheel_velocity",  "motor_voltage", "motor_current", "battery_voltage",
                             "battery_current", "battery_power", "yaw_rate",      "pose.position",
                             "pose.heading",    "pitch"};
  std::string name = names.at(static_cast<std::size_t>(of));
  if (side[0] != side[1]) name += side[0] ? ".right" : ".left";
  return name;
}

std::string_view name_of(Kind kind) {
  constexpr std::array<std::string_view, 7> names{"scale",  "sign",   "rectified", "delay",
                                                  "offset", "supply", "swapped"};
  return names.at(static_cast<std::size_t>(kind));
}

std::vector<Hypothesis> hypotheses_for(const robot::RobotModel& robot, const Measured& measured) {
  List list;
  const double degrees = 180 / pi;
  add_wheels(list, robot);
  add_motors(list, measured);
  add_battery(list, robot, measured);
  if (measured.yaw_rate) {
    list.scale(Q::yaw_rate, degrees, "in degrees a second", common);
    list.scale(Q::yaw_rate, 1 / degrees, "as if it had been converted from degrees twice", odd);
    list.sign(Q::yaw_rate);
    list.free(Q::yaw_rate, odd);
    list.kind(Q::yaw_rate, K::offset, "with an offset", odd);
  }
  if (measured.position) {
    list.scale(Q::position, 1e3, "in mm", common);
    list.scale(Q::position, 100, "in cm", odd);
  }
  for (const Q of : {Q::heading, Q::pitch}) {
    if (!(of == Q::heading ? measured.heading : measured.pitch)) continue;
    list.sign(of);
    list.scale(of, degrees, "in degrees", common);
  }
  return std::move(list.all);
}

double current_sign(double voltage_v, double speed_rad_s, double constant_v_s_rad) {
  const double drop = voltage_v - constant_v_s_rad * speed_rad_s;
  return (std::isfinite(drop) ? drop : speed_rad_s) < 0 ? -1 : 1;
}

void leave_out(const Hypothesis& error, telemetry::Recording& recording) {
  Hypothesis all = error;
  all.kind = K::scale;
  all.factor = nan;
  remove_error(all, nan, {}, {}, recording);
}

void remove_error(const Hypothesis& error, double value, const robot::RobotModel& robot,
                  std::span<const std::uint8_t> returned, telemetry::Recording& recording) {
  if (error.kind == K::delay) return move_battery_back(recording, error.delay_s);
  const double factor = error.factor_at(value), offset = error.kind == K::offset ? value : 0;
  const double constant = robot.motor.voltage_constant_v_s_rad * robot.motor.gear_ratio;
  for (std::size_t k = 0; k < recording.samples.size(); ++k) {
    signals::Sample& s = recording.samples[k];
    const auto both = [&](std::array<double, 2>& reading) {
      if (error.kind == K::swapped) std::swap(reading[0], reading[1]);
      for (const std::size_t side : {0u, 1u}) {
        if (error.side[side]) reading[side] = (reading[side] - offset) / factor;
      }
    };
    switch (error.of) {
      case Q::wheel_velocity:
        both(s.wheel_velocity_rad_s);
        break;
      case Q::motor_voltage:
        both(s.motor_voltage_v);
        break;
      case Q::motor_current:
        both(s.motor_current_a);
        for (const std::size_t side : {0u, 1u}) {
          if (error.kind == K::rectified)
            s.motor_current_a[side] =
                std::fabs(s.motor_current_a[side]) *
                current_sign(s.motor_voltage_v[side], s.wheel_velocity_rad_s[side], constant);
        }
        break;
      case Q::battery_voltage:
        s.battery_voltage_v /= factor;
        break;
      case Q::battery_current:
        s.battery_current_a /= factor;
        if (error.kind == K::rectified && returned[k] != 0)
          s.battery_current_a = -std::fabs(s.battery_current_a);
        break;
      case Q::yaw_rate:
        s.yaw_rate_rad_s = (s.yaw_rate_rad_s - offset) / factor;
        break;
      case Q::position:
        s.pose[0] /= factor;
        s.pose[1] /= factor;
        break;
      case Q::heading:
        s.pose[2] /= factor;
        break;
      case Q::pitch:
        s.pitch_rad /= factor;
        break;
      case Q::battery_power:
        break;
    }
  }
}

}  // namespace joulecast::gap::corrections

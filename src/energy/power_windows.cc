#include "energy/power_windows.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <string>
#include <utility>

#include "base/try.h"
#include "windows/track.h"

namespace joulecast::energy {
namespace {

constexpr std::size_t fewest_windows = 40;
constexpr std::size_t most_windows = 3000;  // more add little information and make a fit slow
constexpr std::size_t fewest_blocks = 4;    // of 15 s or more
// Rows as far apart as this [s] show parts of a ramp: the motion is then known between rows only.
constexpr double far_apart_s = 0.125;
constexpr std::size_t rows_a_window = 4;  // where rows are far apart

// Standard deviations of a value from a data sheet, a scale or a sketch, relative to the file's value:
// assumed, on the wide side. Parameters that the recordings show well do not depend on them.
constexpr double file_side = 0.3;        // of the friction, one side against the other
constexpr double file_inertia = 0.5;     // rotors are often left out, bodies of cars are guessed
constexpr double file_resistance = 0.5;  // cold against warm is a third of it
constexpr double file_scrub = 1;         // coefficient; a long wheel base has more than its rubber
constexpr double file_driver = 0.05;     // of the motors' power
constexpr double file_unreturned = 0.5;  // of the braking power
constexpr double least_share = 0.05;     // of the file's inertia and resistance: a bound, as none is without

// The yaw inertia of the wheels on their axle, the lower bound in robot files.
double least_yaw_inertia(const robot::RobotModel& robot) {
  const double d = robot.kinematics.com_offset_m, l = robot.kinematics.half_track_m;
  return std::max(least_share * robot.mass.yaw_inertia_kg_m2,
                  1.0001 * (robot.mass.chassis_kg * d * d + 2 * robot.mass.wheel_kg * l * l));
}

dynamics::ActiveEffect effect_of(std::string_view id, double strength) {
  dynamics::ActiveEffect effect = dynamics::initial(*dynamics::find_effect(id));
  effect.values[0] = strength;
  return effect;
}

double power_w(const signals::Sample& s) {
  return s.battery_voltage_v * s.battery_current_a;
}

double turning_arm(const robot::RobotModel& robot) {
  return robot.kinematics.wheel_radius_m / (2 * robot.kinematics.half_track_m);
}

// Windows of one interval between rows, about the same instants. Where its mean acceleration is between those
// of the neighbouring intervals, the first of them lasts until the second begins; else the speed changes
// linearly: without the corner, the losses by the square of a current or speed would be too small. A row's
// power is the mean of a period that begins `phase` of a period before the row: 1 stands for a mean since the
// last row, 0.5 for one about the row or for its instant.
std::vector<windows::Window> between_rows(std::span<const telemetry::Recording> missions,
                                          std::vector<windows::Window> windows, double phase) {
  std::vector<windows::Window> between;
  const auto add = [&](windows::Window w, std::size_t skipped) {
    const std::vector<signals::Sample>& rows = missions[w.mission].samples;
    const auto time_s = [&](const signals::Sample& s) {
      return 1e-6 * static_cast<double>(s.utime_us - rows.front().utime_us);
    };
    const auto begin =
        std::ranges::lower_bound(rows, w.t_s - 3 * w.length_s / (2 * rows_a_window) - 1e-3, {}, time_s);
    const auto first = static_cast<std::size_t>(begin - rows.begin()) + skipped;
    if (first + 3 >= rows.size()) return;
    const std::span<const signals::Sample, 4> near(&rows[first], 4);
    if (time_s(near[3]) - time_s(near[0]) > w.length_s) return;
    const double step_s = time_s(near[2]) - time_s(near[1]);
    w.reading = true;
    w.battery_power_w = phase * power_w(near[2]) + (1 - phase) * power_w(near[1]);
    std::array<double, 2> corner{1, 1}, corner_rad_s{};  // its share of the interval, and the speed at it
    for (const std::size_t side : {0u, 1u}) {
      const auto speed = [&](std::size_t k) { return near[k].wheel_velocity_rad_s[side]; };
      const auto slope = [&](std::size_t k) {
        return (speed(k + 1) - speed(k)) / (time_s(near[k + 1]) - time_s(near[k]));
      };
      const double share = (slope(1) - slope(2)) / (slope(0) - slope(2));
      if (share > 0 && share < 1) corner[side] = share;
      corner_rad_s[side] = corner[side] < 1 ? speed(1) + share * step_s * slope(0) : speed(2);
      w.acceleration_rad_s2[side] = slope(1);
      w.speed_rad_s[side] = 0;
    }
    const auto speed_at = [&](std::size_t side, double share) {
      const double from = near[1].wheel_velocity_rad_s[side], to = near[2].wheel_velocity_rad_s[side];
      return share <= corner[side]
                 ? std::lerp(from, corner_rad_s[side], share / corner[side])
                 : std::lerp(corner_rad_s[side], to, (share - corner[side]) / (1 - corner[side]));
    };
    const std::array<double, 4> end{0, std::min(corner[0], corner[1]), std::max(corner[0], corner[1]), 1};
    for (std::size_t part = 0; part < w.part_weight.size(); ++part) {
      const double share = w.part_weight[part] = end[part + 1] - end[part];
      for (const std::size_t side : {0u, 1u}) {
        const double from = speed_at(side, end[part]), to = speed_at(side, end[part + 1]);
        w.part_speed_rad_s[part][side] = (from + to) / 2;
        w.part_acceleration_rad_s2[part][side] = share > 0 ? (to - from) / (share * step_s) : 0;
        w.speed_rad_s[side] += share * (from + to) / 2;
      }
    }
    for (const std::size_t side : {0u, 1u}) {
      double least = std::numeric_limits<double>::infinity(), most = -least;
      for (const signals::Sample& s : near.subspan<1, 2>()) {
        least = std::min(least, s.wheel_velocity_rad_s[side]);
        most = std::max(most, s.wheel_velocity_rad_s[side]);
      }
      // The noise of single rows is larger than that of their mean.
      w.moving[side] = least > windows::moving_rad_s || most < -windows::moving_rad_s;
      w.resting[side] = std::max(most, -least) < windows::moving_rad_s &&
                        std::fabs(w.speed_rad_s[side]) < windows::resting_rad_s;
    }
    if (std::isfinite(w.battery_power_w)) between.push_back(std::move(w));
  };
  for (const windows::Window& w : windows)  // they are two rows apart
    for (const std::size_t skipped : {0u, 1u}) add(w, skipped);
  return between;
}

}  // namespace

Result<PowerWindows> power_windows(std::span<const telemetry::Recording> missions,
                                   const robot::RobotModel& robot, double phase) {
  std::vector<telemetry::Recording> driven;
  for (const telemetry::Recording& mission : missions)
    if (mission.samples.size() > 2) driven.push_back(mission);
  const bool measured = std::ranges::any_of(driven, [](const telemetry::Recording& mission) {
    return std::ranges::any_of(mission.samples, [](const signals::Sample& s) {
      return std::isfinite(s.battery_voltage_v * s.battery_current_a);
    });
  });
  if (!measured)
    return invalid("battery_current", "is not measured together with battery_voltage in any run");
  PowerWindows p;
  p.readings = windows::find_readings(driven);
  windows::WindowSettings settings;
  settings.most_windows = most_windows;
  const bool far = p.readings.row_s > far_apart_s && !p.readings.battery_held;
  if (far) settings.fewest_samples = rows_a_window;
  p.windows = windows::make_windows(driven, robot, p.readings, settings);
  if (far) {
    p.windows = between_rows(driven, std::move(p.windows), phase);
    p.phase = phase;
  }
  std::erase_if(p.windows, [](const windows::Window& w) { return !std::isfinite(w.battery_power_w); });
  std::vector<double> length_s;
  for (const telemetry::Recording& run : driven) length_s.push_back(telemetry::length_s(run));
  p.blocks = windows::assign_blocks(p.windows, length_s);
  for (const windows::Window& w : p.windows) p.whole.push_back(windows::steady(w));
  const auto whole = static_cast<std::size_t>(std::ranges::count(p.whole, true));
  if (whole < fewest_windows || p.blocks < fewest_blocks)
    return invalid("log", "contains only " + std::to_string(whole) + " windows with battery power in " +
                              std::to_string(p.blocks) + " blocks of 15 s; " +
                              std::to_string(fewest_windows) + " windows and " +
                              std::to_string(fewest_blocks) + " blocks are needed");
  return p;
}

std::vector<telemetry::Recording> every_second_row(std::span<const telemetry::Recording> missions,
                                                   double phase) {
  std::vector<telemetry::Recording> thinned(missions.begin(), missions.end());
  for (telemetry::Recording& mission : thinned) {
    std::vector<signals::Sample> rows;
    for (std::size_t k = 1; k + 1 < mission.samples.size(); k += 2) {
      signals::Sample& row = rows.emplace_back(mission.samples[k]);
      row.battery_current_a = (phase * power_w(mission.samples[k - 1]) + power_w(mission.samples[k]) +
                               (1 - phase) * power_w(mission.samples[k + 1])) /
                              (2 * row.battery_voltage_v);
    }
    mission.samples = std::move(rows);
  }
  return thinned;
}

PowerScale scale_of(std::span<const windows::Window> windows) {
  double power = 0, speed = 0, moving = 0;
  for (const windows::Window& w : windows) {
    power += std::fabs(w.battery_power_w);
    for (const std::size_t side : {0u, 1u}) {
      if (!w.moving[side]) continue;
      speed += std::fabs(w.speed_rad_s[side]);
      ++moving;
    }
  }
  PowerScale scale;
  if (power > 0) scale.power_w = power / static_cast<double>(windows.size());
  if (moving > 0) scale.speed_rad_s = speed / moving;
  return scale;
}

double metered_power_w(const dynamics::DriveModel& model, const windows::Window& w) {
  dynamics::Instant at = windows::instant_of(w);
  if (w.resting[0] && w.resting[1]) {
    at.wheel_speed_rad_s = at.wheel_acceleration_rad_s2 = {};
    return model.metered_battery_power(model.flow(at).battery_power_w, w.mission_voltage_v);
  }
  double power_w = 0;
  for (std::size_t part = 0; part < w.part_weight.size(); ++part) {
    if (!(w.part_weight[part] > 0)) continue;
    at.wheel_speed_rad_s = w.part_speed_rad_s[part];
    at.wheel_acceleration_rad_s2 = w.part_acceleration_rad_s2[part];
    power_w += w.part_weight[part] * model.flow(at).battery_power_w;
  }
  return model.metered_battery_power(power_w, w.mission_voltage_v);
}

PlainRegression::PlainRegression(std::span<const windows::Window> windows, const robot::RobotModel& robot)
    : wheel_radius_m_(robot.kinematics.wheel_radius_m) {
  Eigen::MatrixXd x(static_cast<Eigen::Index>(windows.size()), 5);
  Eigen::VectorXd y(x.rows());
  std::vector<std::size_t> block;
  for (const windows::Window& w : windows) {
    const auto row = static_cast<Eigen::Index>(block.size());
    const std::array<double, 5> terms = windows::plain_terms(w, wheel_radius_m_);
    x.row(row) = Eigen::Map<const Eigen::RowVectorXd>(terms.data(), 5);
    y[row] = w.battery_power_w;
    block.push_back(w.block);
  }
  fit_ = statistics::robust_regression(x, y, block);
}

double PlainRegression::power_w(const windows::Window& window) const {
  const std::array<double, 5> terms = windows::plain_terms(window, wheel_radius_m_);
  return fit_.coefficients.dot(Eigen::Map<const Eigen::VectorXd>(terms.data(), 5));
}

double PlainRegression::copperless_friction_nm() const {
  return 0.5 * std::max(0.0, fit_.coefficients[1]) * wheel_radius_m_;
}

void MissedPowerMeter::add(const windows::Window& window, const dynamics::DriveModel& file,
                           const dynamics::DriveModel& corrected, const PlainRegression& regression) {
  const double measured_w = window.battery_power_w;
  measured_w_ += std::fabs(measured_w);
  missed_w_.file += std::fabs(measured_w - metered_power_w(file, window));
  const double by_corrected = std::fabs(measured_w - metered_power_w(corrected, window)),
               by_regression = std::fabs(measured_w - regression.power_w(window));
  missed_w_.corrected += by_corrected;
  missed_w_.regression += by_regression;
  lead_w_[window.block] += by_corrected - by_regression;
}

MissedPower MissedPowerMeter::value() const {
  const auto n = static_cast<double>(lead_w_.size());
  double squares = 0;
  for (const auto& [block, lead_w] : lead_w_)
    squares += std::pow(lead_w - (missed_w_.corrected - missed_w_.regression) / n, 2);
  return {missed_w_.file / measured_w_, missed_w_.corrected / measured_w_, missed_w_.regression / measured_w_,
          std::sqrt(n / (n - 1) * squares) / measured_w_};
}

Result<PowerParameters> PowerParameters::make(const robot::RobotModel& robot, const PowerScale& scale,
                                              bool resistance_known) {
  TRY_ASSIGN(auto adopted, dynamics::active_effects(robot));
  PowerParameters p(robot);
  p.adopted_ = std::move(adopted);
  const robot::Motor& motor = robot.motor;
  const double friction_nm = (motor.friction_torque_nm[0] + motor.friction_torque_nm[1]) / 2;
  const double torque_nm = std::max(friction_nm, scale.power_w / (2 * scale.speed_rad_s));
  const WheelInertia inertia = wheel_inertia(robot);
  const auto set = [&](Eigen::Index at, double file, double expected, double least,
                       double most = std::numeric_limits<double>::infinity()) {
    p.file_[at] = file, p.expected_[at] = expected, p.least_[at] = least, p.most_[at] = most;
  };
  set(PowerParameter::idle_power, robot.idle_power_w, std::max(robot.idle_power_w, scale.power_w), 0);
  set(PowerParameter::friction, friction_nm, torque_nm, 0);
  set(PowerParameter::friction_difference, motor.friction_torque_nm[0] - motor.friction_torque_nm[1],
      file_side * torque_nm, -std::numeric_limits<double>::infinity());
  set(PowerParameter::viscous, motor.viscous_friction_nm_s_rad, torque_nm / scale.speed_rad_s, 0);
  set(PowerParameter::straight_inertia, inertia.straight, file_inertia * inertia.straight,
      least_share * inertia.straight);
  robot::RobotModel lightest = robot;
  lightest.mass.yaw_inertia_kg_m2 = least_yaw_inertia(robot);
  lightest.motor.rotor_inertia_kg_m2 = 0;
  set(PowerParameter::turning_inertia, inertia.turning, file_inertia * inertia.turning,
      wheel_inertia(lightest).turning);
  set(PowerParameter::resistance, motor.resistance_ohm,
      resistance_known ? 0 : file_resistance * motor.resistance_ohm, least_share * motor.resistance_ohm);
  for (const auto& [which, expected, most] : {std::tuple{PowerParameter::turning_scrub, file_scrub, 3.0},
                                              std::tuple{PowerParameter::driver_loss, file_driver, 1.0},
                                              std::tuple{PowerParameter::unreturned, file_unreturned, 1.0}}) {
    double had = 0;
    for (const dynamics::ActiveEffect& e : p.adopted_) {
      if (e.effect->info().id != parameter_at(which).name) continue;
      had = e.values[0];
      if (which != PowerParameter::turning_scrub) continue;
      p.file_has_scrub_ = true;
      p.scrub_rate_rad_s_ = e.values[1];
    }
    set(which, 0, expected, -had, most - had);
  }
  if (!p.file_has_scrub_) p.scrub_rate_rad_s_ = effect_of("turning_scrub", 0).values[1];
  return p;
}

void PowerParameters::set_scrub_rate(double rate_rad_s) {
  if (scrub_rate_is_free()) scrub_rate_rad_s_ = rate_rad_s;
}

std::array<double, 2> PowerParameters::friction_nm(const PowerVector& x) const {
  const double mean = plain_value(PowerParameter::friction, x),
               half = plain_value(PowerParameter::friction_difference, x) / 2;
  return {std::max(mean + half, 0.0), std::max(mean - half, 0.0)};
}

double PowerParameters::value(Eigen::Index p, const PowerVector& x) const {
  const std::array<double, 2> side_nm = friction_nm(x);
  if (p == PowerParameter::friction) return (side_nm[0] + side_nm[1]) / 2;
  if (p == PowerParameter::friction_difference) return side_nm[0] - side_nm[1];
  return plain_value(p, x);
}

robot::RobotModel PowerParameters::without_effects(const PowerVector& x) const {
  robot::RobotModel robot = robot_;
  robot.idle_power_w = value(PowerParameter::idle_power, x);
  robot.motor.friction_torque_nm = friction_nm(x);
  robot.motor.viscous_friction_nm_s_rad = value(PowerParameter::viscous, x);
  place_straight_inertia(value(PowerParameter::straight_inertia, x), robot);
  place_turning_inertia(value(PowerParameter::turning_inertia, x), robot);
  robot.mass.yaw_inertia_kg_m2 = std::max(robot.mass.yaw_inertia_kg_m2, least_yaw_inertia(robot_));
  robot.motor.resistance_ohm = value(PowerParameter::resistance, x);
  return robot;
}

std::vector<dynamics::ActiveEffect> PowerParameters::found_effects(const PowerVector& x) const {
  std::vector<dynamics::ActiveEffect> found;
  for (Eigen::Index p = PowerParameter::turning_scrub; p < PowerParameter::count; ++p) {
    if (value(p, x) == 0) continue;
    found.push_back(effect_of(parameter_at(p).name, value(p, x)));
    if (p == PowerParameter::turning_scrub) found.back().values[1] = scrub_rate_rad_s_;
  }
  return found;
}

dynamics::DriveModel PowerParameters::model(const PowerVector& x) const {
  std::vector<dynamics::ActiveEffect> effects = adopted_;
  for (const dynamics::ActiveEffect& e : found_effects(x)) effects.push_back(e);
  return {without_effects(x), effects};
}

robot::RobotModel PowerParameters::robot(const PowerVector& x) const {
  robot::RobotModel robot = without_effects(x);
  // A value at its bound is beyond it by rounding.
  robot.idle_power_w = std::max(robot.idle_power_w, 0.0);
  robot.motor.viscous_friction_nm_s_rad = std::max(robot.motor.viscous_friction_nm_s_rad, 0.0);
  for (const dynamics::ActiveEffect& e : found_effects(x)) {
    robot::AdoptedEffect more = dynamics::adopt(e);
    const auto had = std::ranges::find(robot.effects, more.id, &robot::AdoptedEffect::id);
    if (had == robot.effects.end()) {
      robot.effects.push_back(std::move(more));
      continue;
    }
    const std::string strength = more.parameters.front().first;
    for (auto& [name, number] : had->parameters)
      if (name == strength) number = std::max(number + e.values[0], 0.0);
  }
  return robot;
}

Result<RegressionComparison> compare_with_regression(std::span<const telemetry::Recording> learnt_from,
                                                     std::span<const telemetry::Recording> tested,
                                                     const robot::RobotModel& file,
                                                     const robot::RobotModel& corrected) {
  TRY_ASSIGN(const auto by_file, dynamics::drive_model(file));
  TRY_ASSIGN(const auto by_corrected, dynamics::drive_model(corrected));
  std::optional<RegressionComparison> best;
  for (const double phase : row_phases) {
    TRY_ASSIGN(const auto learnt, power_windows(learnt_from, file, phase));
    TRY_ASSIGN(const auto held_back, power_windows(tested, file, phase));
    const PlainRegression regression(learnt.windows, file);
    MissedPowerMeter missed;
    for (const windows::Window& w : held_back.windows) missed.add(w, by_file, by_corrected, regression);
    if (!best || missed.value().corrected < best->missed.corrected)
      best = RegressionComparison{held_back.windows.size(), missed.value()};
    if (std::isnan(learnt.phase)) break;
  }
  return *best;
}

WheelInertia wheel_inertia(const robot::RobotModel& robot) {
  const double r = robot.kinematics.wheel_radius_m, c = turning_arm(robot);
  const double wheel = robot.mass.wheel_inertia_kg_m2 + robot.motor.rotor_inertia_kg_m2;
  return {robot.total_mass_kg(0) * r * r / 2 + wheel, 2 * robot.mass.yaw_inertia_kg_m2 * c * c + wheel};
}

void place_straight_inertia(double straight_kg_m2, robot::RobotModel& robot) {
  const double r = robot.kinematics.wheel_radius_m;
  const double rotor = straight_kg_m2 - robot.total_mass_kg(0) * r * r / 2 - robot.mass.wheel_inertia_kg_m2;
  robot.motor.rotor_inertia_kg_m2 = std::max(rotor, 0.0);
  if (rotor >= 0) return;
  const double mass = 2 * (straight_kg_m2 - robot.mass.wheel_inertia_kg_m2) / (r * r);
  robot.mass.chassis_kg = std::max(mass - 2 * robot.mass.wheel_kg, 0.01 * robot.mass.chassis_kg);
}

void place_turning_inertia(double turning_kg_m2, robot::RobotModel& robot) {
  const double c = turning_arm(robot);
  const double yaw =
      (turning_kg_m2 - robot.mass.wheel_inertia_kg_m2 - robot.motor.rotor_inertia_kg_m2) / (2 * c * c);
  if (yaw > 0) robot.mass.yaw_inertia_kg_m2 = yaw;
}

}  // namespace joulecast::energy

#include "energy/power_parameters.h"

#include <algorithm>
#include <limits>
#include <utility>

#include "base/try.h"
#include "energy/wheel_inertia.h"

namespace joulecast::energy {
namespace {

// Standard deviations of a value from a data sheet, a scale or a sketch, relative to the file's value:
// assumed, on the wide side. Parameters that the recordings show well do not depend on them.
constexpr double file_side = 0.3;        // of the friction, one side against the other
constexpr double file_inertia = 0.5;     // rotors are often left out, bodies of cars are guessed
constexpr double file_resistance = 0.5;  // cold against warm is a third of it
constexpr double file_scrub = 1;         // coefficient; a long wheel base has more than its rubber
constexpr double file_driver = 0.05;     // of the motors' power
constexpr double file_unreturned = 0.5;  // of the braking power
constexpr double least_share = 0.05;     // of the file's inertia: a bound, as none is without

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

}  // namespace

Result<PowerParameters> PowerParameters::make(const robot::RobotModel& robot, const PowerScale& scale,
                                              bool resistance_known) {
  TRY_ASSIGN(auto adopted, dynamics::active_effects(robot));
  PowerParameters p(robot);
  p.adopted_ = std::move(adopted);
  const robot::Motor& motor = robot.motor;
  const double friction_nm = (motor.friction_torque_nm[0] + motor.friction_torque_nm[1]) / 2;
  const double torque_nm = std::max(friction_nm, scale.power_w / (2 * scale.speed_rad_s));
  const WheelInertia inertia = wheel_inertia(robot);
  constexpr auto count = static_cast<Eigen::Index>(power_parameter_count);
  p.file_.resize(count), p.expected_.resize(count), p.least_.resize(count), p.most_.resize(count);
  const auto set = [&](PowerParameter which, double file, double expected, double least,
                       double most = std::numeric_limits<double>::infinity()) {
    const Eigen::Index at = index_of(which);
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
      resistance_known ? 0 : file_resistance * motor.resistance_ohm, 0);
  for (const auto& [which, expected, most] : {std::tuple{PowerParameter::turning_scrub, file_scrub, 3.0},
                                              std::tuple{PowerParameter::driver_loss, file_driver, 1.0},
                                              std::tuple{PowerParameter::unreturned, file_unreturned, 1.0}}) {
    double had = 0;
    for (const dynamics::ActiveEffect& e : p.adopted_) {
      if (e.effect->info().id != power_parameter_names[static_cast<std::size_t>(which)]) continue;
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

double PowerParameters::least(PowerParameter p) const {
  const Eigen::Index at = index_of(p);
  return expected_[at] > 0 ? (least_[at] - file_[at]) / expected_[at] : 0;
}

double PowerParameters::most(PowerParameter p) const {
  const Eigen::Index at = index_of(p);
  return expected_[at] > 0 ? (most_[at] - file_[at]) / expected_[at] : 0;
}

std::array<double, 2> PowerParameters::friction_nm(const Eigen::VectorXd& x) const {
  const double mean = plain_value(PowerParameter::friction, x),
               half = plain_value(PowerParameter::friction_difference, x) / 2;
  return {std::max(mean + half, 0.0), std::max(mean - half, 0.0)};
}

double PowerParameters::value(PowerParameter p, const Eigen::VectorXd& x) const {
  const std::array<double, 2> side_nm = friction_nm(x);
  if (p == PowerParameter::friction) return (side_nm[0] + side_nm[1]) / 2;
  if (p == PowerParameter::friction_difference) return side_nm[0] - side_nm[1];
  return plain_value(p, x);
}

robot::RobotModel PowerParameters::without_effects(const Eigen::VectorXd& x) const {
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

std::vector<dynamics::ActiveEffect> PowerParameters::found_effects(const Eigen::VectorXd& x) const {
  std::vector<dynamics::ActiveEffect> found;
  for (const PowerParameter p : all_power_parameters) {
    if (!is_effect(p) || value(p, x) == 0) continue;
    found.push_back(effect_of(power_parameter_names[static_cast<std::size_t>(p)], value(p, x)));
    if (p == PowerParameter::turning_scrub) found.back().values[1] = scrub_rate_rad_s_;
  }
  return found;
}

dynamics::DriveModel PowerParameters::model(const Eigen::VectorXd& x) const {
  std::vector<dynamics::ActiveEffect> effects = adopted_;
  for (const dynamics::ActiveEffect& e : found_effects(x)) effects.push_back(e);
  return {without_effects(x), effects};
}

robot::RobotModel PowerParameters::robot(const Eigen::VectorXd& x) const {
  robot::RobotModel robot = without_effects(x);
  for (const dynamics::ActiveEffect& e : found_effects(x)) {
    robot::AdoptedEffect more = dynamics::adopt(e);
    const auto had = std::ranges::find(robot.effects, more.id, &robot::AdoptedEffect::id);
    if (had == robot.effects.end()) {
      robot.effects.push_back(std::move(more));
      continue;
    }
    const std::string strength = more.parameters.front().first;
    for (auto& [name, number] : had->parameters)
      if (name == strength) number += e.values[0];
  }
  return robot;
}

}  // namespace joulecast::energy

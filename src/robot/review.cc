#include "robot/review.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

namespace joulecast::robot {
namespace {

// No battery in the field stores more than about 250 Wh/kg (lithium-ion cells, without case).
constexpr double greatest_energy_wh_kg = 250;

// Steady motion of the side with more friction, straight on the flat, without payload.
struct Motion {
  explicit Motion(const RobotModel& model);

  double voltage_v, friction_nm, ratio, torque_nm_a;
  double friction_current_a;  // to turn at all
  double top_speed_m_s;       // at the nominal voltage; not above 0: it does not start
  double mass_kg, wheel_load_kg;
  double acceleration_m_s2;  // from standing, at the lower of the current limit and the stall current
  double energy_wh;
};

Motion::Motion(const RobotModel& model)
    : voltage_v(model.battery.nominal_voltage_v),
      friction_nm(std::ranges::max(model.motor.friction_torque_nm)),
      ratio(model.motor.gear_ratio),
      torque_nm_a(model.motor.torque_constant_nm_a * ratio),
      friction_current_a(friction_nm / torque_nm_a),
      mass_kg(model.total_mass_kg(0)),
      energy_wh(voltage_v * model.battery.capacity_ah) {
  const Motor& motor = model.motor;
  const double r = model.kinematics.wheel_radius_m;
  top_speed_m_s = r * (voltage_v - motor.resistance_ohm * friction_current_a) /
                  (motor.voltage_constant_v_s_rad * ratio +
                   motor.resistance_ohm * motor.viscous_friction_nm_s_rad / torque_nm_a);
  const double stall_a =
      motor.resistance_ohm > 0 ? voltage_v / motor.resistance_ohm : std::numeric_limits<double>::infinity();
  const double current_a = std::min(model.limits.current_a, stall_a);
  wheel_load_kg = mass_kg + 2 * (model.mass.wheel_inertia_kg_m2 + motor.rotor_inertia_kg_m2) / (r * r);
  acceleration_m_s2 = 2 * (torque_nm_a * current_a - friction_nm) / r / wheel_load_kg;
}

class Review {
 public:
  explicit Review(const RobotModel& model) : model_(model), motion_(model) {}

  std::vector<ReviewFinding> run() {
    movement();
    motor();
    battery();
    body();
    std::ranges::stable_partition(found_, &ReviewFinding::fault);
    return std::move(found_);
  }

 private:
  void movement();
  void motor();
  void battery();
  void body();

  template <class... Values>
  void warn(const char* field, double value, fmt::format_string<Values...> says, Values&&... values) {
    found_.push_back({false, field, value, fmt::format(says, std::forward<Values>(values)...)});
  }
  template <class... Values>
  void fault(const char* field, double value, fmt::format_string<Values...> says, Values&&... values) {
    found_.push_back({true, field, value, fmt::format(says, std::forward<Values>(values)...)});
  }

  const RobotModel& model_;
  Motion motion_;
  std::vector<ReviewFinding> found_;
};

void Review::movement() {
  const Limits& limits = model_.limits;
  if (motion_.friction_current_a >= limits.current_a)
    return fault("/limits/current_a", motion_.friction_current_a,
                 "is {:.4g} A, but friction of {:.4g} N m at the wheel alone needs {:.4g} A of a motor: the "
                 "robot cannot move",
                 limits.current_a, motion_.friction_nm, motion_.friction_current_a);
  if (!(motion_.top_speed_m_s > 0))
    return fault("/motor/resistance_ohm", motion_.friction_current_a * model_.motor.resistance_ohm,
                 "is {:.4g} ohm: friction of {:.4g} N m at the wheel needs {:.4g} V of a motor, the nominal "
                 "voltage is {:.4g} V: the robot cannot move",
                 model_.motor.resistance_ohm, motion_.friction_nm,
                 motion_.friction_current_a * model_.motor.resistance_ohm, motion_.voltage_v);
  const double share = motion_.top_speed_m_s / limits.speed_m_s;
  if (share < 0.95)
    warn("/limits/speed_m_s", motion_.top_speed_m_s,
         "is {:.4g} m/s, but at {:.4g} V the motors reach {:.3g} m/s on the flat, which limits every plan",
         limits.speed_m_s, motion_.voltage_v, motion_.top_speed_m_s);
  if (share > 5)
    warn("/motor/gear_ratio", motion_.ratio,
         "is {:.4g}{}: at {:.4g} V the motors would reach {:.3g} m/s, {:.3g} times limits.speed_m_s; the "
         "torque and voltage constants apply at the motor's shaft, before the gear",
         motion_.ratio, motion_.ratio == 1 ? ", the default" : "", motion_.voltage_v, motion_.top_speed_m_s,
         share);
  if (motion_.acceleration_m_s2 < limits.acceleration_m_s2)
    warn("/limits/acceleration_m_s2", motion_.acceleration_m_s2,
         "is {:.4g} m/s², but {:.4g} A a motor accelerate the robot by {:.3g} m/s² at most",
         limits.acceleration_m_s2, limits.current_a, motion_.acceleration_m_s2);
  const double turning_m_s = limits.yaw_rate_rad_s * model_.kinematics.half_track_m;
  if (turning_m_s > std::max(limits.speed_m_s, motion_.top_speed_m_s))
    warn("/limits/yaw_rate_rad_s", turning_m_s,
         "is {:.4g} rad/s, {:.3g} m/s at the wheels, faster than the robot can drive: is it in degrees?",
         limits.yaw_rate_rad_s, turning_m_s);
}

void Review::motor() {
  const Motor& motor = model_.motor;
  const double constants = motor.torque_constant_nm_a / motor.voltage_constant_v_s_rad;
  if (constants < 0.8 || constants > 1.25)
    warn("/motor/torque_constant_nm_a", constants,
         "is {:.4g} N m/A, {:.3g} times voltage_constant_v_s_rad; in SI units both have the same value, and "
         "losses of the motor lower the torque constant",
         motor.torque_constant_nm_a, constants);
  if (motor.resistance_ohm > 0 && motor.inductance_h / motor.resistance_ohm > 0.1)
    warn("/motor/inductance_h", motor.inductance_h / motor.resistance_ohm,
         "is {:.4g} H, a time constant of {:.3g} s; motors have milliseconds: is it in mH?",
         motor.inductance_h, motor.inductance_h / motor.resistance_ohm);
  if (motor.resistance_ohm > 0 && model_.limits.current_a * motor.resistance_ohm > 2 * motion_.voltage_v)
    warn("/limits/current_a", motion_.voltage_v / motor.resistance_ohm,
         "is {:.4g} A, but {:.4g} V drive {:.3g} A at most through {:.4g} ohm: the limit never acts",
         model_.limits.current_a, motion_.voltage_v, motion_.voltage_v / motor.resistance_ohm,
         motor.resistance_ohm);
  double friction_nm = motor.friction_torque_nm[right] + motor.friction_torque_nm[left];
  const double coefficient =
      friction_nm / (model_.kinematics.wheel_radius_m * motion_.mass_kg * standard_gravity_m_s2);
  if (coefficient > 0.3)
    warn("/motor/friction_torque_nm", coefficient,
         "is [{:.4g}, {:.4g}] N m, a drag of {:.3g} times the robot's weight; it applies at the wheel, after "
         "the gear",
         motor.friction_torque_nm[right], motor.friction_torque_nm[left], coefficient);
}

void Review::battery() {
  const Battery& battery = model_.battery;
  const double density = motion_.energy_wh / motion_.mass_kg;
  if (density > greatest_energy_wh_kg)
    warn(
        "/battery/capacity_ah", density,
        "is {:.4g} Ah, {:.3g} Wh a kilogram of the whole robot; lithium-ion cells have {:.4g}: is it in mAh?",
        battery.capacity_ah, density, greatest_energy_wh_kg);
  const double drop = battery.internal_resistance_ohm * battery.capacity_ah / battery.nominal_voltage_v;
  if (drop > 0.5)
    warn("/battery/internal_resistance_ohm", drop,
         "is {:.4g} ohm: the current that empties the battery in an hour lowers its voltage by {:.3g} of it: "
         "is it in milliohm?",
         battery.internal_resistance_ohm, drop);
  if (model_.idle_power_w <= 0)
    return warn("/idle_power_w", 0.0, "is 0 W, but computer, drivers and sensors always draw power");
  const double standing_h = motion_.energy_wh / model_.idle_power_w;
  if (standing_h > 1000 || standing_h < 0.5)
    warn("/idle_power_w", standing_h, "is {:.4g} W: a full battery of {:.4g} Wh lasts {:.1f} h at rest",
         model_.idle_power_w, motion_.energy_wh, standing_h);
}

void Review::body() {
  const double gyration_m = std::sqrt(model_.mass.yaw_inertia_kg_m2 / motion_.mass_kg);
  const double shape = gyration_m / model_.kinematics.half_track_m;
  if (shape > 4 || shape < 0.2)
    warn("/mass/yaw_inertia_kg_m2", gyration_m,
         "is {:.4g} kg m², as of a mass {:.3g} m from the centre of the axle; the wheels are at {:.4g} m",
         model_.mass.yaw_inertia_kg_m2, gyration_m, model_.kinematics.half_track_m);
  const double rotating = motion_.wheel_load_kg / motion_.mass_kg;
  if (rotating > 5)
    warn("/motor/rotor_inertia_kg_m2", rotating,
         "makes the robot's inertia {:.3g} times that of its mass; it applies at the wheel, with the square "
         "of the gear ratio",
         rotating);
}

}  // namespace

Figures figures_of(const RobotModel& model) {
  const Motion motion(model);
  return {motion.top_speed_m_s, motion.acceleration_m_s2, motion.energy_wh,
          motion.energy_wh / model.idle_power_w};
}

std::vector<ReviewFinding> review(const RobotModel& model) {
  return Review(model).run();
}

Result<void> plannable(const std::vector<ReviewFinding>& findings) {
  std::vector<FieldFault> faults;
  for (const ReviewFinding& finding : findings)
    if (finding.fault) faults.push_back({finding.field, finding.says});
  if (faults.empty()) return {};
  return tl::unexpected(error_of(faults));
}

}  // namespace joulecast::robot

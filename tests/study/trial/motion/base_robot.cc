#include "tests/study/trial/motion/base_robot.h"

#include <algorithm>
#include <cmath>

#include "base/median.h"

namespace joulecast::trial::motion {
namespace {

constexpr double copper_share = 0.0005;
constexpr double headroom = 1.2;  // of limits above the log's maxima

double parameter(const robot::RobotModel& file, std::string_view id, std::string_view name) {
  for (const robot::AdoptedEffect& effect : file.effects) {
    if (effect.id != id) continue;
    for (const auto& [known, value] : effect.parameters) {
      if (known == name) return value;
    }
  }
  return 0;
}

}  // namespace

robot::RobotModel base_robot(const MotionLog& log, const BaseForm& form, const Terms& base) {
  robot::RobotModel file = log.kinematics;
  const std::vector<Instant> instants = log.all_instants();
  const double r = file.kinematics.wheel_radius_m, half_m = file.kinematics.half_track_m;
  file.robot_id = log.missions.front().robot_id;
  file.kinematics.com_offset_m = 0;
  const double mass_kg = of(base, Term::inertia);
  file.mass = {mass_kg, 0, form.gyration_m2 * mass_kg, 1e-6 * mass_kg * r * r};
  file.idle_power_w = of(base, Term::idle);

  double top_m_s = 0, most_acceleration = 0, most_yaw = 0, torque_squares = 0, mean_w = 0;
  std::vector<double> volts;
  const double dry_nm = of(base, Term::friction) * r / 2;
  for (const Instant& at : instants) {
    top_m_s = std::max({top_m_s, std::fabs(at.rim_m_s[0]), std::fabs(at.rim_m_s[1])});
    most_acceleration = std::max(most_acceleration, std::fabs(at.acceleration_m_s2));
    most_yaw = std::max(most_yaw, std::fabs(at.yaw_rate_rad_s));
    const double force_n = mass_kg * at.acceleration_m_s2 / 2;
    const double turn_n = of(base, Term::turning) / (2 * half_m);
    torque_squares += r * r * (force_n * force_n + turn_n * turn_n) + dry_nm * dry_nm;
    mean_w += std::fabs(at.power_w()) / static_cast<double>(instants.size());
    volts.push_back(at.voltage_v);
  }
  top_m_s = std::max(top_m_s, 0.1);
  file.battery.nominal_voltage_v = upper_median(std::move(volts));
  file.battery.internal_resistance_ohm = log.battery.resistance_ohm;
  file.battery.open_circuit_voltage.clear();  // another battery's curve need not hold this voltage
  file.battery.cutoff_voltage_v.reset();
  robot::Motor& motor = file.motor;
  motor = {};
  // The motors run at the battery's voltage a little above the highest speed.
  motor.torque_constant_nm_a = file.battery.nominal_voltage_v / (headroom * top_m_s / r);
  motor.voltage_constant_v_s_rad = motor.torque_constant_nm_a;
  const double amperes_squared =
      2 * torque_squares / static_cast<double>(instants.size()) / std::pow(motor.torque_constant_nm_a, 2);
  motor.resistance_ohm = copper_share * mean_w / std::max(amperes_squared, 1e-9);
  motor.viscous_friction_nm_s_rad = of(base, Term::friction) * form.viscous_s_m * r * r / 2;
  motor.friction_torque_nm = {dry_nm, dry_nm};

  robot::Limits& limits = file.limits;
  limits.speed_m_s = std::max(limits.speed_m_s, headroom * top_m_s);
  limits.acceleration_m_s2 = std::max(limits.acceleration_m_s2, headroom * most_acceleration);
  limits.yaw_rate_rad_s = std::max({limits.yaw_rate_rad_s, headroom * most_yaw, 0.1});
  limits.current_a = std::max(limits.current_a, 10 * std::sqrt(amperes_squared));

  file.effects.clear();
  if (form.turns) {
    const double weight_n = mass_kg * robot::standard_gravity_m_s2;
    file.effects.push_back({"turning_scrub",
                            {{"coefficient", 2 * of(base, Term::turning) / (weight_n * half_m)},
                             {"rate_rad_s", form.turning_rate_rad_s}}});
  }
  if (form.fast && of(base, Term::drag) > 0) {
    file.effects.push_back({"aerodynamic_drag", {{"coefficient_n_s2_m2", of(base, Term::drag)}}});
  }
  return file;
}

double file_power_w(const robot::RobotModel& file, const Instant& at) {
  const double r = file.kinematics.wheel_radius_m, half_m = file.kinematics.half_track_m;
  const double mass_kg = file.total_mass_kg(0);
  const double scrub_nm = 0.5 * parameter(file, "turning_scrub", "coefficient") * mass_kg *
                          robot::standard_gravity_m_s2 * half_m *
                          std::tanh(at.yaw_rate_rad_s / parameter(file, "turning_scrub", "rate_rad_s"));
  const double along_n =
      mass_kg * at.acceleration_m_s2 +
      parameter(file, "aerodynamic_drag", "coefficient_n_s2_m2") * at.speed_m_s * std::fabs(at.speed_m_s);
  const double turn_nm =
      file.mass.yaw_inertia_kg_m2 * at.yaw_acceleration_rad_s2 + (std::isfinite(scrub_nm) ? scrub_nm : 0);
  double power_w = file.idle_power_w;
  for (std::size_t s : {0u, 1u}) {
    const double side = s == 0 ? 1 : -1, w = at.rim_m_s[s] / r;
    const double torque_nm = r * (along_n / 2 + side * turn_nm / (2 * half_m)) +
                             std::copysign(w == 0 ? 0 : file.motor.friction_torque_nm[s], w) +
                             file.motor.viscous_friction_nm_s_rad * w;
    const double current_a = torque_nm / (file.motor.torque_constant_nm_a * file.motor.gear_ratio);
    power_w += torque_nm * w + file.motor.resistance_ohm * current_a * current_a;
  }
  return power_w;
}

double base_mismatch(const robot::RobotModel& file, const BaseForm& form, const Terms& base,
                     std::span<const Instant> instants) {
  double difference = 0, total = 0;
  for (const Instant& at : instants) {
    const double power_w = base_power_w(form, base, at);
    difference += std::fabs(file_power_w(file, at) - power_w);
    total += std::fabs(power_w);
  }
  return total > 0 ? difference / total : 0;
}

}  // namespace joulecast::trial::motion

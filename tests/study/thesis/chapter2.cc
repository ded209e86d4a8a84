#include <fmt/format.h>

#include <array>
#include <cmath>

#include "tests/study/ramp/ramp.h"
#include "tests/study/thesis/gaussian_detour.h"
#include "tests/study/thesis/tables.h"
#include "tests/support/straight_power.h"

namespace joulecast::client::thesis {
namespace {

constexpr double printed_viscous_friction = 0.035;  // table 2-2
constexpr double ramp_share = 0.25;                 // of the duration, for accelerating and for braking

struct Pair {
  double motor_j = 0;     // the thesis's motor model: the drive model without the load torque
  double combined_j = 0;  // with it
};

// A trapezoid over `distance_m` in `duration_s`.
Pair straight(const robot::RobotModel& robot, double distance_m, double duration_s, double payload_kg) {
  const robot::Motor& m = robot.motor;
  const double torque_constant = m.torque_constant_nm_a * m.gear_ratio;
  planning::LineTask task;
  task.distance = distance_m;
  const auto energy = [&] { return planning::ramp_in_time(task, duration_s, ramp_share)->energy_j(); };
  task.power = dynamics::straight_power(robot, payload_kg).over_distance();
  Pair pair;
  pair.combined_j = energy();
  dynamics::QuadraticPower wheels;
  for (const double friction_nm : m.friction_torque_nm)
    wheels += dynamics::wheel_power(m.resistance_ohm / (torque_constant * torque_constant),
                                    m.voltage_constant_v_s_rad / m.torque_constant_nm_a,
                                    m.rotor_inertia_kg_m2, m.viscous_friction_nm_s_rad, friction_nm);
  task.power = rescaled(wheels, robot.kinematics.wheel_radius_m);
  pair.motor_j = energy();
  return pair;
}

void add(Table& table, const std::string& what, const robot::RobotModel& p3dx, double duration_s,
         double payload_kg, Pair printed) {
  robot::RobotModel as_printed = p3dx;
  as_printed.motor.viscous_friction_nm_s_rad = printed_viscous_friction;
  const Pair ours = straight(p3dx, 10, duration_s, payload_kg);
  const Pair low = straight(as_printed, 10, duration_s, payload_kg);
  const auto remark = [](double with_printed, double value) {
    return fmt::format("table 2-2's viscous friction of 0.035 gives {:.2f} J ({:+.1f} %)", with_printed,
                       100 * (with_printed / value - 1));
  };
  table.rows.push_back(
      {what + ", motor model", printed.motor_j, ours.motor_j, remark(low.motor_j, printed.motor_j)});
  table.rows.push_back({what + ", combined model", printed.combined_j, ours.combined_j,
                        remark(low.combined_j, printed.combined_j)});
}

constexpr const char* trapezoid_assumptions =
    "P3-DX, 10 m in a trapezoid that accelerates for a quarter of its time and brakes for another (the "
    "printed "
    "speeds are distance / 0.75 duration); viscous friction 0.039 N m s/rad instead of the printed 0.035. "
    "The part of the load (combined less motor model) is about half of that in the thesis: (2-46) with "
    "the "
    "printed masses gives no more, and wheel inertia is not printed";

}  // namespace

Table table_2_3(const robot::RobotModel& p3dx) {
  Table table{"2-3", "P3-DX, three speeds, payload 3.76 kg", trapezoid_assumptions, {}};
  add(table, "0.66 m/s (20 s)", p3dx, 20, 3.76, {53.65, 54.51});
  add(table, "0.88 m/s (15 s)", p3dx, 15, 3.76, {71.89, 73.68});
  add(table, "1.21 m/s (11 s)", p3dx, 11, 3.76, {98.85, 102.9});
  return table;
}

Table table_2_4(const robot::RobotModel& p3dx) {
  Table table{"2-4", "P3-DX, three payloads, 0.88 m/s (15 s)", trapezoid_assumptions, {}};
  add(table, "chassis and load 6.04 kg", p3dx, 15, 0, {71.9, 73.15});
  add(table, "chassis and load 9.8 kg", p3dx, 15, 3.76, {71.89, 73.68});
  add(table, "chassis and load 13.64 kg", p3dx, 15, 7.6, {71.88, 74.25});
  return table;
}

Table table_2_5(const robot::RobotModel& p3dx) {
  // Of the three durations that section 2.3.1 names (11, 15 and 20 s) the shortest: the others cost less than
  // the printed values even on a straight line.
  constexpr double duration_s = 11, payload_kg = 7.6;
  Table table{
      "2-5",
      "P3-DX, Gaussian detours (2-48) round circles of three radii",
      "height and width h of the bell both the circle's radius (the narrowest bell that stays outside the "
      "circle); chord such that the path has the printed length; progress along the chord is a trapezoid "
      "of 11 s with quarters, the shortest that section 2.3.1 names; payload 7.6 kg (figure 2-8). The "
      "thesis prints neither h, start, nor times",
      {}};
  struct Printed {
    double radius_m, length_m;
    Pair energy;
  };
  for (const Printed& p : {Printed{0.5, 7.06, {51.26, 56.96}}, Printed{0.75, 7.17, {50.13, 52.04}},
                           Printed{1.0, 7.28, {50.74, 51.66}}}) {
    const GaussianDetour detour(p.radius_m, p.length_m);
    const DetourEnergy ours = detour_energy(p3dx, detour, duration_s, ramp_share, payload_kg);
    const std::string what = fmt::format("radius {:g} m, {:g} m", p.radius_m, p.length_m);
    const std::string remark = fmt::format(
        "chord {:.2f} m; peak wheel acceleration {:.1f} rad/s^2; (2-49) as printed, with 2 l, gives {:.2f} J "
        "for the motors and {:.2f} J combined; with another time profile the value is another",
        detour.chord_m(), ours.peak_wheel_acceleration_rad_s2, ours.doubled_track_motor_j,
        ours.doubled_track_combined_j);
    table.rows.push_back({what + ", motor model", p.energy.motor_j, ours.motor_j, remark});
    table.rows.push_back({what + ", combined model", p.energy.combined_j, ours.combined_j, remark});
  }
  return table;
}

}  // namespace joulecast::client::thesis

#include "tests/support/straight_power.h"

#include <gtest/gtest.h>

#include "tests/planning/robots.h"
#include "tests/study/ramp/ramp.h"

namespace joulecast::planning {
namespace {

using dynamics::QuadraticPower;

// Thesis (3-2), (3-3): printed digits, per wheel. The text drops two small products, 2 rho J nu of c_x
// (0.0005) and 2 rho nu T of c3 (0.0012): they are subtracted before comparing with its 0.148, 0.373 and
// 0.346.
TEST(StraightPower, ReproducesCoefficientsPerWheel) {
  const robot::RobotModel robot = test::nomad();
  const double kn = 0.069 * 24.9, rho = 2.74 / (kn * kn), nu = 0.0017;
  const dynamics::StraightPower empty = dynamics::straight_power(robot, 0);
  const double inertia = 0.028 + 23.98 * 0.01 / 2;
  struct Printed {
    double ca, c3, c0;
    double friction, ca_tolerance;
  };
  // 0.0949 needs T_m a little below the 0.346 that the text prints to three digits: the half unit of T_m adds
  // 2 rho J 0.0005 = 0.00014 to the half unit of c_a.
  const Printed printed[2] = {{0.102, 0.373, 0.129, 0.3728, 0.0005},
                              {0.0949, 0.346, 0.111, 0.346, 0.00005 + 0.00014}};
  for (std::size_t s : {0u, 1u}) {
    const QuadraticPower& p = empty.side[s];
    EXPECT_NEAR(p.c1, 0.0203, 0.00005);
    EXPECT_NEAR(p.cx - 2 * rho * inertia * nu, 0.148, 0.0005);
    EXPECT_NEAR(p.ca, printed[s].ca, printed[s].ca_tolerance);
    EXPECT_NEAR(p.c2, 0.0017, 0.00005);
    EXPECT_NEAR(p.c3 - 2 * rho * nu * printed[s].friction, printed[s].c3, 0.0005);
    EXPECT_NEAR(p.c0, printed[s].c0, 0.0005);
  }
  // Slopes with payload. c1's is exact only with the term in m_p^2, which (3-2) drops: rho (r^2/2)^2 m_p^2.
  const double mp = 10;
  const dynamics::StraightPower loaded = dynamics::straight_power(robot, mp);
  const double dropped = rho * 0.005 * 0.005 * mp * mp;
  EXPECT_NEAR((loaded.side[0].c1 - empty.side[0].c1 - dropped) / mp, 0.0014, 0.00005);
  EXPECT_NEAR((loaded.side[0].cx - empty.side[0].cx) / mp, 0.005, 0.0005);
  // The text cuts 0.00346 to 0.0034 and rounds 0.00321 to 0.0032: one unit of its last digit.
  EXPECT_NEAR((loaded.side[0].ca - empty.side[0].ca) / mp, 0.0034, 0.0001);
  EXPECT_NEAR((loaded.side[1].ca - empty.side[1].ca) / mp, 0.0032, 0.00005);
}

// Thesis (4-1). It adds the rounded (3-2) and (3-3), so that its tolerance is a half unit of each of them.
TEST(StraightPower, ReproducesCoefficientsOfBothWheels) {
  const robot::RobotModel robot = test::nomad();
  const QuadraticPower p = dynamics::straight_power(robot, 0).both;
  EXPECT_NEAR(p.c1, 0.0406, 0.0001);
  EXPECT_NEAR(p.cx, 0.296, 0.001);
  EXPECT_NEAR(p.ca, 0.197, 0.0005 + 0.0002);
  EXPECT_NEAR(p.c2, 0.0034, 0.0001);
  EXPECT_NEAR(p.c3, 0.719, 0.001 + 0.0023);  // with the dropped 2 rho nu T of both wheels
  EXPECT_NEAR(p.c0, 0.240, 0.001);
  const QuadraticPower q = dynamics::straight_power(robot, 1).both;
  EXPECT_NEAR(q.c1 - p.c1, 0.0028, 0.0001);
  EXPECT_NEAR(q.cx - p.cx, 0.01, 0.001);
  EXPECT_NEAR(q.ca - p.ca, 0.0066, 0.0002);
}

TEST(StraightPower, PowerOverDistanceIsEqual) {
  const dynamics::StraightPower p = dynamics::straight_power(test::tug(), 120);
  const double speed = 0.7, acceleration = -0.4, radius = p.wheel_radius_m;
  EXPECT_NEAR(p.over_distance().power_w(speed, acceleration),
              p.both.power_w(speed / radius, acceleration / radius), 1e-9);
}

// Tables 2-3 and 2-4: a trapezoid of 10 m in which acceleration and braking take a quarter of the time each.
// FACTS: nu = 0.039 and not the printed 0.035. With exactly 0.039 the motor column agrees to 1.4 % and the
// combined one to 2.5 %; but a nu of two digits is accurate to 0.0005 only, which moves every row by 1.3 %.
// 0.0393, which rounds to it and follows from the first row's motor column alone, agrees to 2 % in every row.
// I_w is the disc m_w r^2/2, which the thesis does not print.
TEST(StraightPower, ReproducesTables23And24) {
  struct Row {
    double duration_s, payload_kg, motor_j, combined_j;
  };
  const Row rows[] = {{20, 3.76, 53.65, 54.51},
                      {15, 3.76, 71.89, 73.68},
                      {11, 3.76, 98.85, 102.9},
                      {15, 0, 71.9, 73.15},
                      {15, 7.6, 71.88, 74.25}};
  struct Energies {
    double motor_j, combined_j;
  };
  const auto energies = [](const Row& row, double nu) {
    robot::RobotModel robot = test::p3dx();
    robot.motor.viscous_friction_nm_s_rad = nu;
    robot.mass.wheel_inertia_kg_m2 = 1.48 * 0.095 * 0.095 / 2;
    QuadraticPower motor = dynamics::wheel_power(0.7 / (0.88 * 0.88), 1, 0.0713, nu, 0);
    motor += motor;
    LineTask task{dynamics::straight_power(robot, row.payload_kg).over_distance(), 10};
    const double combined_j = ramp_in_time(task, row.duration_s, 0.25)->energy_j();
    task.power = rescaled(motor, 0.095);
    return Energies{ramp_in_time(task, row.duration_s, 0.25)->energy_j(), combined_j};
  };
  for (const Row& row : rows) {
    const Energies fitted = energies(row, 0.0393);
    EXPECT_NEAR(fitted.motor_j, row.motor_j, 0.02 * row.motor_j) << row.duration_s;
    EXPECT_NEAR(fitted.combined_j, row.combined_j, 0.02 * row.combined_j) << row.duration_s;
    const Energies rounded = energies(row, 0.039), above = energies(row, 0.0395);
    EXPECT_NEAR(rounded.motor_j, row.motor_j, 0.02 * row.motor_j) << row.duration_s;
    EXPECT_NEAR(rounded.combined_j, row.combined_j,
                0.02 * row.combined_j + above.combined_j - rounded.combined_j)
        << row.duration_s;
  }
}

}  // namespace
}  // namespace joulecast::planning

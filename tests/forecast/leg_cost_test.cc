#include "forecast/leg_cost.h"

#include <gtest/gtest.h>

#include <cmath>

#include "planning/baseline.h"
#include "robots.h"

namespace joulecast::forecast {
namespace {

planning::Path path_of(const PlannedLeg& leg) {
  planning::Path path;
  planning::Run run;
  run.turn = leg.motion == Motion::turn ? 1 : 0;
  run.payload_kg = leg.payload_kg;
  run.knots = {{0, leg.curvature_1_m, {}}, {leg.way, leg.curvature_1_m, {}}};
  path.runs.push_back(run);
  return path;
}

// The planner's own ramps, integrated by Simpson's rule with 24 steps a span, price the same motions. Both
// rules are exact for the polynomial power of robots without effects.
TEST(LegPricer, AgreesWithBaselineQuadrature) {
  for (const char* kind : {"amr", "nomad", "p3dx", "tug"}) {
    const robot::RobotModel robot = shipped(kind);
    const dynamics::DriveModel drive = *dynamics::drive_model(robot);
    const LegPricer pricer(robot, drive);
    Pace pace = default_pace(robot);
    for (const PlannedLeg& leg :
         {PlannedLeg{Motion::drive, 7.5, 0, 0.5 * robot.limits.payload_kg, 0},
          PlannedLeg{Motion::drive, 0.3, 0, 0, 0}, PlannedLeg{Motion::drive, 5, 0.4, 0, 0},
          PlannedLeg{Motion::turn, 2.2, 0, robot.limits.payload_kg, 0}}) {
      const LegCost cost = pricer.paced(leg, pace);
      const bool turning = leg.motion == Motion::turn;
      const double a = turning ? pace.yaw_acceleration_rad_s2 : pace.acceleration_m_s2;
      const double top = turning ? pace.yaw_rate_rad_s : pace.speed_m_s;
      const double v = std::min(top, std::sqrt(leg.way * a));
      const double duration[] = {leg.way / v + v / a};
      const auto baseline = planning::ramp_baseline(*planning::DriveLoads::make(robot, {}), path_of(leg),
                                                    duration, 0, 0, v / a / duration[0]);
      ASSERT_TRUE(baseline);
      EXPECT_NEAR(cost.duration_s, duration[0], 1e-9 * duration[0]);
      dynamics::Instant at;
      at.payload_kg = leg.payload_kg;
      const auto wheels = [&](double speed) {
        return dynamics::wheels_of_body(drive.parameters(), turning ? 0 : speed, turning ? speed : 0);
      };
      const auto power_at = [&](double speed, double acceleration) {
        at.wheel_speed_rad_s = wheels(speed);
        at.wheel_acceleration_rad_s2 = wheels(acceleration);
        return drive.flow(at).battery_power_w;
      };
      double ends = 0;
      for (const double sign : {1.0, -1.0})
        ends += std::fabs(power_at(1e-3 * v, sign * a) - power_at(0, sign * a)) * v / a / 144;
      EXPECT_NEAR(cost.standing_j + cost.motor_j, baseline->energy_j, 1.1 * ends + 1e-5 * baseline->energy_j)
          << kind;
    }
  }
}

// Effects that bend the power away from a parabola are priced by quadrature; a fine rule of its own agrees.
TEST(LegPricer, IntegratesNonQuadraticPower) {
  robot::RobotModel robot = shipped("amr");
  robot.effects.push_back({"no_regeneration", {{"fraction", 1.0}}});
  const dynamics::DriveModel drive = *dynamics::drive_model(robot);
  const LegPricer pricer(robot, drive);
  Pace pace = default_pace(robot);
  pace.acceleration_m_s2 = robot.limits.acceleration_m_s2;
  const LegCost cost = pricer.paced(PlannedLeg{Motion::drive, 6, 0, 30, 0}, pace);
  const double v = pace.speed_m_s, a = pace.acceleration_m_s2, duration = 6 / v + v / a;
  double energy = 0;
  constexpr int steps = 100'000;
  for (int k = 0; k < steps; ++k) {
    const double t = (k + 0.5) * duration / steps, left = duration - t;
    const bool up = t < v / a, down = left < v / a;
    dynamics::Instant at;
    at.payload_kg = 30;
    at.wheel_speed_rad_s = dynamics::wheels_of_body(drive.parameters(), std::min({v, a * t, a * left}), 0);
    at.wheel_acceleration_rad_s2 = dynamics::wheels_of_body(drive.parameters(), up ? a : down ? -a : 0, 0);
    energy += drive.flow(at).battery_power_w * duration / steps;
  }
  // Four nodes a ramp do not see the kink where regeneration begins: at most a node's weight of the braking.
  EXPECT_NEAR(cost.standing_j + cost.motor_j, energy, 0.01 * energy);
}

TEST(LegPricer, DrivenAndPacedCostsAgree) {
  const robot::RobotModel robot = shipped("amr");
  const dynamics::DriveModel drive = *dynamics::drive_model(robot);
  const LegPricer pricer(robot, drive);
  Pace pace = default_pace(robot);
  const PlannedLeg planned{Motion::drive, 9, 0, 20, 0};
  const LegCost paced = pricer.paced(planned, pace);
  const Leg past{Motion::drive, paced.duration_s, 9, pace.speed_m_s, 0, 20, 0};
  const LegCost driven = pricer.driven(past);
  EXPECT_NEAR(driven.motor_j, paced.motor_j, 1e-9 * paced.motor_j);
  EXPECT_NEAR(driven.standing_j, paced.standing_j, 1e-9 * paced.standing_j);
}

// Motors that a resistance of 500 ohm leaves without force, and a gear that leaves them without speed.
TEST(LegPricer, StaysWithinTheMotorsReach) {
  const robot::RobotModel able = shipped("amr");
  const PlannedLeg leg{Motion::drive, 10, 0, 20, 0};
  const Pace pace = default_pace(able);
  EXPECT_FALSE(LegPricer(able, *dynamics::drive_model(able)).paced(leg, pace).slower);
  EXPECT_FALSE(limitation(LegPricer(able, *dynamics::drive_model(able)), able, pace, 20));

  robot::RobotModel geared = able;
  geared.motor.gear_ratio = 1000;
  const dynamics::DriveModel slow = *dynamics::drive_model(geared);
  const LegPricer pricer(geared, slow);
  const LegCost cost = pricer.paced(leg, pace);
  EXPECT_TRUE(cost.slower);
  const Reachable reached = pricer.reachable(Motion::drive, 0, 20, {pace.speed_m_s, pace.acceleration_m_s2});
  // The voltage that the gear's speed induces alone bounds it.
  EXPECT_LT(reached.cruise.speed, able.battery.nominal_voltage_v / geared.motor.voltage_constant_v_s_rad /
                                      1000 * able.kinematics.wheel_radius_m);
  EXPECT_GT(cost.duration_s, 10 / reached.cruise.speed);
  const auto told = limitation(pricer, geared, pace, 20);
  ASSERT_TRUE(told);
  EXPECT_TRUE(told->moves);
  EXPECT_EQ(told->reached.speed_m_s, reached.cruise.speed);

  robot::RobotModel feeble = able;
  feeble.motor.resistance_ohm = 500;
  const dynamics::DriveModel none = *dynamics::drive_model(feeble);
  EXPECT_TRUE(LegPricer(feeble, none).paced(leg, pace).impossible);
  const auto why = limitation(LegPricer(feeble, none), feeble, pace, 20);
  ASSERT_TRUE(why);
  EXPECT_FALSE(why->moves);
  EXPECT_NE(why->sentence.find("cannot drive"), std::string::npos) << why->sentence;
}

TEST(PlannedLegs, FollowThePath) {
  const std::vector<planning::Segment> segments{planning::Dwell{3},          planning::Straight{4},
                                                planning::TurnInPlace{-1.5}, planning::PayloadChange{7},
                                                planning::Straight{2},       planning::Dwell{5}};
  const auto path = planning::make_path(segments);
  ASSERT_TRUE(path) << describe(path.error());
  const std::vector<PlannedLeg> legs = planned_legs(*path);
  ASSERT_EQ(legs.size(), 5u);
  EXPECT_EQ(legs[0].duration_s, 3);
  EXPECT_EQ(legs[1].way, 4);
  EXPECT_EQ(legs[2].motion, Motion::turn);
  EXPECT_EQ(legs[2].way, 1.5);
  EXPECT_EQ(legs[3].payload_kg, 7);
  EXPECT_EQ(legs[4].duration_s, 5);
}

}  // namespace
}  // namespace joulecast::forecast

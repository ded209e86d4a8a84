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
TEST(LegPricer, AgreesWithTheBaselinesQuadrature) {
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
TEST(LegPricer, IntegratesWhatIsNoParabola) {
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

TEST(LegPricer, ADrivenTrapezoidCostsAsAPacedOne) {
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

TEST(UsualPace, IsTheMedianOfWhatLegsShowOnceThereAreFive) {
  const robot::RobotModel robot = shipped("amr");
  const Pace habit{0.8, 0.4, 1.0, 2.0, 0.5};
  const dynamics::DriveModel drive = *dynamics::drive_model(robot);
  const LegPricer pricer(robot, drive);
  std::vector<Leg> legs;
  const auto add = [&](Motion motion, double way, double scale) {
    Pace pace = habit;
    pace.speed_m_s *= scale;
    pace.yaw_rate_rad_s *= scale;
    const LegCost cost = pricer.paced(PlannedLeg{motion, way, 0, 0, 0}, pace);
    legs.push_back({motion, cost.duration_s, way,
                    motion == Motion::turn ? pace.yaw_rate_rad_s : pace.speed_m_s, 0, 0, 0});
    legs.push_back({Motion::stand, habit.pause_s, 0, 0, 0, 0, 0});
  };
  for (const double scale : {0.9, 0.95, 1.0, 1.05, 1.1}) {
    add(Motion::turn, 3, scale);
    add(Motion::drive, 8, scale);
  }
  const Pace found = usual_pace(robot, legs);
  EXPECT_NEAR(found.speed_m_s, habit.speed_m_s, 1e-9);
  EXPECT_NEAR(found.acceleration_m_s2, habit.acceleration_m_s2, 1e-9);
  EXPECT_NEAR(found.yaw_rate_rad_s, habit.yaw_rate_rad_s, 1e-9);
  EXPECT_NEAR(found.yaw_acceleration_rad_s2, habit.yaw_acceleration_rad_s2, 1e-9);
  // The halts hold the neighbours' creeping ends too: still speed over acceleration at either side.
  const double still = still_speed_m_s(robot);
  EXPECT_NEAR(found.pause_s, habit.pause_s - still / 0.4 - still / (robot.kinematics.half_track_m * 2.0),
              1e-9);

  legs.resize(8);
  EXPECT_EQ(usual_pace(robot, legs).speed_m_s, default_pace(robot).speed_m_s);
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

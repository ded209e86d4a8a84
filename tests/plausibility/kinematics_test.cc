#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>

#include "plausibility/check.h"
#include "tests/plausibility/made_recordings.h"
#include "tests/support/sample_robots.h"

namespace joulecast::plausibility {
namespace {

struct World {
  double track = 1, radius = 1, right_radius = 1;  // factors of the file's values
  double turn_slip = 0;                            // share of the distance, while turning
  double gyro_bias = 0, gyro_gain = 1;
};

// A robot with these kinematics and without electrical channels.
telemetry::RecordingSet kinematic_drive(const robot::RobotModel& robot, const World& world, bool map = true) {
  std::mt19937_64 random(4);
  std::normal_distribution<double> normal;
  double x = 0, y = 0, heading = 0, last = 0;
  const double right = robot.kinematics.wheel_radius_m * world.radius * world.right_radius;
  const double left = robot.kinematics.wheel_radius_m * world.radius;
  return *telemetry::make_recording_set(
      "made", {made::mission(200, 20, [&](double t, signals::Sample& s) {
        const made::Motion m = made::motion(t);
        const double yaw =
            (right * m.speed[0] - left * m.speed[1]) / (2 * robot.kinematics.half_track_m * world.track);
        const bool turns = std::fabs(m.speed[0] - m.speed[1]) > 1;
        const double speed =
            0.5 * (right * m.speed[0] + left * m.speed[1]) * (turns ? 1 - world.turn_slip : 1.0);
        heading += yaw * (t - last);
        x += speed * std::cos(heading) * (t - last);
        y += speed * std::sin(heading) * (t - last);
        last = t;
        s.wheel_velocity_rad_s = {m.speed[0] + 0.01 * normal(random), m.speed[1] + 0.01 * normal(random)};
        s.yaw_rate_rad_s = world.gyro_gain * yaw + world.gyro_bias + 0.004 * normal(random);
        if (map) {
          s.pose = {x + 0.01 * normal(random), y + 0.01 * normal(random),
                    std::remainder(heading, 6.283185307179586) + 0.01 * normal(random)};
        }
      })});
}

std::vector<std::string> ids(const std::vector<Check>& checks) {
  std::vector<std::string> all;
  for (const Check& c : checks) all.push_back(c.id);
  return all;
}

const Check* find_kinematic(const std::vector<Check>& checks, std::string_view id) {
  const auto at = std::ranges::find(checks, id, &Check::id);
  return at == checks.end() ? nullptr : &*at;
}

class Kinematics : public ::testing::Test {
 protected:
  Kinematics() { robot_.limits.speed_m_s = 1; }
  robot::RobotModel robot_ = testing::nomad();
};

TEST_F(Kinematics, ReturnsNothingForSoundRobot) {
  EXPECT_EQ(ids(check_recordings(kinematic_drive(robot_, {}), robot_)), std::vector<std::string>{});
  EXPECT_EQ(ids(check_recordings(kinematic_drive(robot_, {.track = 1.08, .radius = 0.95, .turn_slip = 0.03}),
                                 robot_)),
            std::vector<std::string>{});
}

TEST_F(Kinematics, EstimatesTrackOfSkidSteering) {
  for (const bool map : {true, false}) {
    const auto checks = check_recordings(kinematic_drive(robot_, {.track = 3.1}, map), robot_);
    ASSERT_TRUE(find_kinematic(checks, "track_against_gyro"));
    const Check& check = *find_kinematic(checks, "track_against_gyro");
    EXPECT_NEAR(check.value, 3.1, 0.1);
    EXPECT_FALSE(check.contradicted);
    EXPECT_NE(check.says.find("0.165 m"), std::string::npos) << check.says;
    EXPECT_NE(check.says.find("skid"), std::string::npos) << check.says;
    EXPECT_TRUE(std::ranges::none_of(checks, &Check::contradicted));
  }
}

TEST_F(Kinematics, EstimatesRadiusFromMap) {
  const auto checks = check_recordings(kinematic_drive(robot_, {.radius = 1.3, .turn_slip = 0}), robot_);
  ASSERT_TRUE(find_kinematic(checks, "radius_against_pose"));
  EXPECT_NEAR(find_kinematic(checks, "radius_against_pose")->value, 1.3, 0.03);
}

TEST_F(Kinematics, DetectsSlipInTurns) {
  const auto checks = check_recordings(kinematic_drive(robot_, {.turn_slip = 0.35}), robot_);
  ASSERT_TRUE(find_kinematic(checks, "slip_in_turns"));
  EXPECT_NEAR(find_kinematic(checks, "slip_in_turns")->value, -0.35, 0.1);
}

TEST_F(Kinematics, DetectsUnequalSides) {
  const auto checks = check_recordings(kinematic_drive(robot_, {.right_radius = 1.12}), robot_);
  ASSERT_TRUE(find_kinematic(checks, "sides_against_gyro"));
  EXPECT_NEAR(find_kinematic(checks, "sides_against_gyro")->value, 0.12, 0.03);
}

TEST_F(Kinematics, DetectsGyroDriftAndGain) {
  const auto drifts = check_recordings(kinematic_drive(robot_, {.gyro_bias = 0.03}), robot_);
  ASSERT_TRUE(find_kinematic(drifts, "gyro_drift"));
  EXPECT_NEAR(find_kinematic(drifts, "gyro_drift")->value, 0.03, 0.005);
  const auto gains = check_recordings(kinematic_drive(robot_, {.gyro_gain = 1.25}), robot_);
  ASSERT_TRUE(find_kinematic(gains, "heading_against_gyro"));
  EXPECT_NEAR(find_kinematic(gains, "heading_against_gyro")->value, 0.8, 0.03);
}

}  // namespace
}  // namespace joulecast::plausibility

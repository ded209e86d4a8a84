#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "plausibility/check.h"
#include "plausibility/evidence.h"
#include "tests/plausibility/made_recordings.h"
#include "tests/support/sample_robots.h"

namespace joulecast::plausibility {
namespace {

struct Truth {
  double resistance = 1.5, constant = 1.6, drop = 0.4, friction = 0.9, viscous = 0.03, inertia = 0.5,
         load = 0.3;
};

// A drive of two motors that obey the motor equations, with additional loads independent of motion.
telemetry::RecordingSet motor_drive(const Truth& right, const Truth& left, double delay_s = 0,
                                    double noise = 0.02) {
  std::mt19937_64 random(3);
  std::normal_distribution<double> normal;
  std::vector<telemetry::Recording> missions;
  for (int m = 0; m < 3; ++m) {
    missions.push_back(made::mission(60, 25, [&](double t, signals::Sample& s) {
      const double at = t + 31 * m;
      const made::Motion now = made::motion(at), then = made::motion(at - delay_s);
      s.utime_us += 1'000'000'000LL * m;
      s.wheel_velocity_rad_s = now.speed;
      for (std::size_t k : {0u, 1u}) {
        const Truth& motor = k == 0 ? right : left;
        const double w = then.speed[k], way = w > 0 ? 1 : w < 0 ? -1 : 0;
        const double load = motor.load * std::sin(0.9 * at) + 0.02 * normal(random);
        const double current =
            motor.friction * way + motor.viscous * w + motor.inertia * then.slope[k] + load;
        s.motor_current_a[k] = current + noise * normal(random);
        s.motor_voltage_v[k] =
            motor.resistance * current + motor.constant * w + motor.drop * way + noise * normal(random);
      }
    }));
    missions.back().mission_id = "m" + std::to_string(m);
  }
  return *telemetry::make_recording_set("made", std::move(missions));
}

robot::RobotModel robot() {
  robot::RobotModel r = testing::nomad();
  r.motor.resistance_ohm = 1.5;
  return r;
}

std::vector<Check> about(const std::vector<Check>& checks, std::string_view id) {
  std::vector<Check> some;
  for (const Check& c : checks) {
    if (c.id == id) some.push_back(c);
  }
  return some;
}

std::array<MotorConstants, 2> motor_constants(const telemetry::RecordingSet& set) {
  const robot::RobotModel model = robot();
  const dynamics::DriveModel drive(model, {});
  std::vector<Observation> observations;
  for (const telemetry::Recording& mission : set.missions)
    observations.push_back(observe(mission, model, drive));
  return plausibility::motor_constants({observations, model, drive, set.missions});
}

TEST(MotorConstants, ReturnsConstantsPerMotor) {
  const Truth left{1.4, 1.62, 0.3, 1.1, 0.02, 0.6};
  const auto m = motor_constants(motor_drive({}, left));
  for (std::size_t k : {0u, 1u}) {
    const Truth truth = k == 0 ? Truth{} : left;
    EXPECT_NEAR(m[k].resistance_ohm.value, truth.resistance, 0.05);
    EXPECT_NEAR(m[k].constant_v_s_rad.value, truth.constant, 0.01);
    EXPECT_NEAR(m[k].steady_current_a.value, truth.friction + truth.viscous * m[k].mean_speed_rad_s, 0.1);
    EXPECT_NEAR(m[k].current_per_rad_s2_a.value, truth.inertia, 0.05);
    EXPECT_TRUE(m[k].resistance_ohm.sure());
  }
}

TEST(MotorConstants, KeepsConstantsUnderDelay) {
  const auto m = motor_constants(motor_drive({}, {}, 0.15));
  EXPECT_NEAR(m[0].resistance_ohm.value, 1.5, 0.1);
  EXPECT_NEAR(m[0].constant_v_s_rad.value, 1.6, 0.02);
}

// A light robot: 10 ms are a fifth of its mechanical time constant.
TEST(MotorConstants, KeepsResistanceUnderShortDelay) {
  for (const double resistance : {1.2, 1.5, 1.95}) {
    for (const double delay_s : {-0.02, -0.01, 0.0, 0.01, 0.02}) {
      for (const double noise : {0.02, 0.06}) {
        const Truth truth{.resistance = resistance, .inertia = 0.05, .load = 0.1};
        for (const MotorConstants& m : motor_constants(motor_drive(truth, truth, delay_s, noise))) {
          const Estimate& found = m.resistance_ohm;
          EXPECT_NEAR(found.value, resistance, std::max(0.05 * resistance, 3 * found.sd)) << delay_s << noise;
          EXPECT_LT(found.sd, 0.1) << delay_s << noise;
        }
      }
    }
  }
}

TEST(MotorChecks, AcceptsSimilarMotors) {
  const auto checks = check_recordings(motor_drive({}, Truth{1.55, 1.62, 0.4, 1.0, 0.03, 0.52}), robot());
  EXPECT_TRUE(about(checks, "motor_against_sibling").empty());
  EXPECT_TRUE(about(checks, "motor_current_against_sibling").empty());
}

TEST(MotorChecks, FindsWeakCurrentSensor) {
  for (const double gain : {0.75, 0.4}) {
    telemetry::RecordingSet set = motor_drive({}, {});
    for (auto& mission : set.missions) {
      for (auto& s : mission.samples) s.motor_current_a[1] *= gain;
    }
    const auto found = about(check_recordings(set, robot()), "motor_current_against_sibling");
    ASSERT_EQ(found.size(), 1u) << gain;
    EXPECT_EQ(found[0].channel, "motor_current.left");
    EXPECT_NEAR(found[0].value, gain, 0.05);
    EXPECT_EQ(found[0].contradicted, gain < 0.5);  // the diagnosis handles a gain error of 25 %
  }
}

TEST(MotorChecks, FindsWeakVoltageSensor) {
  telemetry::RecordingSet set = motor_drive({}, {});
  for (auto& mission : set.missions) {
    for (auto& s : mission.samples) s.motor_voltage_v[0] *= 0.7;
  }
  const auto found = about(check_recordings(set, robot()), "motor_voltage_against_sibling");
  ASSERT_EQ(found.size(), 1u);
  EXPECT_EQ(found[0].channel, "motor_voltage.right");
  EXPECT_NEAR(found[0].value, 0.7, 0.05);
}

TEST(MotorChecks, FindsMotorWithExcessFriction) {
  const auto checks = check_recordings(motor_drive(Truth{1.5, 1.6, 0.4, 2.7, 0.03, 0.5}, {}), robot());
  const auto found = about(checks, "motor_against_sibling");
  ASSERT_EQ(found.size(), 1u);
  EXPECT_GT(found[0].value, 1.8);
  EXPECT_FALSE(found[0].contradicted);
}

// Motors at 24 V throughout, loaded to different speeds; then the same voltages with the wheels' speeds of
// another duty.
TEST(MotorChecks, AcceptsFullDutyFromSupply) {
  for (const double duty : {1.0, 0.5}) {
    telemetry::RecordingSet set = motor_drive({}, {});
    for (auto& mission : set.missions) {
      for (std::size_t n = 0; n < mission.samples.size(); ++n) {
        signals::Sample& s = mission.samples[n];
        for (std::size_t k : {0u, 1u}) {
          s.motor_current_a[k] = 3 + 2 * std::sin(0.01 * static_cast<double>(n) + static_cast<double>(k));
          s.motor_voltage_v[k] = 24 + 0.1 * std::cos(0.02 * static_cast<double>(n));
          s.wheel_velocity_rad_s[k] =
              (duty * s.motor_voltage_v[k] - robot().motor.resistance_ohm * s.motor_current_a[k]) /
              dynamics::DriveModel(robot(), {}).parameters().voltage_constant_v_s_rad;
        }
      }
    }
    EXPECT_EQ(about(check_recordings(set, robot()), "supply_for_motor_voltage").size(), duty < 1 ? 1u : 0u);
  }
}

}  // namespace
}  // namespace joulecast::plausibility

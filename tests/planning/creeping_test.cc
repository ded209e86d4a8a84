// Slow and short motions, in which the drive model fades dry friction below 0.005 rad/s: planner, estimate
// and meter report the energy of friction that does not fade, less the closed form of what fading saves.
// Motors of a few milliamperes, in which the brushes' drop of voltage fades, report all of its energy.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <numbers>
#include <vector>

#include "energy/meter.h"
#include "energy/motion_estimate.h"
#include "planning/planner.h"
#include "tests/planning/robots.h"

namespace joulecast::planning {
namespace {

// From the thesis's equations (2-31), (2-32) of a robot whose centre of mass is on its axle.
struct Reference {
  double energy_j = 0;  // dry friction opposes any motion in full
  double faded_j = 0;   // saved where friction is T w / sqrt(w^2 + width^2), to first order of the width
};

Reference reference_of(const robot::RobotModel& r, double payload_kg, const Profile& rows,
                       double brush_drop_v = 0) {
  constexpr double width = 0.005;
  const double radius = r.kinematics.wheel_radius_m, l = r.kinematics.half_track_m;
  const double mass = r.mass.chassis_kg + 2 * r.mass.wheel_kg + payload_kg;
  const double yaw_inertia = r.mass.yaw_inertia_kg_m2 + 0.02 * payload_kg;
  const double constant = r.motor.torque_constant_nm_a * r.motor.gear_ratio;
  Reference sum;
  for (std::size_t k = 0; k + 1 < rows.size(); ++k) {
    const double span = rows.time_s[k + 1] - rows.time_s[k];
    const double slope = (rows.speed_m_s[k + 1] - rows.speed_m_s[k]) / span;
    const double yaw_slope = (rows.yaw_rate_rad_s[k + 1] - rows.yaw_rate_rad_s[k]) / span;
    sum.energy_j += span * r.idle_power_w;
    for (const std::size_t side : {0u, 1u}) {
      const double sign = side == 0 ? 1 : -1;
      const auto wheel = [&](double v, double yaw) { return (v + sign * l * yaw) / radius; };
      const double w0 = wheel(rows.speed_m_s[k], rows.yaw_rate_rad_s[k]);
      const double w1 = wheel(rows.speed_m_s[k + 1], rows.yaw_rate_rad_s[k + 1]);
      const double rate = wheel(slope, yaw_slope), way = w0 + w1 < 0 ? -1 : 1;
      const double dry = r.motor.friction_torque_nm[side];
      const double inertial = 0.5 * radius * (mass * slope + sign * yaw_inertia * yaw_slope / l) +
                              (r.mass.wheel_inertia_kg_m2 + r.motor.rotor_inertia_kg_m2) * rate;
      const auto power = [&](double w) {
        const double torque = inertial + r.motor.viscous_friction_nm_s_rad * w + way * dry;
        return r.motor.resistance_ohm * torque * torque / (constant * constant) + w * torque +
               brush_drop_v * std::fabs(torque) / constant;
      };
      sum.energy_j += span / 6 * (power(w0) + 4 * power(0.5 * (w0 + w1)) + power(w1));
      // The integrals over the speed of 1 - s and 1 - s^2, s = w / sqrt(w^2 + width^2), are width and
      // width * pi/2.
      if (w0 == 0 || w1 == 0)
        sum.faded_j += width / std::fabs(rate) * r.motor.resistance_ohm / (constant * constant) * dry *
                       (2 * way * inertial + 0.5 * std::numbers::pi * dry);
    }
  }
  return sum;
}

double metered_j(const robot::RobotModel& robot, double payload_kg, const Profile& rows) {
  // A short window of the acceleration filter, which otherwise rounds the corners of so short motions.
  energy::Meter meter(*dynamics::drive_model(robot), {.half_window_s = 0.001},
                      [](const energy::MeterPoint&) {});
  const double radius = robot.kinematics.wheel_radius_m, l = robot.kinematics.half_track_m;
  std::size_t row = 0;
  constexpr double period_s = 0.0005, standing_s = 0.2;
  const double end_s = rows.time_s.back() + standing_s;
  std::int64_t sequence = 0;
  for (double t = -standing_s; t < end_s; t += period_s) {
    while (row + 2 < rows.size() && rows.time_s[row + 1] < t) ++row;
    const double f = std::clamp((t - rows.time_s[row]) / (rows.time_s[row + 1] - rows.time_s[row]), 0.0, 1.0);
    const double v = std::lerp(rows.speed_m_s[row], rows.speed_m_s[row + 1], f),
                 yaw = std::lerp(rows.yaw_rate_rad_s[row], rows.yaw_rate_rad_s[row + 1], f);
    signals::Sample sample;
    sample.utime_us = 1'700'000'000'000'000 + std::llround(t * 1e6);
    sample.sequence = sequence++;
    sample.wheel_velocity_rad_s = {(v + l * yaw) / radius, (v - l * yaw) / radius};
    sample.payload_kg = payload_kg;
    EXPECT_TRUE(meter.add(sample));
  }
  EXPECT_TRUE(meter.flush());
  const signals::Accounts accounts = meter.accounts();
  return accounts.modelled_j - robot.idle_power_w * (accounts.duration_s - rows.time_s.back());
}

struct Creep {
  Segment segment;
  double payload_kg = 0, acceleration_m_s2 = 0;
};

TEST(Creeping, FrictionCountsFromStandstill) {
  robot::RobotModel heavy = test::tug();
  heavy.idle_power_w = 5;
  for (const Creep& creep : {Creep{TurnInPlace{0.29}, 207, 0.5},
                             {Straight{0.03}, 250, 0.054},
                             {Straight{0.3}, 250, 0.054},
                             {TurnInPlace{0.02}, 0, 0.02}}) {
    const auto path = make_path(std::vector<Segment>{creep.segment},
                                PathOptions{.start = {}, .payload_kg = creep.payload_kg});
    ASSERT_TRUE(path);
    Problem problem;
    problem.limits = limits_of(heavy);
    problem.limits.acceleration_m_s2 = creep.acceleration_m_s2;
    const auto plan = planning::plan(heavy, *path, problem);
    ASSERT_TRUE(plan) << describe(plan.error());
    const Profile& rows = plan->profile;
    const Reference reference = reference_of(heavy, creep.payload_kg, rows);
    std::vector<energy::MotionPoint> points;
    for (std::size_t k = 0; k < rows.size(); ++k)
      points.push_back({rows.time_s[k], rows.speed_m_s[k], rows.yaw_rate_rad_s[k]});
    const auto estimate = energy::estimate_motion(*dynamics::drive_model(heavy), points, creep.payload_kg);
    ASSERT_TRUE(estimate) << describe(estimate.error());
    const double faded = reference.energy_j - reference.faded_j;
    EXPECT_LT(reference.faded_j, 0.01 * reference.energy_j);
    EXPECT_NEAR(plan->summary.energy_j, faded, 3e-4 * faded);
    EXPECT_NEAR(estimate->battery_j, faded, 3e-4 * faded);
    EXPECT_NEAR(metered_j(heavy, creep.payload_kg, rows), faded, 1e-3 * faded);
  }
}

TEST(SmallCurrents, LoseEnergyInTheBrushes) {
  robot::RobotModel toy;
  toy.robot_id = "toy";
  toy.kinematics = {0.03, 0.05, 0};
  toy.mass = {0.4, 0.015, 6e-4, 7e-6};
  toy.motor = {8, 0, 0.02, 0.02, 50, 0, 1e-4, {0.005, 0.0055}};
  toy.battery.nominal_voltage_v = 6;
  toy.idle_power_w = 0.005;
  toy.limits = {0.3, 0.2, 3, 0.5, 0.1};
  constexpr double brush_drop_v = 1;
  toy.effects = {{"brush_drop", {{"voltage_v", brush_drop_v}}}};
  for (const std::vector<Segment>& segments :
       {std::vector<Segment>{Straight{1.5}}, {TurnInPlace{2}}, {Straight{0.5}, Arc{0.3, 1.5}}}) {
    const auto path = make_path(segments);
    ASSERT_TRUE(path);
    Problem problem;
    problem.limits = limits_of(toy);
    const auto plan = planning::plan(toy, *path, problem);
    ASSERT_TRUE(plan) << describe(plan.error());
    const Profile& rows = plan->profile;
    const Reference reference = reference_of(toy, 0, rows, brush_drop_v);
    std::vector<energy::MotionPoint> points;
    for (std::size_t k = 0; k < rows.size(); ++k)
      points.push_back({rows.time_s[k], rows.speed_m_s[k], rows.yaw_rate_rad_s[k]});
    const auto estimate = energy::estimate_motion(*dynamics::drive_model(toy), points, 0);
    ASSERT_TRUE(estimate) << describe(estimate.error());
    const double faded = reference.energy_j - reference.faded_j;
    EXPECT_NEAR(plan->summary.energy_j, faded, 3e-4 * faded);
    EXPECT_NEAR(estimate->battery_j, faded, 3e-4 * faded);
    EXPECT_NEAR(metered_j(toy, 0, rows), faded, 1e-3 * faded);
  }
}

}  // namespace
}  // namespace joulecast::planning

// Planned motions driven by motor voltages: the armatures' voltages that the plan implies, and a proportional
// correction of the wheel speeds as robots have it, act on the equations of motion (2-43) with winding
// inductance, integrated by CVODE. The battery's energy is compared with the plan's.
#include "tests/dynamics/forward/forward.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "energy/integrators.h"
#include "planning/planner.h"
#include "tests/planning/random_problem.h"

namespace joulecast::planning {
namespace {

// State: x, y, heading, wheel speeds, armature currents, battery energy.
class Drive : public energy::InitialValueProblem {
 public:
  Drive(const dynamics::DriveModel& model, const Profile& rows, double inductance_h)
      : model_(model), rows_(rows), inductance_h_(inductance_h) {
    const auto& p = model.parameters();
    gain_v_s_rad_ = 5 * p.voltage_constant_v_s_rad;
  }

  void select(std::size_t row) { row_ = row; }

  // The planned motion at a time within the selected row.
  dynamics::Instant planned(double t) const {
    const double h = rows_.time_s[row_ + 1] - rows_.time_s[row_];
    const double f = (t - rows_.time_s[row_]) / h;
    const auto mix = [&](const std::vector<double>& c) { return c[row_] + f * (c[row_ + 1] - c[row_]); };
    const auto slope = [&](const std::vector<double>& c) { return (c[row_ + 1] - c[row_]) / h; };
    const auto& p = model_.parameters();
    dynamics::Instant at;
    at.wheel_speed_rad_s = dynamics::wheels_of_body(p, mix(rows_.speed_m_s), mix(rows_.yaw_rate_rad_s));
    at.wheel_acceleration_rad_s2 =
        dynamics::wheels_of_body(p, slope(rows_.speed_m_s), slope(rows_.yaw_rate_rad_s));
    at.payload_kg = rows_.payload_kg[row_];
    at.x_m = mix(rows_.x_m), at.y_m = mix(rows_.y_m), at.heading_rad = mix(rows_.heading_rad);
    return at;
  }

  void rate(double t, std::span<const double> y, std::span<double> dy) override {
    dynamics::DriveState s;
    s.x_m = y[0], s.y_m = y[1], s.heading_rad = y[2];
    s.wheel_speed_rad_s = {y[3], y[4]};
    s.current_a = {y[5], y[6]};
    const dynamics::Instant want = planned(t);
    std::array<double, 2> volts = model_.flow(want).voltage_v;
    for (std::size_t k : {0u, 1u}) volts[k] += gain_v_s_rad_ * (want.wheel_speed_rad_s[k] - y[3 + k]);
    const auto d = dynamics::derivative(model_, s, want.payload_kg, inductance_h_, volts);
    const auto amps = inductance_h_ > 0 ? s.current_a : dynamics::algebraic_current(model_, s, volts);
    dy[0] = d.x_m, dy[1] = d.y_m, dy[2] = d.heading_rad;
    for (std::size_t k : {0u, 1u}) {
      dy[3 + k] = d.wheel_speed_rad_s[k];
      dy[5 + k] = d.current_a[k];
    }
    dy[7] = model_.battery_power_for({volts[0] * amps[0], volts[1] * amps[1]});
  }

  void weights(std::span<const double> y, std::span<double> w) const override {
    constexpr double relative = 1e-6;
    constexpr std::array<double, 8> scale = {1, 1, 1, 0.1, 0.1, 0.1, 0.1, 1};
    for (std::size_t k = 0; k < w.size(); ++k) w[k] = 1 / (relative * (std::fabs(y[k]) + scale[k]));
  }

 private:
  const dynamics::DriveModel& model_;
  const Profile& rows_;
  double inductance_h_, gain_v_s_rad_;
  std::size_t row_ = 0;
};

struct Driven {
  double energy_j = 0;
  Pose end;
};

Driven drive(const dynamics::DriveModel& model, const Profile& rows, double inductance_h) {
  Drive problem(model, rows, inductance_h);
  energy::Cvode cvode(8, problem);
  const auto start = problem.planned(0);
  auto y = cvode.state();
  std::fill(y.begin(), y.end(), 0.0);
  y[0] = start.x_m, y[1] = start.y_m, y[2] = start.heading_rad;
  for (std::size_t k : {0u, 1u}) {
    y[3 + k] = start.wheel_speed_rad_s[k];
    y[5 + k] = inductance_h > 0 ? model.flow(start).current_a[k] : 0;
  }
  for (std::size_t k = 0; k + 1 < rows.size(); ++k) {
    if (!(rows.time_s[k + 1] > rows.time_s[k])) continue;
    problem.select(k);
    const auto done = cvode.advance(rows.time_s[k], rows.time_s[k + 1]);
    EXPECT_TRUE(done) << describe(done.error());
  }
  return {y[7], {y[0], y[1], y[2]}};
}

class DrivenForward : public ::testing::TestWithParam<int> {};

TEST_P(DrivenForward, SpendsThePlannedEnergy) {
  double worst = 0;
  for (int i = 0; i < 10; ++i) {
    const int seed = 10 * GetParam() + i;
    const test::RandomProblem p = test::random_problem(static_cast<std::uint64_t>(seed));
    SCOPED_TRACE(std::to_string(seed) + " " + p.robot.robot_id + " " + p.label);
    const auto path = make_path(p.segments, p.options);
    ASSERT_TRUE(path);
    Path run;
    run.runs = {path->runs.back()};
    const auto answer = plan(p.robot, run, p.problem);
    ASSERT_TRUE(answer) << describe(answer.error());
    const auto loads = DriveLoads::make(p.robot, p.problem.regeneration);
    ASSERT_TRUE(loads);
    const Driven driven = drive(loads->model(), answer->profile, p.robot.motor.inductance_h);
    const double promised = answer->summary.energy_j;
    worst = std::max(worst, std::fabs(driven.energy_j / promised - 1));
    EXPECT_NEAR(driven.energy_j, promised, 5e-3 * promised);
    const Pose end = run.runs[0].knots.back().pose;
    const double length = run.runs[0].length();
    EXPECT_NEAR(driven.end.x_m, end.x_m, 5e-3 * length + 1e-3);
    EXPECT_NEAR(driven.end.y_m, end.y_m, 5e-3 * length + 1e-3);
    EXPECT_NEAR(driven.end.heading_rad, end.heading_rad, 0.02);
  }
  RecordProperty("worst_departure", std::to_string(worst));
}

INSTANTIATE_TEST_SUITE_P(TwoHundredProblems, DrivenForward, ::testing::Range(0, 22));

}  // namespace
}  // namespace joulecast::planning

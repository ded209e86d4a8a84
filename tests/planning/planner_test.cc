#include "planning/planner.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numeric>

#include "planning/cost_table.h"
#include "planning/line.h"
#include "tests/planning/robots.h"
#include "tests/support/straight_power.h"

namespace joulecast::planning {
namespace {

Path made_plan(const std::vector<Segment>& segments, double payload_kg = 0) {
  auto path = make_path(segments, PathOptions{.start = {}, .payload_kg = payload_kg});
  EXPECT_TRUE(path) << describe(path.error());
  return *path;
}

Problem limited(const robot::RobotModel& robot, double regeneration = 1) {
  Problem problem;
  problem.limits = limits_of(robot);
  problem.regeneration = regeneration;
  return problem;
}

TEST(Planner, StraightIsTheClosedForm) {
  for (const robot::RobotModel& robot : test::all_robots()) {
    const auto answer = plan(robot, made_plan({Straight{4}}, 5), Problem{});
    ASSERT_TRUE(answer) << describe(answer.error());
    EXPECT_EQ(answer->certificate.method, Method::closed_form);
    LineTask task{dynamics::straight_power(robot, 5).over_distance(), 4};
    task.power.c0 += robot.idle_power_w;
    const auto line = line_in_free_time(task);
    ASSERT_TRUE(line);
    // The drive model reduces dry friction below 0.005 rad/s, which the closed form does not.
    EXPECT_NEAR(answer->summary.energy_j, line->energy_j(), 1e-5 * line->energy_j());
    EXPECT_NEAR(answer->summary.duration_s, line->duration_s(), 1e-6 * line->duration_s());
  }
}

TEST(Planner, AnswersClosedFormsImmediately) {
  const auto planner = Planner::make(test::nomad());
  Problem problem;
  problem.limits = limits_of(test::nomad());
  const Path line = made_plan({Straight{10}});
  const auto at_once = planner->plan_at_once(line, problem);
  const auto answer = planner->plan(line, problem);
  ASSERT_TRUE(at_once && answer);
  EXPECT_EQ(at_once->profile.energy_j, answer->profile.energy_j);
  EXPECT_EQ(at_once->ledger.value, answer->ledger.value);
  EXPECT_EQ(at_once->certificate.binding, answer->certificate.binding);
  EXPECT_FALSE(planner->plan_at_once(made_plan({Arc{2, 1}, Straight{3}}), problem));
  EXPECT_FALSE(planner->plan_at_once(made_plan({Straight{10}, TurnInPlace{1}, Straight{1}}), problem));
  problem.deadline_s = 100;
  EXPECT_FALSE(planner->plan_at_once(line, problem));
  problem.deadline_s.reset();
  problem.start_speed_m_s = 5;  // over the limit: an error
  EXPECT_FALSE(planner->plan_at_once(line, problem));
}

// The solvers on a problem with a known closed form: a regeneration of 1 - 1e-9 disables the closed form, a
// slight change of curvature the quadrature.
TEST(Planner, SolverConvergesWithSecondOrder) {
  const robot::RobotModel robot = test::amr();
  const Path path = made_plan({Straight{5}});
  const Path bent =
      *make_path(std::vector<Segment>{Clothoid{5, 0, 1e-7}}, PathOptions{.start = {}, .resolution_m = 1});
  const double exact = plan(robot, path, Problem{})->summary.energy_j;
  double last = 0;
  for (std::size_t cells : {32u, 64u, 128u}) {
    Problem problem;
    problem.regeneration = 1 - 1e-9;
    problem.intervals_per_run = cells;
    const auto quadrature = plan(robot, path, problem);
    ASSERT_TRUE(quadrature) << describe(quadrature.error());
    EXPECT_EQ(quadrature->certificate.method, Method::quadrature);
    EXPECT_NEAR(quadrature->summary.energy_j, exact, 1e-4 * exact);
    const auto answer = plan(robot, bent, problem);
    ASSERT_TRUE(answer) << describe(answer.error());
    EXPECT_EQ(answer->certificate.method, Method::interior_point);
    const double error = answer->summary.energy_j - exact;
    EXPECT_GT(error, -1e-6 * exact);
    EXPECT_LT(error, 2e-4 * exact);
    if (last > 0) {
      EXPECT_LT(error, 0.4 * last);  // a quarter, and the barrier's error
    }
    last = error;
  }
}

TEST(Planner, LessRegenerationCostsMore) {
  const robot::RobotModel robot = test::tug();
  const Path path = made_plan({Straight{8}}, 100);
  double last = 0, returned = 1e300;
  for (double fraction : {1.0, 0.7, 0.3, 0.0}) {
    const auto answer = plan(robot, path, limited(robot, fraction));
    ASSERT_TRUE(answer) << describe(answer.error());
    EXPECT_GT(answer->summary.energy_j, last);
    EXPECT_LE(answer->summary.braking_j, returned * (1 + 1e-6));
    EXPECT_NEAR(answer->summary.recovered_j, fraction * answer->summary.braking_j,
                1e-9 * answer->summary.energy_j);
    last = answer->summary.energy_j, returned = answer->summary.braking_j;
  }
}

TEST(Planner, TurnInPlaceKeepsItsAngle) {
  const robot::RobotModel robot = test::amr();
  const auto left = plan(robot, made_plan({TurnInPlace{1.5}}), limited(robot));
  const auto right = plan(robot, made_plan({TurnInPlace{-1.5}}), limited(robot));
  ASSERT_TRUE(left && right);
  EXPECT_GT(left->summary.energy_j, 0);
  EXPECT_NEAR(left->summary.energy_j, right->summary.energy_j, 1e-6 * left->summary.energy_j);
  EXPECT_NEAR(left->profile.heading_rad.back(), 1.5, 1e-9);
  EXPECT_NEAR(right->profile.heading_rad.back(), -1.5, 1e-9);
  EXPECT_EQ(left->summary.distance_m, 0);
  EXPECT_LT(right->profile.yaw_rate_rad_s[right->profile.size() / 2], 0);
}

TEST(Planner, PriceOfTimeMeetsTheDeadline) {
  for (const robot::RobotModel& robot : test::all_robots()) {
    const Path path = made_plan({Straight{4}, TurnInPlace{1}, Straight{3}, Dwell{2}}, 5);
    for (double fraction : {1.0, 0.3}) {
      Problem problem = limited(robot, fraction);
      const auto relaxed = plan(robot, path, problem);
      ASSERT_TRUE(relaxed) << describe(relaxed.error());
      problem.deadline_s = 1;
      const auto tooShort = plan(robot, path, problem);
      ASSERT_FALSE(tooShort);
      EXPECT_EQ(tooShort.error().fault, Fault::infeasible);
      EXPECT_EQ(tooShort.error().field, "deadline_s");
      const std::string& told = tooShort.error().message;
      const double shortest = std::stod(told.substr(told.rfind("at least ") + 9));
      EXPECT_NEAR(relaxed->certificate.shortest_time_s, shortest, 1e-6);  // as it is rounded
      for (double share : {0.7, 0.3, 0.02}) {
        problem.deadline_s = shortest + share * (relaxed->summary.duration_s - shortest);
        const auto hurried = plan(robot, path, problem);
        ASSERT_TRUE(hurried) << describe(hurried.error());
        EXPECT_LE(hurried->summary.duration_s, *problem.deadline_s);
        EXPECT_GT(hurried->summary.duration_s, *problem.deadline_s * (1 - 2e-4));
        EXPECT_GT(hurried->summary.energy_j, relaxed->summary.energy_j);
        EXPECT_GT(hurried->certificate.time_multiplier_w, 0);
        // The same answer without the deadline, at its price of time.
        Problem priced = limited(robot, fraction);
        priced.value_of_time_w = hurried->certificate.time_multiplier_w;
        const auto same = plan(robot, path, priced);
        ASSERT_TRUE(same);
        const double price = priced.value_of_time_w;
        EXPECT_NEAR(same->summary.energy_j + price * same->summary.duration_s,
                    hurried->summary.energy_j + price * hurried->summary.duration_s,
                    1e-3 * (same->summary.energy_j + price * same->summary.duration_s));
      }
      // A deadline later than the free optimum changes nothing.
      problem.deadline_s = 2 * relaxed->summary.duration_s;
      EXPECT_NEAR(plan(robot, path, problem)->summary.energy_j, relaxed->summary.energy_j, 1e-9);
    }
  }
}

TEST(Planner, ParetoSlopeIsTheTimePrice) {
  const robot::RobotModel robot = test::amr();
  const auto planner = Planner::make(robot, 0.3);
  ASSERT_TRUE(planner);
  const auto front =
      planner->pareto(made_plan({Straight{6}, TurnInPlace{1.2}, Straight{4}}, 20), limited(robot), 12);
  ASSERT_TRUE(front) << describe(front.error());
  ASSERT_EQ(front->size(), 12u);
  for (std::size_t k = 1; k < front->size(); ++k) {
    const PlanCost &a = (*front)[k - 1], &b = (*front)[k];
    EXPECT_LT(b.duration_s, a.duration_s);
    EXPECT_GT(b.energy_j, a.energy_j - 1e-6 * a.energy_j);
    // The mean slope lies between the multipliers at both ends; solves are good to 1e-5 of the energy.
    const double slope = (b.energy_j - a.energy_j) / (a.duration_s - b.duration_s);
    const double noise = 4e-5 * a.energy_j / (a.duration_s - b.duration_s);
    EXPECT_GT(slope, a.time_multiplier_w - noise);
    EXPECT_LT(slope, b.time_multiplier_w + noise);
  }
}

// Grids grow finer while the front is drawn, which moves the shortest time that its fast end is measured
// from.
TEST(Planner, ParetoFrontsStayWithinReach) {
  for (const robot::RobotModel& robot : test::all_robots()) {
    for (const double regeneration : {1.0, 0.3, 0.0}) {
      for (const bool weak : {false, true}) {
        Problem problem = limited(robot, regeneration);
        if (weak) problem.limits.current_a *= 0.25;
        for (const auto& segments : {std::vector<Segment>{Straight{8}},
                                     std::vector<Segment>{Straight{2}, TurnInPlace{1.57}, Straight{0.3}},
                                     std::vector<Segment>{Straight{1}, Arc{0.8, 1.5}, Straight{2}}}) {
          const auto planner = Planner::make(robot, regeneration);
          ASSERT_TRUE(planner);
          const Path path = made_plan(segments);
          if (!planner->cost(path, problem)) continue;  // friction alone needs more current
          const auto front = planner->pareto(path, problem, 9);
          ASSERT_TRUE(front) << robot.robot_id << " " << regeneration << ": " << describe(front.error());
          for (std::size_t k = 1; k < front->size(); ++k) {
            EXPECT_LT((*front)[k].duration_s, (*front)[k - 1].duration_s);
            EXPECT_GT((*front)[k].energy_j, (*front)[k - 1].energy_j * (1 - 1e-5));
          }
        }
      }
    }
  }
}

// A grid for each run: a front of all of them would take gigabytes.
TEST(Planner, RefusesTooManyNodes) {
  std::vector<Segment> segments;
  for (int k = 0; k < 4000; ++k) {
    segments.emplace_back(Clothoid{0.5, 0, 0.5});
    segments.emplace_back(TurnInPlace{1});
  }
  const auto planner = Planner::make(test::amr());
  ASSERT_TRUE(planner);
  const auto front = planner->pareto(made_plan(segments), limited(test::amr()), 200);
  ASSERT_FALSE(front);
  EXPECT_EQ(front.error().fault, Fault::too_large);
  EXPECT_EQ(front.error().field, "path");
}

TEST(Planner, ReturnsSpeedForDeadline) {
  const robot::RobotModel robot = test::amr();
  const auto planner = Planner::make(robot);
  ASSERT_TRUE(planner);
  Problem problem = limited(robot);
  problem.deadline_s = 14;
  // Full acceleration a to v, braking alike: D = v T - v^2/a.
  const double a = robot.limits.acceleration_m_s2, d = 10, t = 14;
  const double exact = 0.5 * a * t - std::sqrt(0.25 * a * a * t * t - a * d);
  const auto straight = planner->needed_speed(made_plan({Straight{d}}), problem);
  ASSERT_TRUE(straight) << describe(straight.error());
  EXPECT_NEAR(*straight, exact, 2e-4 * exact);
  // At that speed limit the deadline can be met, at a little less it cannot.
  const Path path = made_plan({Straight{3}, Arc{1.5, 1.5}, TurnInPlace{1}, Straight{3}}, 30);
  problem.deadline_s = 16;
  const auto speed = planner->needed_speed(path, problem);
  ASSERT_TRUE(speed) << describe(speed.error());
  problem.limits.speed_m_s = 1.01 * *speed;
  EXPECT_TRUE(planner->plan(path, problem));
  problem.limits.speed_m_s = 0.99 * *speed;
  EXPECT_FALSE(planner->plan(path, problem));
  EXPECT_EQ(planner->needed_speed(path, problem).error().fault, Fault::infeasible);
}

TEST(Planner, NamesTheNearestFeasibleValue) {
  const robot::RobotModel robot = test::amr();
  Problem problem = limited(robot);
  problem.start_speed_m_s = 1.4;
  const auto brake = plan(robot, made_plan({Straight{0.5}}), problem);
  ASSERT_FALSE(brake);
  EXPECT_EQ(brake.error().fault, Fault::infeasible);
  EXPECT_EQ(brake.error().field, "end_speed_m_s");
  // v^2 = 1.4^2 - 2 * 0.6 * 0.5.
  EXPECT_NE(brake.error().message.find(std::to_string(std::sqrt(1.36))), std::string::npos)
      << brake.error().message;
  problem.end_speed_m_s = std::sqrt(1.36) + 0.01;
  EXPECT_TRUE(plan(robot, made_plan({Straight{0.5}}), problem));

  const auto heavy = plan(robot, made_plan({Straight{1}}, 61), limited(robot));
  ASSERT_FALSE(heavy);
  EXPECT_EQ(heavy.error().field, "payload_kg");
  EXPECT_NE(heavy.error().message.find("60.0"), std::string::npos);

  Problem weak = limited(robot);
  weak.limits.current_a = 0.5;  // friction alone needs 0.92/(0.056 * 21) = 0.782 A
  const auto stuck = plan(robot, made_plan({Straight{1}}), weak);
  ASSERT_FALSE(stuck);
  EXPECT_EQ(stuck.error().field, "limits/current_a");
  EXPECT_NE(stuck.error().message.find("0.72"), std::string::npos) << stuck.error().message;

  Problem odd = limited(robot);
  odd.start_speed_m_s = 0.1;
  EXPECT_EQ(plan(robot, made_plan({TurnInPlace{1}}), odd).error().field, "start_speed_m_s");
  odd = limited(robot);
  odd.regeneration = 1.5;
  EXPECT_EQ(plan(robot, made_plan({Straight{1}}), odd).error().field, "regeneration");
  odd = limited(robot);
  odd.limits.speed_m_s = 0;
  EXPECT_EQ(plan(robot, made_plan({Straight{1}}), odd).error().field, "limits/speed_m_s");
}

TEST(Planner, PayloadAndDwellAreCounted) {
  const robot::RobotModel robot = test::amr();
  const auto planner = Planner::make(robot);
  ASSERT_TRUE(planner);
  const Problem problem = limited(robot);
  const auto empty = planner->cost(made_plan({Straight{3}}), problem);
  const auto loaded = planner->cost(made_plan({Straight{3}}, 50), problem);
  const auto both =
      planner->plan(made_plan({Straight{3}, PayloadChange{50}, Dwell{10}, Straight{3}}), problem);
  ASSERT_TRUE(empty && loaded && both);
  EXPECT_GT(loaded->energy_j, empty->energy_j);
  EXPECT_NEAR(both->summary.energy_j, empty->energy_j + loaded->energy_j + 10 * robot.idle_power_w,
              2e-4 * both->summary.energy_j);
  EXPECT_NEAR(both->summary.duration_s, empty->duration_s + loaded->duration_s + 10, 1e-6);
  EXPECT_NEAR(both->profile.energy_j.back(), both->summary.energy_j, 1e-9 * both->summary.energy_j);
}

// Runs that are alike are planned once; each has its own pose and counts.
TEST(Planner, AlikeRunsCountEach) {
  std::vector<Segment> there;
  for (const double turn : {1.5, -1.5, -1.5, 1.5})
    there.insert(there.end(), {Straight{2}, TurnInPlace{turn}});
  there.insert(there.end(), {PayloadChange{30}, Straight{2}});
  for (const std::vector<robot::AdoptedEffect>& effects :
       {std::vector<robot::AdoptedEffect>{},
        {{"friction_asymmetry", {{"ratio", 0.5}, {"side", 1}}}},
        {{"slope", {{"angle_rad", 0.01}, {"uphill_rad", 0.3}}}}}) {
    robot::RobotModel robot = test::amr();
    robot.effects = effects;
    const Path path = *make_path(there, PathOptions{});
    const auto whole = plan(robot, path, limited(robot, 0));
    ASSERT_TRUE(whole) << describe(whole.error());
    double energy_j = 0, duration_s = 0;
    for (const auto& run : path.runs) {
      Path one;
      one.runs = {run};
      const auto part = plan(robot, one, limited(robot, 0));
      ASSERT_TRUE(part);
      energy_j += part->summary.energy_j, duration_s += part->summary.duration_s;
    }
    EXPECT_NEAR(whole->summary.energy_j, energy_j, 1e-9 * energy_j);
    EXPECT_NEAR(whole->summary.duration_s, duration_s, 1e-9 * duration_s);
    EXPECT_NEAR(whole->profile.y_m.back(), path.runs.back().knots.back().pose.y_m, 1e-9);
    Problem hurried = limited(robot, 0);
    hurried.deadline_s = 0.5 * (whole->certificate.shortest_time_s + duration_s);
    const auto soon = plan(robot, path, hurried);
    ASSERT_TRUE(soon) << describe(soon.error());
    EXPECT_LE(soon->summary.duration_s, *hurried.deadline_s);
    EXPECT_GT(soon->summary.duration_s, 0.999 * *hurried.deadline_s);
    const auto& each_s = soon->run_duration_s;
    EXPECT_EQ(each_s.size(), path.runs.size());
    EXPECT_NEAR(std::accumulate(each_s.begin(), each_s.end(), 0.0), soon->summary.duration_s, 1e-9);
  }
}

TEST(Planner, AdoptedEffectsChangeTheAnswer) {
  const Path path = made_plan({Straight{3}, TurnInPlace{1.5}, Straight{3}}, 20);
  robot::RobotModel robot = test::amr();
  const auto plain = plan(robot, path, limited(robot));
  ASSERT_TRUE(plain);
  robot.effects = {{"turning_scrub", {{"coefficient", 0.1}}}};
  const auto scrubbing = plan(robot, path, limited(robot));
  ASSERT_TRUE(scrubbing) << describe(scrubbing.error());
  EXPECT_GT(scrubbing->ledger[signals::Term::friction_scrub], 0);
  EXPECT_GT(scrubbing->summary.energy_j, plain->summary.energy_j);
  robot.effects = {{"no_regeneration", {{"fraction", 0.6}}}};
  Problem problem = limited(robot);
  problem.regeneration.reset();
  const auto burning = plan(robot, path, problem);
  problem.regeneration = 0.4;
  const auto told = plan(robot, path, problem);
  ASSERT_TRUE(burning && told);
  EXPECT_NEAR(burning->summary.energy_j, told->summary.energy_j, 1e-9 * told->summary.energy_j);
}

TEST(Planner, LinearLoadsKeepClosedForm) {
  robot::RobotModel robot = test::amr();
  robot.effects = {{"load_rolling_resistance", {{"coefficient", 0.02}}}};
  Problem problem = limited(robot);
  const auto closed = plan(robot, made_plan({Straight{10}}, 40), problem);
  ASSERT_TRUE(closed) << describe(closed.error());
  EXPECT_EQ(closed->certificate.method, Method::closed_form);
  EXPECT_GT(closed->ledger[signals::Term::friction_rolling], 0);
  problem.regeneration = 1 - 1e-9;
  const auto numeric = plan(robot, made_plan({Straight{10}}, 40), problem);
  ASSERT_TRUE(numeric);
  EXPECT_EQ(numeric->certificate.method, Method::quadrature);
  EXPECT_NEAR(closed->summary.energy_j, numeric->summary.energy_j, 3e-4 * numeric->summary.energy_j);
}

// Rows are kinematically exact: constant acceleration between them covers their distance.
TEST(Planner, ProfileRowsIntegrate) {
  const robot::RobotModel robot = test::nomad();
  const auto answer = plan(robot, made_plan({Straight{2}, Arc{1, 1.2}, Straight{2}}), limited(robot, 0.3));
  ASSERT_TRUE(answer) << describe(answer.error());
  const Profile& p = answer->profile;
  double distance = 0;
  for (std::size_t k = 1; k < p.size(); ++k) {
    const double dt = p.time_s[k] - p.time_s[k - 1];
    distance += 0.5 * dt * (p.speed_m_s[k] + p.speed_m_s[k - 1]);
    EXPECT_NEAR(p.distance_m[k], distance, 1e-9);
    EXPECT_NEAR(p.speed_m_s[k], p.speed_m_s[k - 1] + dt * p.acceleration_m_s2[k - 1], 1e-9);
  }
  EXPECT_NEAR(distance, 5.2, 1e-9);
}

TEST(Planner, StopsAtTheBrakingDistance) {
  const robot::RobotModel robot = test::amr();
  const double v = 1.4, least = v * v / (2 * robot.limits.acceleration_m_s2);
  Problem problem = limited(robot);
  problem.start_speed_m_s = v;
  const double energy = plan(robot, made_plan({Straight{1.01 * least}}), problem)->summary.energy_j;
  for (const double more : {0.0, 1e-12, 1e-10, 1e-8, 1e-6, 1e-4, 3e-4, 1e-3}) {
    const auto answer = plan(robot, made_plan({Straight{least * (1 + more)}}), problem);
    ASSERT_TRUE(answer) << more << ": " << describe(answer.error());
    EXPECT_NEAR(answer->summary.duration_s, v / robot.limits.acceleration_m_s2, 2e-3);
    EXPECT_NEAR(answer->summary.energy_j, energy, 0.05 * energy);
  }
  EXPECT_EQ(plan(robot, made_plan({Straight{least * (1 - 1e-6)}}), problem).error().field, "end_speed_m_s");
}

TEST(Planner, FreeTimeNeedsADeadline) {
  robot::RobotModel robot = test::amr();
  robot.idle_power_w = 0;
  robot.motor.viscous_friction_nm_s_rad = 0;
  robot.motor.friction_torque_nm = {0, 0};
  for (const double regeneration : {1.0, 0.0}) {
    Problem problem = limited(robot, regeneration);
    const auto endless = plan(robot, made_plan({Straight{5}}), problem);
    ASSERT_FALSE(endless);
    EXPECT_EQ(endless.error().fault, Fault::infeasible);
    EXPECT_EQ(endless.error().field, "value_of_time_w");
    problem.deadline_s = 30;
    const auto answer = plan(robot, made_plan({Straight{5}}), problem);
    ASSERT_TRUE(answer) << describe(answer.error());
    EXPECT_LE(answer->summary.duration_s, 30);
    EXPECT_GT(answer->summary.duration_s, 29.99);
  }
}

// As slow as a gear ratio of 2000 makes a robot: its motors' voltage is all that friction and speed leave.
TEST(Planner, AnswersOrRejectsAnyGear) {
  for (robot::RobotModel robot : test::all_robots()) {
    for (const double gear : {0.05, 0.3, 3.0, 200.0, 2000.0}) {
      robot.motor.gear_ratio = gear;
      for (const double regeneration : {1.0, 0.0}) {
        for (const auto& segments :
             {std::vector<Segment>{Straight{10}}, {TurnInPlace{1}}, {Arc{2, 1}, Straight{1}}}) {
          const auto answer = plan(robot, made_plan(segments), limited(robot, regeneration));
          if (!answer) {
            EXPECT_EQ(answer.error().fault, Fault::infeasible) << gear << describe(answer.error());
          }
        }
      }
    }
  }
}

TEST(Planner, CurrentAboveFrictionIsEnough) {
  for (const robot::RobotModel& robot : test::all_robots()) {
    const auto& m = robot.motor;
    const double friction =
        std::max(m.friction_torque_nm[0], m.friction_torque_nm[1]) / (m.torque_constant_nm_a * m.gear_ratio);
    if (friction == 0) continue;
    for (const double above : {1.001, 1.01, 1.05, 1.1}) {
      Problem problem = limited(robot);
      problem.limits.current_a = above * friction;
      for (const auto& segments :
           {std::vector<Segment>{Straight{5}}, {TurnInPlace{1}}, {Clothoid{5, 0, 0.2}}}) {
        if (segments[0].index() == 6 && above < 1.05) continue;  // the outer wheel has more load
        const auto answer = plan(robot, made_plan(segments), problem);
        ASSERT_TRUE(answer) << robot.robot_id << " " << above << ": " << describe(answer.error());
      }
    }
  }
}

// The distance of a robot that plays the rows, with its speed linear in time between them.
TEST(Planner, RowsThatArePlayedArrive) {
  for (const robot::RobotModel& robot : test::all_robots()) {
    for (const double idle_w : {1e-3, robot.idle_power_w}) {
      robot::RobotModel slow = robot;
      slow.idle_power_w = idle_w;
      for (const double regeneration : {1.0, 0.0}) {
        for (const double length : {0.5, 5.0, 40.0}) {
          const auto answer = plan(slow, made_plan({Straight{length}}), limited(slow, regeneration));
          ASSERT_TRUE(answer) << describe(answer.error());
          const Profile& p = answer->profile;
          double played = 0;
          for (std::size_t k = 1; k < p.size(); ++k)
            played += 0.5 * (p.speed_m_s[k] + p.speed_m_s[k - 1]) * (p.time_s[k] - p.time_s[k - 1]);
          EXPECT_NEAR(played, length, 1e-4 * length)
              << robot.robot_id << " " << idle_w << " " << regeneration;
        }
      }
    }
  }
}

TEST(Planner, StopsOnRequest) {
  const robot::RobotModel robot = test::amr();
  const auto planner = Planner::make(robot, 0.3);
  ASSERT_TRUE(planner);
  std::stop_source source;
  source.request_stop();
  const Path path = made_plan({Straight{3}, Arc{1, 1}, Straight{2}, TurnInPlace{1}, Straight{4}});
  const Problem problem = limited(robot, 0.3);
  EXPECT_EQ(planner->plan(path, problem, source.get_token()).error().fault, Fault::stopped);
  EXPECT_EQ(planner->cost(path, problem, source.get_token()).error().fault, Fault::stopped);
  EXPECT_EQ(planner->pareto(path, problem, 50, source.get_token()).error().fault, Fault::stopped);
  EXPECT_EQ(CostTable::make(robot, {}, source.get_token()).error().fault, Fault::stopped);
}

// Energy and time of constant acceleration up to `peak`, and of constant braking.
double ramps_cost_j(const dynamics::DriveModel& model, double length, double peak, double up, double down,
                    double price_w) {
  const double cruise_s = (length - 0.5 * peak * peak * (1 / up + 1 / down)) / peak;
  if (cruise_s < 0) return 1e300;
  const auto phase_j = [&](double from, double acceleration, double seconds) {
    constexpr int steps = 300;
    double sum = 0;
    for (int k = 0; k < steps; ++k) {
      dynamics::Instant at;
      at.wheel_speed_rad_s =
          dynamics::wheels_of_body(model.parameters(), from + acceleration * seconds * (k + 0.5) / steps, 0);
      at.wheel_acceleration_rad_s2 = dynamics::wheels_of_body(model.parameters(), acceleration, 0);
      sum += (model.flow(at).battery_power_w + price_w) * seconds / steps;
    }
    return sum;
  };
  return phase_j(0, up, peak / up) + phase_j(peak, 0, cruise_s) + phase_j(peak, -down, peak / down);
}

// A motor that brakes a heavy robot to a stand takes power again at the end, within one row.
TEST(Planner, EnergyIsThatOfItsRows) {
  const robot::RobotModel robot = test::all_robots()[3];
  const auto planner = Planner::make(robot, 0.0);
  const dynamics::DriveModel& model = planner->loads().model();
  for (const double length : {2.0, 4.0}) {
    for (const double start_speed : {0.0, 1.32}) {
      Problem problem = limited(robot);
      problem.start_speed_m_s = start_speed;
      const auto plan = planner->plan(made_plan({Straight{length}}, robot.limits.payload_kg), problem);
      ASSERT_TRUE(plan);
      const Profile& rows = plan->profile;
      double energy_j = 0;
      for (std::size_t k = 0; k + 1 < rows.size(); ++k) {
        constexpr int parts = 200;
        const double span_s = rows.time_s[k + 1] - rows.time_s[k],
                     acceleration = (rows.speed_m_s[k + 1] - rows.speed_m_s[k]) / span_s;
        dynamics::Instant at;
        at.payload_kg = robot.limits.payload_kg;
        at.wheel_acceleration_rad_s2 = dynamics::wheels_of_body(model.parameters(), acceleration, 0);
        for (int part = 0; part < parts; ++part) {
          const double speed = rows.speed_m_s[k] + acceleration * span_s * (part + 0.5) / parts;
          at.wheel_speed_rad_s = dynamics::wheels_of_body(model.parameters(), speed, 0);
          energy_j += model.flow(at).battery_power_w * span_s / parts;
        }
      }
      EXPECT_NEAR(plan->summary.energy_j, energy_j, 5e-5 * energy_j) << length << " m from " << start_speed;
      // The solver's own energy is the same.
      EXPECT_NEAR(planner->cost(made_plan({Straight{length}}, robot.limits.payload_kg), problem)->energy_j,
                  energy_j, 1e-4 * energy_j);
    }
  }
}

// Where what braking returns is lost and the driver takes its share of it.
TEST(Planner, BrakesWhereBrakingCosts) {
  robot::RobotModel robot = test::amr();
  robot.effects.push_back({"driver_loss", {{"fraction", 0.08}}});
  const auto planner = Planner::make(robot, 0.0);
  ASSERT_TRUE(planner);
  for (const double length : {0.5, 2.0}) {
    for (const double price_w : {0.0, 30.0, 1000.0}) {
      Problem problem = limited(robot);
      problem.value_of_time_w = price_w;
      const auto plan = planner->plan(made_plan({Straight{length}}), problem);
      ASSERT_TRUE(plan);
      const double most = problem.limits.acceleration_m_s2;
      double best_j = 1e300;
      for (double peak = 0.05; peak < problem.limits.speed_m_s; peak *= 1.03)
        for (double up = most; up > 0.2 * most; up *= 0.85)
          for (double down = most; down > 0.2 * most; down *= 0.85)
            best_j =
                std::min(best_j, ramps_cost_j(planner->loads().model(), length, peak, up, down, price_w));
      EXPECT_LT(plan->summary.energy_j + price_w * plan->summary.duration_s, best_j * (1 + 1e-4))
          << length << " m at " << price_w << " W";
    }
  }
}

TEST(Planner, RowsMayBeLeftOutAndAreBounded) {
  const robot::RobotModel robot = test::amr();
  Polyline line;
  for (int k = 1; k <= 9000; ++k) line.points.push_back({0.5 * k, k % 2 ? 0.3 : 0.0});
  const Path path = made_plan({line});
  Problem problem = limited(robot);
  const auto refused = plan(robot, path, problem);
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().fault, Fault::too_large);
  EXPECT_EQ(refused.error().field, "columns");
  problem.rows = false;
  const auto answer = plan(robot, path, problem);
  ASSERT_TRUE(answer) << describe(answer.error());
  EXPECT_EQ(answer->profile.size(), 0u);
  EXPECT_NEAR(answer->ledger.total(), answer->summary.energy_j, 1e-9 * answer->summary.energy_j);
}

}  // namespace
}  // namespace joulecast::planning

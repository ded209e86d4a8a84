#include "forecast/robot_forecast.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <span>

#include "client/virtual_robot/rng.h"
#include "robots.h"

namespace joulecast::forecast {
namespace {

using virtual_robot::Rng;

// Missions made of the model's own costs, off by factors that the test sets.
class MadeMissions {
 public:
  explicit MadeMissions(std::uint64_t seed)
      : robot(shipped("amr")), drive(*dynamics::drive_model(robot)), pricer_(robot, drive), rng_(seed) {}

  PastMission next(double factor, double common, double scatter) {
    PastMission mission{start_ += 1'000'000'000, {}};
    const double level = factor * (1 + common * rng_.normal());
    for (int k = 0; k < 10; ++k) {
      Pace pace = default_pace(robot);
      const PlannedLeg planned[] = {{Motion::turn, rng_.uniform(0.5, 3), 0, 0, 0},
                                    {Motion::stand, 0, 0, 0, rng_.uniform(1, 4)},
                                    {Motion::drive, rng_.uniform(2, 9), 0, 0, 0}};
      for (const PlannedLeg& p : planned) {
        const LegCost cost = pricer_.paced(p, pace);
        const double expected = cost.standing_j + cost.motor_j;
        mission.legs.push_back({p.motion, cost.duration_s, p.way,
                                p.motion == Motion::turn ? pace.yaw_rate_rad_s : pace.speed_m_s, 0, 0,
                                expected * level * (1 + scatter * rng_.normal())});
        if (p.motion != Motion::stand && p.way < 2 * pace.speed_m_s) mission.legs.pop_back();
      }
    }
    return mission;
  }

  robot::RobotModel robot;
  dynamics::DriveModel drive;

 private:
  LegPricer pricer_;
  Rng rng_;
  std::int64_t start_ = 1'700'000'000'000'000;
};

PlanSum plan_of(const Forecaster& f, const MadeMissions& made) {
  const LegPricer pricer(made.robot, made.drive);
  PlanSum sum;
  for (int k = 0; k < 20; ++k)
    f.extend(sum, {Motion::drive, 0, 6,
                   pricer.paced(PlannedLeg{Motion::drive, 6, 0, 0, 0}, default_pace(made.robot))});
  return sum;
}

TEST(RobotForecast, StartsAsTheModel) {
  MadeMissions made(1);
  const RobotForecast forecast(made.robot, made.drive);
  const auto f = forecast.forecaster();
  const PlanSum sum = plan_of(*f, made);
  double model = 0;
  for (std::size_t k = 0; k < 3; ++k) model += sum.features[0][k];
  const Prediction p = f->energy(sum);
  EXPECT_NEAR(p.legs, model, 1e-9 * model);
  EXPECT_GT(p.spread, 0.08);
  EXPECT_LT(p.spread, 0.2);
  EXPECT_EQ(f->missions, 0);
}

TEST(RobotForecast, LearnsAHigherConsumption) {
  MadeMissions made(2);
  RobotForecast forecast(made.robot, made.drive);
  const double before = forecast.forecaster()->energy(plan_of(*forecast.forecaster(), made)).legs;
  for (int k = 0; k < 20; ++k) forecast.learn(made.next(1.3, 0.02, 0.05));
  const auto f = forecast.forecaster();
  const Prediction p = f->energy(plan_of(*f, made));
  // Twenty missions of 2 % determine the level to 0.5 %; four of those.
  EXPECT_NEAR(p.legs / before, 1.3, 1.3 * 4 * 0.02 / std::sqrt(20.0) + 0.01);
  EXPECT_LT(p.spread, 0.05);
  EXPECT_EQ(f->missions, 20);
}

// The scores of the first missions, forecast from a model with an error of 40 %, lie to one side; those of a
// learned robot do not, since each mission is scored by the others.
TEST(RobotForecast, ScoresAreUnbiased) {
  constexpr int robots = 8;
  double lean = 0;
  for (int k = 0; k < robots; ++k) {
    MadeMissions made(100 + static_cast<std::uint64_t>(k));
    RobotForecast forecast(made.robot, made.drive);
    for (int mission = 0; mission < 20; ++mission) forecast.learn(made.next(1.4, 0.02, 0.05));
    const auto f = forecast.forecaster();
    lean += f->track(Subject::stated_energy).scores.quantile(0.5) / robots;
    EXPECT_EQ(forecast.findings()[0].scores.size(), 20u);
  }
  EXPECT_LT(std::fabs(lean), 0.25);
}

// The only score of a robot with one mission is that of the model itself, whose error the mission has
// removed: however far off the model was, it does not widen what is forecast afterwards.
TEST(RobotForecast, FirstScoreDoesNotWidenIntervals) {
  for (const double factor : {0.6, 0.8, 1.0, 1.3, 1.6}) {
    MadeMissions made(7);
    RobotForecast forecast(made.robot, made.drive);
    forecast.learn(made.next(factor, 0.02, 0.05));
    const ScoreDistribution& scores = forecast.forecaster()->track(Subject::stated_energy).scores;
    EXPECT_NEAR(scores.deviation(), ScoreDistribution().deviation(), 0.1) << factor;
  }
}

TEST(RobotForecast, SetsMissionsBeforeChangeAside) {
  MadeMissions made(3);
  RobotForecast forecast(made.robot, made.drive);
  for (int k = 0; k < 30; ++k) forecast.learn(made.next(1.0, 0.02, 0.05));
  drift::Mark change;
  for (int k = 0; k < 6; ++k) {
    PastMission mission = made.next(1.15, 0.02, 0.05);
    if (k == 0) change.utime_us = mission.start_utime_us;
    forecast.learn(std::move(mission));
  }
  const auto level = [&] {
    const auto f = forecast.forecaster();
    const PlanSum sum = plan_of(*f, made);
    double model = 0;
    for (std::size_t k = 0; k < 3; ++k) model += sum.features[0][k];
    return f->energy(sum).legs / model;
  };
  EXPECT_LT(level(), 1.07);
  forecast.set_change(change);
  EXPECT_EQ(forecast.forecaster()->change->utime_us, change.utime_us);
  // Missions before the change keep a twentieth of their weight: 1.5 missions against six.
  EXPECT_NEAR(level(), 1.15, 0.15 * 0.2 + 4 * 0.02 / std::sqrt(6.0));
  const double learned_again = level();
  forecast.set_change(change);
  EXPECT_EQ(level(), learned_again);
}

TEST(RobotForecast, SiblingsHelpNewRobots) {
  MadeMissions made(4);
  std::array<std::vector<OwnFinding>, subject_count> found;
  for (int r = 0; r < 3; ++r) {
    RobotForecast forecast(made.robot, made.drive);
    for (int k = 0; k < 20; ++k) forecast.learn(made.next(1.25, 0.02, 0.05));
    const auto own = forecast.findings();
    for (std::size_t d = 0; d < subject_count; ++d) found[d].push_back(own[d]);
  }
  RobotForecast newcomer(made.robot, made.drive);
  const double alone = newcomer.forecaster()->energy(plan_of(*newcomer.forecaster(), made)).legs;
  std::array<Siblings, subject_count> siblings;
  for (std::size_t d = 0; d < subject_count; ++d) {
    std::vector<const OwnFinding*> others;
    for (const OwnFinding& f : found[d]) others.push_back(&f);
    siblings[d] = pool(static_cast<Subject>(d), others);
  }
  newcomer.set_siblings(std::move(siblings));
  const auto f = newcomer.forecaster();
  const Prediction p = f->energy(plan_of(*f, made));
  EXPECT_EQ(f->siblings, 3);
  EXPECT_NEAR(p.legs / alone, 1.25, 0.05);
}

TEST(RobotForecast, RelearnsForNewModels) {
  MadeMissions made(5);
  RobotForecast forecast(made.robot, made.drive);
  for (int k = 0; k < 15; ++k) forecast.learn(made.next(1.2, 0.01, 0.03));
  const auto before = forecast.forecaster();
  // The new version contains the load that made the difference.
  robot::RobotModel better = made.robot;
  better.idle_power_w *= 1.2;
  for (double& t : better.motor.friction_torque_nm) t *= 1.2;
  better.motor.viscous_friction_nm_s_rad *= 1.2;
  forecast.set_model(better, *dynamics::drive_model(better));
  const auto after = forecast.forecaster();
  EXPECT_EQ(after->missions, before->missions);
  EXPECT_NEAR(after->tracks[0].correction.mean[0], 1, 0.03);
  EXPECT_NEAR(before->tracks[0].correction.mean[0], 1.2, 0.03);
}

TEST(RobotForecast, IgnoresUnmeasuredMissions) {
  MadeMissions made(6);
  RobotForecast forecast(made.robot, made.drive);
  PastMission mission = made.next(1, 0, 0);
  for (Leg& leg : mission.legs) leg.battery_j = std::nan("");
  forecast.learn(mission);
  EXPECT_EQ(forecast.forecaster()->missions, 0);
}

constexpr int stated_count = 10;

PricedLeg stated_drive(const MadeMissions& made, double payload_kg, Driving driving) {
  const LegPricer pricer(made.robot, made.drive);
  return {Motion::drive, payload_kg, 6,
          pricer.paced(PlannedLeg{Motion::drive, 6, 0, payload_kg, 0}, default_pace(made.robot)), driving};
}

PlanSum stated_drives(const Forecaster& f, const MadeMissions& made, double payload_kg, Driving driving) {
  PlanSum sum;
  f.extend(sum, stated_drive(made, payload_kg, driving), stated_count);
  return sum;
}

// Commands plan a fiftieth less time than the legs take; without commands the robot may do either.
TEST(RobotForecast, LearnsHowPlansAreFollowed) {
  for (const bool commanded : {true, false}) {
    MadeMissions made(7);
    Rng rng(8);
    RobotForecast forecast(made.robot, made.drive);
    for (int k = 0; k < 20; ++k) {
      PastMission mission = made.next(1, 0.01, 0.02);
      for (Leg& leg : mission.legs) {
        if (!commanded || leg.motion == Motion::stand) continue;
        leg.planned_way = leg.way;
        leg.planned_speed = leg.speed;
        leg.planned_s = leg.duration_s / (1.02 + 0.01 * rng.normal());
      }
      forecast.learn(std::move(mission));
    }
    const auto f = forecast.forecaster();
    const Prediction p = f->duration(stated_drives(*f, made, 0, Driving::stated));
    const double planned_s = stated_count * stated_drive(made, 0, Driving::stated).cost.duration_s;
    EXPECT_NEAR(p.quantile(0.5) / planned_s, commanded ? 1.02 : 1, 0.004);
    const double width = (p.quantile(0.95) - p.quantile(0.05)) / planned_s;
    if (commanded)
      EXPECT_LT(width, 0.05);
    else
      EXPECT_GT(width, 0.05);
  }
}

// The legs' ramps vary by 30 %: where a plan leaves them open, the interval contains that.
TEST(RobotForecast, UnstatedRampsWidenIntervals) {
  MadeMissions made(9);
  Rng rng(10);
  const LegPricer pricer(made.robot, made.drive);
  RobotForecast forecast(made.robot, made.drive);
  for (int k = 0; k < 25; ++k) {
    PastMission mission{1 + k, {}};
    for (int leg = 0; leg < 10; ++leg) {
      const Pace pace = default_pace(made.robot);
      const Cruise cruise{pace.speed_m_s, pace.acceleration_m_s2 * rng.uniform(0.4, 1.4)};
      const LegCost cost = pricer.paced(PlannedLeg{Motion::drive, 6, 0, 0, 0}, cruise);
      mission.legs.push_back({Motion::drive, cost.duration_s, 6, pace.speed_m_s, 0, 0,
                              (cost.standing_j + cost.motor_j) * (1 + 0.005 * rng.normal())});
    }
    forecast.learn(std::move(mission));
  }
  const auto f = forecast.forecaster();
  const auto width = [&](Driving driving) {
    const Prediction p = f->duration(stated_drives(*f, made, 0, driving));
    return (p.quantile(0.95) - p.quantile(0.05)) / p.quantile(0.5);
  };
  // Of ten legs' durations, drawn apart from the product.
  std::vector<double> durations;
  for (int k = 0; k < 4000; ++k) {
    double sum_s = 0;
    for (int leg = 0; leg < 10; ++leg) {
      const Pace pace = default_pace(made.robot);
      sum_s += 6 / pace.speed_m_s + pace.speed_m_s / (pace.acceleration_m_s2 * rng.uniform(0.4, 1.4));
    }
    durations.push_back(sum_s);
  }
  std::ranges::sort(durations);
  const double drawn = (durations[3800] - durations[200]) / durations[2000];
  EXPECT_GT(width(Driving::paced), 0.8 * drawn);
  EXPECT_LT(width(Driving::paced), 2.5 * drawn);
}

TEST(RobotForecast, FirstPayloadsWidenIntervals) {
  MadeMissions made(11);
  RobotForecast forecast(made.robot, made.drive);
  for (int k = 0; k < 25; ++k) forecast.learn(made.next(1, 0.005, 0.01));
  const auto f = forecast.forecaster();
  const auto width = [&](double payload_kg) {
    const Prediction p = f->energy(stated_drives(*f, made, payload_kg, Driving::stated));
    return (p.quantile(0.95) - p.quantile(0.05)) / p.quantile(0.5);
  };
  const double full_kg = made.robot.limits.payload_kg;
  EXPECT_LT(width(0), 0.05);
  EXPECT_GT(width(full_kg), 3 * width(0));
  EXPECT_GT(width(full_kg), 1.5 * width(0.3 * full_kg));
}

// Each mission has one payload; a full one makes drives and turns a third dearer than by the model.
TEST(RobotForecast, PayloadsMakeTurnsDearer) {
  MadeMissions made(12);
  Rng rng(13);
  const LegPricer pricer(made.robot, made.drive);
  const Pace pace = default_pace(made.robot);
  const double full_kg = made.robot.limits.payload_kg;
  const auto leg_of = [&](Motion motion, double way, double payload_kg) {
    const LegCost cost = pricer.paced(PlannedLeg{motion, way, 0, payload_kg, 0}, pace);
    return Leg{motion,
               cost.duration_s,
               way,
               motion == Motion::turn ? pace.yaw_rate_rad_s : pace.speed_m_s,
               0,
               payload_kg,
               cost.standing_j + (1 + payload_kg / full_kg / 3) * cost.motor_j};
  };
  RobotForecast forecast(made.robot, made.drive);
  for (int k = 0; k < 20; ++k) {
    const double payload_kg = k % 2 == 0 ? 0 : rng.uniform(0.2, 1) * full_kg;
    PastMission mission{1 + k, {}};
    for (int leg = 0; leg < 8; ++leg) {
      mission.legs.push_back(leg_of(Motion::turn, rng.uniform(2, 3), payload_kg));
      mission.legs.push_back(leg_of(Motion::drive, rng.uniform(4, 9), payload_kg));
      for (Leg& last : std::span(mission.legs).last(2)) last.battery_j *= 1 + 0.01 * rng.normal();
    }
    forecast.learn(std::move(mission));
  }
  const auto f = forecast.forecaster();
  PlanSum sum;
  double truth_j = 0;
  for (int k = 0; k < 10; ++k) {
    f->extend(sum,
              {Motion::turn, full_kg, 0, pricer.paced(PlannedLeg{Motion::turn, 2.5, 0, full_kg, 0}, pace)});
    truth_j += leg_of(Motion::turn, 2.5, full_kg).battery_j;
  }
  EXPECT_NEAR(f->energy(sum).quantile(0.5), truth_j, 0.02 * truth_j);
}

// Downhill, whole missions recover more energy than they spend.
TEST(RobotForecast, LearnsFromRecoveredEnergy) {
  MadeMissions made(14);
  RobotForecast forecast(made.robot, made.drive);
  for (int k = 0; k < 12; ++k) forecast.learn(made.next(-0.5, 0.02, 0.05));
  const auto f = forecast.forecaster();
  const Prediction p = f->energy(plan_of(*f, made));
  EXPECT_TRUE(std::isfinite(p.quantile(0.05)));
  EXPECT_TRUE(std::isfinite(p.quantile(0.95)));
}

// Motions end 0.4 s after their commands, in the time of halts of 1 s: the time and energy of plans with such
// halts, which commands state, are those of the missions.
TEST(RobotForecast, HaltsContainLateStops) {
  MadeMissions made(15);
  Rng rng(16);
  const LegPricer pricer(made.robot, made.drive);
  const Pace pace = default_pace(made.robot);
  const double halt_s = 1, late_s = 0.4, still_w = pricer.standing_w();
  RobotForecast forecast(made.robot, made.drive);
  for (int k = 0; k < 20; ++k) {
    PastMission mission{1 + k, {}};
    for (int j = 0; j < 16; ++j) {
      const double way = rng.uniform(4, 9);
      const LegCost cost = pricer.paced(PlannedLeg{Motion::drive, way, 0, 0, 0}, pace);
      const bool halts = rng.chance(0.5);
      const double longer_s = halts ? late_s : 0;
      mission.legs.push_back({Motion::drive, cost.duration_s + longer_s, way, pace.speed_m_s, 0, 0,
                              cost.standing_j + cost.motor_j + still_w * longer_s, way, pace.speed_m_s,
                              cost.duration_s});
      if (halts)
        mission.legs.push_back({Motion::stand, halt_s - late_s, 0, 0, 0, 0, still_w * (halt_s - late_s)});
    }
    forecast.learn(std::move(mission));
  }
  const auto f = forecast.forecaster();
  PlanSum sum;
  double truth_s = 0, truth_j = 0;
  for (int k = 0; k < 10; ++k) {
    for (const PlannedLeg& leg :
         {PlannedLeg{Motion::drive, 5, 0, 0, 0}, PlannedLeg{Motion::stand, 0, 0, 0, 1}}) {
      const LegCost cost = pricer.paced(leg, pace);
      f->extend(sum, {leg.motion, 0, leg.way, cost});
      truth_s += cost.duration_s, truth_j += cost.standing_j + cost.motor_j;
    }
  }
  EXPECT_NEAR(f->duration(sum).quantile(0.5) / truth_s, 1, 0.003);
  EXPECT_NEAR(f->energy(sum).quantile(0.5) / truth_j, 1, 0.003);
}

// Turns take four times the model's energy: one mission of a loaded robot shows its like.
TEST(RobotForecast, FirstMissionIsFittedThroughout) {
  MadeMissions made(19);
  Rng rng(20);
  const LegPricer pricer(made.robot, made.drive);
  const Pace pace = default_pace(made.robot);
  const double payload_kg = made.robot.limits.payload_kg;
  RobotForecast forecast(made.robot, made.drive);
  PastMission mission{1, {}};
  std::vector<PricedLeg> plan;
  double measured_j = 0;
  for (int k = 0; k < 10; ++k) {
    const Motion motion = k % 2 == 0 ? Motion::turn : Motion::drive;
    const double way = rng.uniform(3, 8);
    const LegCost cost = pricer.paced(PlannedLeg{motion, way, 0, payload_kg, 0}, pace);
    mission.legs.push_back({motion, cost.duration_s, way,
                            motion == Motion::turn ? pace.yaw_rate_rad_s : pace.speed_m_s, 0, payload_kg,
                            cost.standing_j + (motion == Motion::turn ? 4 : 1.6) * cost.motor_j});
    measured_j += mission.legs.back().battery_j;
    plan.push_back({motion, payload_kg, 0, cost});
  }
  forecast.learn(std::move(mission));
  const auto f = forecast.forecaster();
  PlanSum sum;
  for (const PricedLeg& leg : plan) f->extend(sum, leg);
  EXPECT_NEAR(f->energy(sum).quantile(0.5) / measured_j, 1, 0.004);
}

// A robot that has followed one plan exactly takes as long for another, with any payload.
TEST(RobotForecast, FirstPlansLastAsStated) {
  MadeMissions made(14);
  RobotForecast forecast(made.robot, made.drive);
  PastMission mission = made.next(1, 0.01, 0.02);
  for (Leg& leg : mission.legs) {
    if (leg.motion == Motion::stand) continue;
    leg.planned_way = leg.way;
    leg.planned_speed = leg.speed;
    leg.planned_s = leg.duration_s;
  }
  forecast.learn(std::move(mission));
  const auto f = forecast.forecaster();
  const double payload_kg = made.robot.limits.payload_kg;
  const Prediction p = f->duration(stated_drives(*f, made, payload_kg, Driving::stated));
  const double planned_s = stated_count * stated_drive(made, payload_kg, Driving::stated).cost.duration_s;
  EXPECT_NEAR(p.quantile(0.5) / planned_s, 1, 0.01);
  EXPECT_LT((p.quantile(0.95) - p.quantile(0.05)) / planned_s, 0.2);
}

// Turns take three times the model's energy, drives one and a half times, and either 0.4 more with the full
// payload: learned of empty and of half loaded robots.
TEST(RobotForecast, PayloadsMultiplyCorrectedMotion) {
  MadeMissions made(17);
  Rng rng(18);
  const LegPricer pricer(made.robot, made.drive);
  const Pace pace = default_pace(made.robot);
  const auto leg_of = [&](Motion motion, double loaded, double way) {
    return PlannedLeg{motion, way, 0, loaded * made.robot.limits.payload_kg, 0};
  };
  const auto truth_of = [](Motion motion, double loaded, const LegCost& cost) {
    return cost.standing_j + (motion == Motion::turn ? 3 : 1.5) * (1 + 0.4 * loaded) * cost.motor_j;
  };
  RobotForecast forecast(made.robot, made.drive);
  for (int k = 0; k < 30; ++k) {
    PastMission mission{1 + k, {}};
    const double loaded = k % 2 == 0 ? 0 : 0.5;
    for (int j = 0; j < 12; ++j) {
      const Motion motion = j % 2 == 0 ? Motion::turn : Motion::drive;
      const PlannedLeg leg = leg_of(motion, loaded, rng.uniform(3, 8));
      const LegCost cost = pricer.paced(leg, pace);
      mission.legs.push_back({motion, cost.duration_s, leg.way,
                              motion == Motion::turn ? pace.yaw_rate_rad_s : pace.speed_m_s, 0,
                              leg.payload_kg, truth_of(motion, loaded, cost) * (1 + 0.02 * rng.normal())});
    }
    forecast.learn(std::move(mission));
  }
  const auto f = forecast.forecaster();
  for (const Motion motion : {Motion::turn, Motion::drive}) {
    const PlannedLeg leg = leg_of(motion, 1, 6);
    const LegCost cost = pricer.paced(leg, pace);
    PlanSum sum;
    f->extend(sum, {motion, leg.payload_kg, 0, cost});
    EXPECT_NEAR(f->energy(sum).quantile(0.5) / truth_of(motion, 1, cost), 1, 0.03);
  }
}

}  // namespace
}  // namespace joulecast::forecast

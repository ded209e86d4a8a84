#include "foreign_missions.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <string>

#include "forecast/leg.h"
#include "robot/robot_file.h"
#include "tests/study/trial/foreign/foreign_case.h"
#include "tests/study/trial/foreign/foreign_plant.h"

namespace joulecast::forecast {
namespace {

namespace foreign = trial::foreign;
using virtual_robot::Rng;

constexpr double sample_period_s = 0.05;

// How a robot is driven, in shares of its limits, and how it departs from its plans.
struct Style {
  double cruise = 0, ramp = 0, halts = 0, halt_s = 0;
  double short_m = 0, cruise_ratio = 1, ramp_ratio = 1;
};

Style style_of_kind(Rng& rng, bool exact) {
  Style s{rng.uniform(0.45, 0.8), rng.uniform(0.45, 0.75), rng.uniform(0, 0.4), rng.uniform(1, 4)};
  if (!exact) {
    s.short_m = rng.uniform(0.002, 0.01);
    s.cruise_ratio = rng.uniform(0.9, 1);
    s.ramp_ratio = rng.uniform(0.7, 1.1);
  }
  return s;
}

Style alike(Style s, Rng& rng) {
  for (double* share : {&s.cruise, &s.ramp, &s.halts, &s.halt_s, &s.short_m})
    *share *= std::max(0.3, 1 + 0.08 * rng.normal());
  return s;
}

foreign::ForeignRobot alike(foreign::ForeignRobot r, Rng& rng) {
  for (double* value : {&r.friction_nm[0], &r.friction_nm[1], &r.viscous_nm_s_rad, &r.resistance_ohm})
    *value *= 1 + 0.03 * rng.normal();
  r.idle_w *= 1 + 0.02 * rng.normal();
  return r;
}

struct Trip {
  foreign::Drive drive;
  std::vector<StatedLeg> plan;
  std::vector<std::array<double, 2>> commands;  // of the plan at each controller period
};

void stand(Trip& trip, double duration_s) {
  const auto periods = static_cast<std::size_t>(std::lround(duration_s / foreign::controller_period_s));
  trip.drive.wheel_rad_s.insert(trip.drive.wheel_rad_s.end(), periods, {0, 0});
  trip.commands.insert(trip.commands.end(), periods, {0, 0});
  StatedLeg halt;
  halt.leg.payload_kg = trip.drive.payload_kg;
  halt.leg.duration_s = foreign::controller_period_s * static_cast<double>(periods);
  trip.plan.push_back(halt);
}

// Speed of a trapezoid from rest to rest.
double speed_at(double way, Cruise cruise, double time_s) {
  cruise.speed = std::min(cruise.speed, std::sqrt(way * cruise.acceleration));
  const double duration_s = way / cruise.speed + cruise.speed / cruise.acceleration;
  return std::max(0.0, std::min({cruise.speed, cruise.acceleration * time_s,
                                 cruise.acceleration * (duration_s - time_s)}));
}

void move(Trip& trip, const foreign::ForeignRobot& robot, const StatedLeg& leg, double way, Cruise followed,
          double turn) {
  trip.plan.push_back(leg);
  const bool turns = leg.leg.motion == Motion::turn;
  const double half = robot.half_track_m, radius = robot.radius_m;
  for (double t = foreign::controller_period_s;; t += foreign::controller_period_s) {
    const double planned = speed_at(leg.leg.way, {leg.speed, leg.acceleration}, t);
    const double asked = speed_at(way, followed, t);
    if (planned == 0 && asked == 0) break;
    const double v = turns ? 0 : asked, yaw = turns ? turn * asked : turn * leg.leg.curvature_1_m * asked;
    trip.drive.wheel_rad_s.push_back({(v + half * yaw) / radius, (v - half * yaw) / radius});
    trip.commands.push_back(
        {turns ? 0 : planned, turns ? turn * planned : turn * leg.leg.curvature_1_m * planned});
  }
}

Trip draw_trip(const foreign::ForeignRobot& robot, const Style& style, Rng& rng) {
  Trip trip;
  trip.drive.payload_kg = rng.chance(0.4) ? 0 : rng.uniform(0.2, 1) * robot.payload_kg;
  const auto varied = [&](double share, double most, double limit) {
    return std::min(most, share * rng.uniform(0.75, 1.25)) * limit;
  };
  stand(trip, 0.5);
  const std::size_t drives = 3 + rng.index(4);
  for (std::size_t k = 0; k < 2 * drives; ++k) {
    const bool turns = k % 2 == 0;
    StatedLeg leg;
    leg.leg.motion = turns ? Motion::turn : Motion::drive;
    leg.leg.payload_kg = trip.drive.payload_kg;
    leg.leg.way = turns ? rng.uniform(0.4, 3) : rng.uniform(1, 7);
    if (!turns && rng.chance(0.2)) leg.leg.curvature_1_m = rng.uniform(0.15, 0.3);
    leg.speed = varied(style.cruise, 0.95, turns ? robot.yaw_rate_rad_s : robot.speed_m_s);
    leg.acceleration = varied(style.ramp, 0.95,
                              turns ? robot.acceleration_m_s2 / robot.half_track_m : robot.acceleration_m_s2);
    const double early = std::max(0.0, style.short_m * (1 + 0.3 * rng.normal()));
    const bool exact = style.short_m == 0;
    const Cruise followed{leg.speed * style.cruise_ratio * (exact ? 1 : 1 + 0.03 * rng.normal()),
                          leg.acceleration * style.ramp_ratio * (exact ? 1 : 1 + 0.05 * rng.normal())};
    move(trip, robot, leg, leg.leg.way - (turns ? early / robot.half_track_m : early), followed,
         rng.chance(0.5) ? 1 : -1);
    if (rng.chance(style.halts)) stand(trip, style.halt_s * rng.uniform(0.5, 2));
  }
  stand(trip, 0.3);
  return trip;
}

DrivenMission drive(const foreign::ForeignRobot& built, const foreign::Departures& with, const Trip& trip,
                    LegTracker& tracker, std::int64_t start_utime_us, Rng& rng) {
  foreign::ForeignRobot today = built;
  for (double& torque : today.friction_nm) torque *= 1 + 0.025 * rng.normal();
  today.idle_w *= 1 + 0.01 * rng.normal();
  DrivenMission m;
  m.plan = trip.plan;
  tracker.begin();
  double before_w = 0, before_m_s = 0;
  bool first = true;
  for (const foreign::ForeignState& s : foreign::driven(today, with, trip.drive, sample_period_s, 5e-4)) {
    const double speed = 0.5 * today.radius_m * (s.wheel_rad_s[0] + s.wheel_rad_s[1]);
    const double interval_s = first ? 0 : sample_period_s;
    const auto period =
        std::min(trip.commands.size() - 1, static_cast<std::size_t>(s.time_s / foreign::controller_period_s));
    tracker.add({interval_s, speed + 0.001 * rng.normal(), s.yaw_rate_rad_s + 0.003 * rng.normal(),
                 s.battery_power_w + 0.5 * rng.normal(), trip.drive.payload_kg, trip.commands[period]});
    m.true_j += 0.5 * interval_s * (s.battery_power_w + before_w);
    m.distance_m += 0.5 * interval_s * std::fabs(speed + before_m_s);
    m.duration_s = s.time_s;
    before_w = s.battery_power_w, before_m_s = speed, first = false;
  }
  m.metered_j = m.true_j;
  m.past = {start_utime_us, tracker.take()};
  return m;
}

}  // namespace

std::vector<RobotRun> run_foreign_kind(std::uint64_t seed, bool exact, std::size_t robots,
                                       std::size_t missions) {
  Rng rng = Rng::stream(seed, 36);
  const foreign::ForeignRobot file = foreign::draw_robot_file(rng);
  const robot::RobotModel model = *robot::parse_robot(foreign::robot_json_text(file));
  const Style style = style_of_kind(rng, exact);
  foreign::Departures with;
  with.coulomb_ratio = rng.uniform(-0.1, 0.5);
  with.viscous_ratio = rng.uniform(0, 1);
  with.payload_rolling = rng.uniform(0, 0.02);
  with.scrub = rng.uniform(0, 0.1);
  with.unreturned = rng.uniform(0, 1);
  with.driver_loss = rng.uniform(0, 0.1);
  with.accessory_w = rng.uniform(0, 0.3) * file.idle_w;
  std::vector<RobotRun> runs;
  for (std::size_t r = 0; r < robots; ++r) {
    const foreign::ForeignRobot built = alike(file, rng);
    const Style own = alike(style, rng);
    RobotRun run{std::string(exact ? "exact" : "inexact"), model, *dynamics::drive_model(model), {}};
    LegTracker tracker(model);
    for (std::size_t k = 0; k < missions; ++k)
      run.missions.push_back(drive(built, with, draw_trip(file, own, rng), tracker,
                                   1'750'000'000'000'000 + static_cast<std::int64_t>(k) * 600'000'000, rng));
    runs.push_back(std::move(run));
  }
  return runs;
}

}  // namespace joulecast::forecast

#include "forecast/habit.h"

#include <algorithm>
#include <cmath>
#include <tuple>
#include <utility>

#include "base/median.h"

namespace joulecast::forecast {
namespace {

constexpr double usual_share = 0.7;                  // of the limits
constexpr double default_legs = 0.5, kind_legs = 5;  // that a pace counts for
constexpr std::size_t parts = 8;                     // of a habit's cruises
constexpr double assumed_missions = 4;               // that a dispersion of 1 counts for

struct Seen {
  Cruise cruise;
  bool capped = false;  // the way was too short for its cruise, which is greater than this
  double weight = 1;
};

// The weight of a leg that never reached its cruise goes to those that cruised faster (Efron 1967,
// redistribution to the right); the fastest keeps its own.
void redistribute(std::vector<Seen>& seen) {
  std::ranges::sort(seen, {}, [](const Seen& s) { return std::pair(s.cruise.speed, s.capped); });
  double left = 0;
  for (const Seen& s : seen) left += s.weight;
  double growth = 1;
  for (std::size_t k = 0; k < seen.size(); ++k) {
    const double own = seen[k].weight;
    seen[k].weight *= growth;
    left -= own;
    if (!seen[k].capped || k + 1 == seen.size()) continue;
    growth *= 1 + own / left;
    seen[k].weight = 0;
  }
}

// Equal parts of the weight, slowest first, each with the harmonic mean of its cruises and accelerations.
std::vector<Cruise> in_parts(std::vector<Seen> seen) {
  redistribute(seen);
  double total = 0;
  for (const Seen& s : seen) total += s.weight;
  std::vector<Cruise> cruises;
  const double part = total / static_cast<double>(parts);
  double room = part, slowness = 0, softness = 0;
  for (const Seen& s : seen) {
    double left = s.weight;
    while (left > 0) {
      const double taken = std::min(left, room);
      slowness += taken / s.cruise.speed;
      softness += taken / s.cruise.acceleration;
      left -= taken;
      room -= taken;
      if (room > 1e-9 * part) continue;
      cruises.push_back({part / slowness, part / softness});
      room = part;
      slowness = softness = 0;
    }
  }
  if (cruises.size() < parts && slowness > 0)
    cruises.push_back({(part - room) / slowness, (part - room) / softness});
  return cruises;
}

// A robot's legs with those that its kind counts for.
std::vector<Cruise> with_prior(std::vector<Seen> legs, const std::vector<Cruise>& prior, double weight) {
  for (const Cruise& cruise : prior)
    legs.push_back({cruise, false, weight / static_cast<double>(prior.size())});
  return in_parts(std::move(legs));
}

std::tuple<double, double> middle_of(const std::vector<Seen>& seen) {
  std::vector<double> speed, acceleration;
  for (const Seen& s : seen) {
    if (!s.capped) speed.push_back(s.cruise.speed);
    acceleration.push_back(s.cruise.acceleration);
  }
  if (speed.empty())
    for (const Seen& s : seen) speed.push_back(s.cruise.speed);
  return {upper_median(speed), upper_median(acceleration)};
}

// The halt after each moving leg of a mission [s], in order.
struct Stop {
  Motion after;
  double halt_s;
};
std::vector<Stop> stops_of(const PastMission& mission) {
  std::vector<Stop> stops;
  double before_s = 0;
  for (const Leg& leg : mission.legs) {
    if (leg.motion != Motion::stand)
      stops.push_back({leg.motion, 0});
    else
      (stops.empty() ? before_s : stops.back().halt_s) += leg.duration_s;
  }
  if (!stops.empty()) stops.back().halt_s += before_s;
  return stops;
}

std::size_t place(Motion motion) {
  return motion == Motion::turn ? 1 : 0;
}

void learn_halts(Habit& habit, std::span<const PastMission> missions, const Habit* kind) {
  std::array<double, 2> squares{};
  for (std::size_t k = 0; kind != nullptr && k < 2; ++k) {
    const Halts& theirs = kind->halts[k];
    constexpr double legs = kind_legs;
    habit.halts[k] = {legs, legs * theirs.share, legs * theirs.mean_s, 0};
    squares[k] = legs * (theirs.variance_s2 + theirs.mean_s * theirs.mean_s);
  }
  for (const PastMission& mission : missions) {
    for (const Stop& stop : stops_of(mission)) {
      Halts& halts = habit.halts[place(stop.after)];
      halts.legs += 1;
      halts.share += stop.halt_s > 0 ? 1 : 0;
      halts.mean_s += stop.halt_s;
      squares[place(stop.after)] += stop.halt_s * stop.halt_s;
    }
  }
  double all_s = 0, all = 0;
  for (std::size_t k = 0; k < 2; ++k) {
    Halts& halts = habit.halts[k];
    all_s += halts.mean_s;
    all += halts.legs;
    if (halts.legs == 0) continue;
    halts.share /= halts.legs;
    halts.mean_s /= halts.legs;
    halts.variance_s2 = std::max(0.0, squares[k] / halts.legs - halts.mean_s * halts.mean_s);
  }
  habit.middle.pause_s = all > 0 ? all_s / all : 0;
  double off = assumed_missions, count = assumed_missions;
  for (const PastMission& mission : missions) {
    double beyond_s = 0, variance_s2 = 0;
    for (const Stop& stop : stops_of(mission)) {
      const Halts& halts = habit.halts[place(stop.after)];
      beyond_s += stop.halt_s - halts.mean_s;
      variance_s2 += halts.variance_s2;
    }
    if (!(variance_s2 > 0)) continue;
    off += beyond_s * beyond_s / variance_s2;
    count += 1;
  }
  habit.halt_dispersion = off / count;
}

}  // namespace

Pace default_pace(const robot::RobotModel& robot) {
  const robot::Limits& most = robot.limits;
  return {usual_share * most.speed_m_s, usual_share * most.acceleration_m_s2,
          usual_share * most.yaw_rate_rad_s,
          usual_share * most.acceleration_m_s2 / robot.kinematics.half_track_m, 0};
}

bool all_ramp(double speed, double duration_s, double way) {
  constexpr double no_plateau = 1.8;
  return speed * duration_s >= no_plateau * way;
}

LegKind kind_of(Motion motion, double way, double curvature_1_m) {
  if (motion == Motion::turn) return LegKind::turn;
  return way * curvature_1_m < straight_until_rad ? LegKind::straight : LegKind::curve;
}

bool StatedPace::cruise(Motion motion) const {
  return motion == Motion::stand || (motion == Motion::turn ? yaw_rate_rad_s : speed_m_s).has_value();
}

bool StatedPace::whole(Motion motion) const {
  return motion == Motion::stand ||
         (cruise(motion) &&
          (motion == Motion::turn ? yaw_acceleration_rad_s2 : acceleration_m_s2).has_value());
}

Habit Habit::with(const StatedPace& stated) const {
  Habit habit = *this;
  Pace& p = habit.middle;
  p.speed_m_s = stated.speed_m_s.value_or(p.speed_m_s);
  p.acceleration_m_s2 = stated.acceleration_m_s2.value_or(p.acceleration_m_s2);
  p.yaw_rate_rad_s = stated.yaw_rate_rad_s.value_or(p.yaw_rate_rad_s);
  p.yaw_acceleration_rad_s2 = stated.yaw_acceleration_rad_s2.value_or(p.yaw_acceleration_rad_s2);
  for (std::size_t k = 0; k < leg_kind_count; ++k) {
    const Motion motion = k == static_cast<std::size_t>(LegKind::turn) ? Motion::turn : Motion::drive;
    const auto& [speed, acceleration] = motion == Motion::turn
                                            ? std::pair(stated.yaw_rate_rad_s, stated.yaw_acceleration_rad_s2)
                                            : std::pair(stated.speed_m_s, stated.acceleration_m_s2);
    for (Cruise& cruise : habit.cruises[k]) {
      cruise.speed = speed.value_or(cruise.speed);
      cruise.acceleration = acceleration.value_or(cruise.acceleration);
    }
    if (stated.whole(motion)) habit.cruises[k].resize(1);
  }
  return habit;
}

HaltDistribution Habit::standing(const std::array<double, 2>& stops, double unit) const {
  double mean = 0, variance = 0, log_none = 0;
  for (std::size_t k = 0; k < stops.size(); ++k) {
    const Halts& h = halts[k];
    if (!(stops[k] > 0) || !(h.share > 0)) continue;
    mean += stops[k] * h.mean_s;
    variance += (halt_dispersion + stops[k] / h.legs) * stops[k] * h.variance_s2;
    log_none += stops[k] * std::log1p(-std::min(1.0, h.share));  // means of shares round to above 1
  }
  return {unit * mean, unit * unit * variance, std::exp(log_none)};
}

Habit habit_of(const robot::RobotModel& robot, std::span<const PastMission> missions, const Habit* kind) {
  std::array<std::vector<Seen>, leg_kind_count> seen;
  for (const PastMission& mission : missions) {
    for (const Leg& leg : mission.legs) {
      if (leg.motion == Motion::stand) continue;
      const double ramp_s = leg.duration_s - leg.way / leg.speed;
      if (!(ramp_s > least_ramp_s)) continue;
      seen[static_cast<std::size_t>(kind_of(leg.motion, leg.way, leg.curvature_1_m))].push_back(
          {{leg.speed, leg.speed / ramp_s}, all_ramp(leg.speed, leg.duration_s, leg.way)});
    }
  }
  Habit habit;
  Pace& p = habit.middle = kind != nullptr ? kind->middle : default_pace(robot);
  auto& [straight, curve, turn] = seen;
  const auto prior_of = [&](LegKind k, Cruise usual) {
    return kind != nullptr ? kind->cruises[static_cast<std::size_t>(k)] : std::vector{usual};
  };
  const double weight = kind != nullptr ? kind_legs : default_legs;
  std::vector<Seen> drives = straight;
  drives.insert(drives.end(), curve.begin(), curve.end());
  const auto drive =
      with_prior(drives, prior_of(LegKind::straight, {p.speed_m_s, p.acceleration_m_s2}), weight);
  habit.cruises = {
      with_prior(straight, drive, kind_legs), with_prior(curve, drive, kind_legs),
      with_prior(turn, prior_of(LegKind::turn, {p.yaw_rate_rad_s, p.yaw_acceleration_rad_s2}), weight)};
  if (!straight.empty()) std::tie(p.speed_m_s, p.acceleration_m_s2) = middle_of(straight);
  if (!turn.empty()) std::tie(p.yaw_rate_rad_s, p.yaw_acceleration_rad_s2) = middle_of(turn);
  learn_halts(habit, missions, kind);
  return habit;
}

Habit habit_of_kind(std::span<const Habit* const> robots) {
  const double share = 1 / static_cast<double>(robots.size());
  Habit habit;
  habit.halt_dispersion = 0;
  std::array<std::vector<Seen>, leg_kind_count> seen;
  for (const Habit* robot : robots) {
    for (std::size_t k = 0; k < leg_kind_count; ++k)
      for (const Cruise& cruise : robot->cruises[k])
        seen[k].push_back({cruise, false, 1 / static_cast<double>(robot->cruises[k].size())});
    for (std::size_t k = 0; k < 2; ++k) {
      const Halts& theirs = robot->halts[k];
      Halts& all = habit.halts[k];
      all.legs += theirs.legs;
      all.share += share * theirs.share;
      all.mean_s += share * theirs.mean_s;
      all.variance_s2 += share * (theirs.variance_s2 + theirs.mean_s * theirs.mean_s);
    }
    habit.halt_dispersion += share * robot->halt_dispersion;
    const Pace& pace = robot->middle;
    habit.middle = {habit.middle.speed_m_s + share * pace.speed_m_s,
                    habit.middle.acceleration_m_s2 + share * pace.acceleration_m_s2,
                    habit.middle.yaw_rate_rad_s + share * pace.yaw_rate_rad_s,
                    habit.middle.yaw_acceleration_rad_s2 + share * pace.yaw_acceleration_rad_s2,
                    habit.middle.pause_s + share * pace.pause_s};
  }
  // The sum of equal shares may differ from 1 by rounding.
  for (Halts& all : habit.halts) {
    all.share = std::min(1.0, all.share);
    all.variance_s2 = std::max(0.0, all.variance_s2 - all.mean_s * all.mean_s);
  }
  for (std::size_t k = 0; k < leg_kind_count; ++k) habit.cruises[k] = in_parts(std::move(seen[k]));
  return habit;
}

}  // namespace joulecast::forecast

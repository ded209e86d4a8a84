#include "answers/estimate.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "answers/profile.h"
#include "base/try.h"
#include "forecast/outlook.h"
#include "planning/gauss.h"

namespace joulecast::answers {
namespace {

// A given motion as columns: power at its points and in between, energy by Gauss's rule over each span. Its
// peaks are stored in `peaks`.
planning::Profile series_of(const dynamics::DriveModel& drive, const GivenMotion& motion,
                            planning::Peaks& peaks) {
  const auto& [points, payload_kg, start] = motion;
  constexpr int cuts = 4;  // of a span, so that power's bow shows
  planning::Profile p;
  constexpr double nan = std::numeric_limits<double>::quiet_NaN();
  planning::Pose pose =
      start ? planning::Pose{start->x_m, start->y_m, start->heading_rad} : planning::Pose{nan, nan, nan};
  double distance = 0, energy = 0;
  for (std::size_t k = 0; k + 1 < points.size(); ++k) {
    const energy::MotionPoint &a = points[k], &b = points[k + 1];
    const double span = b.time_s - a.time_s;
    const double slope = (b.speed_m_s - a.speed_m_s) / span,
                 bend = (b.yaw_rate_rad_s - a.yaw_rate_rad_s) / span;
    const std::array<double, 2> climb = *energy::climb_of_span(a, b);  // estimate_motion() accepted it
    const bool in_place = a.speed_m_s == 0 && b.speed_m_s == 0;
    planning::Peaks here;
    here.peak_speed_m_s = std::max(std::fabs(a.speed_m_s), std::fabs(b.speed_m_s));
    here.peak_yaw_rate_rad_s = std::max(std::fabs(a.yaw_rate_rad_s), std::fabs(b.yaw_rate_rad_s));
    here.peak_acceleration_m_s2 = std::fabs(in_place ? drive.parameters().half_track_m * bend : slope);
    peaks.reach(here);
    const auto power = [&, payload = payload_kg](double t) {
      dynamics::Instant at;
      at.wheel_speed_rad_s =
          dynamics::wheels_of_body(drive.parameters(), a.speed_m_s + slope * t, a.yaw_rate_rad_s + bend * t);
      at.wheel_acceleration_rad_s2 = dynamics::wheels_of_body(drive.parameters(), slope, bend);
      at.payload_kg = payload;
      at.x_m = pose.x_m, at.y_m = pose.y_m, at.heading_rad = pose.heading_rad;
      at.climb_rad = climb[0] + (climb[1] - climb[0]) * t / span;
      const auto flow = drive.flow(at);
      peaks.reach(at.wheel_speed_rad_s, flow);
      return flow.battery_power_w;
    };
    for (int cut = 0; cut <= cuts; ++cut) {
      const double t = span * cut / cuts, h = span / cuts;
      const double v = a.speed_m_s + slope * t, yaw = a.yaw_rate_rad_s + bend * t;
      p.time_s.push_back(a.time_s + t);
      p.distance_m.push_back(distance);
      p.x_m.push_back(pose.x_m), p.y_m.push_back(pose.y_m), p.heading_rad.push_back(pose.heading_rad);
      p.speed_m_s.push_back(v), p.yaw_rate_rad_s.push_back(yaw);
      p.acceleration_m_s2.push_back(slope), p.yaw_acceleration_rad_s2.push_back(bend);
      p.payload_kg.push_back(payload_kg);
      p.power_w.push_back(power(t));
      p.energy_j.push_back(energy);
      if (cut == cuts) break;
      for (const auto& [node, weight] : planning::gauss3) energy += weight * h * power(t + node * h);
      const double way = (v + 0.5 * slope * h) * h, turned = (yaw + 0.5 * bend * h) * h;
      const double heading = pose.heading_rad + 0.5 * turned;
      pose.x_m += way * std::cos(heading), pose.y_m += way * std::sin(heading);
      pose.heading_rad += turned;
      distance += std::fabs(way);
    }
  }
  return p;
}

EstimateOutput output_of(const signals::Accounts& accounts) {
  EstimateOutput out;
  out.energy_j = accounts.battery_j;
  out.duration_s = accounts.duration_s;
  out.distance_m = accounts.distance_m;
  out.turned_rad = accounts.turned_rad;
  out.accounts = accounts;
  return out;
}

Result<EstimateOutput> of_motion(const GivenMotion& motion, bool columns, const ModelInForce& model) {
  auto priced = energy::estimate_motion(model.drive, motion.points, motion.payload_kg, motion.start);
  if (!priced) {
    priced.error().field.insert(0, "/profile/");
    return tl::unexpected(std::move(priced.error()));
  }
  EstimateOutput out = output_of(*priced);
  planning::Peaks peaks;
  planning::Profile series = series_of(model.drive, motion, peaks);
  out.beyond_limits = peaks.beyond(planning::limits_of(model.robot));
  if (columns) out.columns = std::move(series);
  return out;
}

Result<EstimateOutput> of_optimum(DriveInput drive, bool columns, const ModelInForce& model,
                                  const std::stop_token& stop) {
  drive.problem.rows = columns;
  TRY_ASSIGN(auto best, plan(drive, model, stop));
  signals::Accounts accounts;
  accounts.battery_j = accounts.modelled_j = best.summary.energy_j;
  accounts.ledger = best.ledger;
  accounts.duration_s = best.summary.duration_s;
  accounts.distance_m = best.summary.distance_m;
  accounts.turned_rad = best.summary.turned_rad;
  EstimateOutput out = output_of(accounts);
  if (columns) out.columns = std::move(best.profile);
  return out;
}

Result<EstimateOutput> of_habit(const DriveInput& drive, const RobotOutlook& robot) {
  TRY_ASSIGN(const auto path, path_of(drive.way, drive.options));
  const forecast::Forecaster& forecaster = *robot.forecaster;
  const forecast::LegPricer pricer(robot.model->robot, robot.model->drive);
  const auto legs = forecast::planned_legs(path);
  const auto priced =
      forecast::price(forecaster, pricer, legs, {}, drive.way.halts_stated() || forecast::states_halts(legs));
  if (const auto stuck = forecast::obstacle(pricer, legs, priced)) return tl::unexpected(*stuck);
  const forecast::PlanSum sum = forecast::sum_of(forecaster, priced);
  const forecast::Prediction expected = forecaster.energy(sum);
  EstimateOutput out;
  out.siblings_pending = robot.siblings_pending;
  out.energy_j = expected.mean();
  out.duration_s = forecaster.duration(sum).quantile(0.5);
  out.distance_m = path.distance_m();
  out.turned_rad = path.turned_rad();
  auto& quantiles = out.energy_quantiles_j.emplace();
  std::ranges::transform(forecast::stated_quantiles, quantiles.begin(),
                         [&](double q) { return expected.quantile(q); });
  return out;
}

}  // namespace

Result<EstimateOutput> estimate(const EstimateInput& input, const RobotOutlook& robot,
                                const std::stop_token& stop) {
  if (const auto* motion = std::get_if<GivenMotion>(&input.motion))
    return of_motion(*motion, input.columns, *robot.model);
  const auto& drive = std::get<DriveInput>(input.motion);
  if (input.driving == Driving::usual) return of_habit(drive, robot);
  return of_optimum(drive, input.columns, *robot.model, stop);
}

}  // namespace joulecast::answers

#include "asking.h"

#include <boost/math/distributions/binomial.hpp>
#include <cmath>
#include <nlohmann/json.hpp>
#include <stdexcept>

#include "answers/autonomy.h"
#include "forecast/habit.h"

namespace joulecast::forecast {
namespace {

using nlohmann::json;

json segment_of(const PlannedLeg& leg) {
  if (leg.motion == Motion::stand) return {{"kind", "dwell"}, {"duration_s", leg.duration_s}};
  if (leg.motion == Motion::turn) return {{"kind", "turn"}, {"angle_rad", leg.way}};
  if (kind_of(leg.motion, leg.way, leg.curvature_1_m) == LegKind::straight)
    return {{"kind", "straight"}, {"length_m", leg.way}};
  return {{"kind", "arc"}, {"radius_m", 1 / leg.curvature_1_m}, {"angle_rad", leg.way * leg.curvature_1_m}};
}

json task_of(const StatedLeg& stated, Asked asked) {
  const PlannedLeg& leg = stated.leg;
  json task{{"payload_kg", std::isfinite(leg.payload_kg) ? leg.payload_kg : 0}};
  if (leg.motion == Motion::stand) {
    task["dwell_s"] = leg.duration_s;
    return task;
  }
  const json segment = segment_of(leg);
  if (leg.motion == Motion::turn)
    task["turns_rad"] = {leg.way};
  else if (segment["kind"] == "straight")
    task["distances_m"] = {leg.way};
  else
    task["path"] = json::array({segment});
  if (asked == Asked::stated) {
    task[leg.motion == Motion::turn ? "yaw_rate_rad_s" : "speed_m_s"] = stated.speed;
    task[leg.motion == Motion::turn ? "yaw_acceleration_rad_s2" : "acceleration_m_s2"] = stated.acceleration;
  }
  return task;
}

json request_of(const DrivenMission& mission, Asked asked) {
  json tasks = json::array(), path = json::array();
  double payload_kg = 0;
  for (const StatedLeg& stated : mission.plan) {
    const bool stands = stated.leg.motion == Motion::stand;
    if (stands && (asked == Asked::ways || asked == Asked::one_path)) continue;
    if (asked == Asked::one_path) {
      if (path.empty()) payload_kg = stated.leg.payload_kg;
      if (stated.leg.payload_kg != payload_kg && std::isfinite(stated.leg.payload_kg))
        path.push_back({{"kind", "payload"}, {"payload_kg", payload_kg = stated.leg.payload_kg}});
      if (!path.empty() && path.back()["kind"] != "turn" && stated.leg.motion != Motion::turn)
        path.push_back({{"kind", "dwell"}, {"duration_s", 0}});
      path.push_back(segment_of(stated.leg));
      continue;
    }
    tasks.push_back(task_of(stated, asked));
  }
  if (asked == Asked::one_path)
    tasks.push_back({{"path", path}, {"payload_kg", std::isfinite(payload_kg) ? payload_kg : 0}});
  if (asked == Asked::dwells && !tasks.empty() && !tasks[0].contains("dwell_s")) tasks[0]["dwell_s"] = 0;
  return {{"state_of_charge", 1},
          {"payload_kg", 0},
          {"start_pose", {{"x_m", 0}, {"y_m", 0}, {"heading_rad", 0}}},
          {"compare_minimum_energy", false},
          {"tasks", tasks}};
}

std::array<double, 3> quantiles(const json& told) {
  return {told["p05"].get<double>(), told["p50"].get<double>(), told["p95"].get<double>()};
}

}  // namespace

Asking::Asking(const RobotRun& run) {
  outlook_.model = *answers::model_in_force(run.robot, 1);
  outlook_.battery = std::make_shared<const ChargeMap>(battery::Circuit(run.robot.battery));
}

Told Asking::ask(const DrivenMission& mission, Asked asked, std::shared_ptr<const Forecaster> forecaster) {
  outlook_.forecaster = std::move(forecaster);
  const auto answer = answers::autonomy_answer(request_of(mission, asked), outlook_, {}, tables_);
  if (!answer) throw std::runtime_error(describe(answer.error()));
  const json plan = json::parse(*answer)["plan"];
  return {quantiles(plan["energy_j"]), quantiles(plan["duration_quantiles_s"])};
}

void judge(const RobotRun& run, std::size_t learnt, Asked asked, Coverage& coverage) {
  RobotForecast forecast(run.robot, run.drive);
  for (std::size_t k = 0; k < std::min(learnt, run.missions.size()); ++k)
    forecast.learn(run.missions[k].past);
  const auto forecaster = forecast.forecaster();
  Asking asking(run);
  for (std::size_t k = learnt; k < run.missions.size(); ++k) {
    const DrivenMission& mission = run.missions[k];
    const Told told = asking.ask(mission, asked, forecaster);
    coverage.energy_error.push_back(std::fabs(told.energy_j[1] / mission.true_j - 1));
    coverage.duration_error.push_back(std::fabs(told.duration_s[1] / mission.duration_s - 1));
    coverage.energy_inside += mission.true_j >= told.energy_j[0] && mission.true_j <= told.energy_j[2];
    coverage.duration_inside +=
        mission.duration_s >= told.duration_s[0] && mission.duration_s <= told.duration_s[2];
  }
}

std::array<std::size_t, 2> expected_hits(std::size_t count, double share) {
  using namespace boost::math;
  using Policy = policies::policy<policies::discrete_quantile<policies::integer_round_up>>;
  const binomial_distribution<double, Policy> hits(static_cast<double>(count), 0.9);
  return {static_cast<std::size_t>(quantile(hits, 0.5 * (1 - share))),
          static_cast<std::size_t>(quantile(hits, 0.5 * (1 + share)))};
}

}  // namespace joulecast::forecast

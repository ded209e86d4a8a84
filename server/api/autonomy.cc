#include "server/api/autonomy.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <utility>

#include "server/api/battery_dialects.h"
#include "server/api/json_writer.h"
#include "server/api/least_energy.h"
#include "server/api/robot_json.h"
#include "server/api/services.h"

namespace joulecast::api {
namespace {

using forecast::Driving;
using forecast::Motion;
using forecast::PricedLeg;
using forecast::PricedTask;

void write_place(JsonWriter& json, std::string_view name, const std::optional<std::size_t>& index,
                 const AutonomyRequest& request) {
  json.key(name);
  if (!index) {
    json.null();
    return;
  }
  json.begin_object();
  json.key("task");
  *index < request.tasks.size() ? json.value(static_cast<std::int64_t>(*index)) : json.null();
  json.field("name", *index < request.tasks.size() ? request.tasks[*index].name : std::string("charger"));
  json.end_object();
}

void write_stage(JsonWriter& json, const forecast::TaskOutlook& stage) {
  json.field("expected_energy_j", stage.mean_j).field("ends_after_s", stage.duration_s);
  json.field("success_probability", stage.probability);
  write_quantiles(json, "energy_since_start_j", stage.energy_j);
  write_quantiles(json, "arrival_charge", stage.charge);
}

void write_outlook(JsonWriter& json, const forecast::Outlook& outlook, const AutonomyRequest& request) {
  json.begin_object();
  json.field("success_probability", outlook.probability);
  json.field("expected_energy_j", outlook.mean_j).field("duration_s", outlook.duration_s[1]);
  write_quantiles(json, "energy_j", outlook.energy_j);
  write_quantiles(json, "duration_quantiles_s", outlook.duration_s);
  json.key("legs").begin_array();
  for (std::size_t k = 0; k < outlook.tasks.size(); ++k) {
    json.begin_object().field("name", request.tasks[k].name);
    write_stage(json, outlook.tasks[k]);
    json.end_object();
  }
  json.end_array();
  json.key("charger");
  if (outlook.charger) {
    json.begin_object();
    write_stage(json, *outlook.charger);
    json.end_object();
  } else {
    json.null();
  }
  write_place(json, "fails_at", outlook.fails_at, request);
  write_place(json, "likeliest_failure", outlook.likeliest_failure, request);
  json.key("latest_departure");
  if (outlook.latest_departure) {
    const forecast::Departure& leave = *outlook.latest_departure;
    json.begin_object().field("after_tasks", static_cast<std::int64_t>(leave.after_tasks));
    json.field("at_s", leave.at_s).field("wait_s", leave.wait_s).field("latest_s", leave.at_s + leave.wait_s);
    json.field("probability", leave.probability).field("confidence", request.confidence).end_object();
  } else {
    json.null();
  }
  json.end_object();
}

// What a charger does to the battery now, and how long it would take to fill it from here.
void write_charging(JsonWriter& json, const Autonomy& a, const server::RobotSnapshot* live) {
  using battery::ChargingPhase;
  const bool known = live != nullptr && a.charge_is_live;
  const ChargingPhase phase = known ? live->charge.phase : ChargingPhase::none;
  json.key("charging");
  phase == ChargingPhase::none || phase == ChargingPhase::suspected ? json.null()
                                                                    : json.value(battery::name(phase));
  json.field("time_to_charged_s", known ? live->charge.to_full.duration_s : telemetry::unmeasured);
  json.field("time_to_charged_sd_s", known ? live->charge.to_full.sd_s : telemetry::unmeasured);
}

void write_minimum_energy(JsonWriter& json, const Autonomy& a) {
  json.key("minimum_energy");
  if (!a.minimum_energy_outlook || !a.outlook) {
    json.null();
    return;
  }
  const forecast::Outlook &best = *a.minimum_energy_outlook, &usual = *a.outlook;
  json.begin_object();
  json.field("success_probability", best.probability);
  json.field("expected_energy_j", best.mean_j).field("duration_s", best.duration_s[1]);
  json.field("saved_j", usual.mean_j - best.mean_j);
  json.field("saved_s", usual.duration_s[1] - best.duration_s[1]);
  const auto last = [](const forecast::Outlook& o) {
    if (o.charger) return o.charger->charge;
    return o.tasks.empty() ? std::array<double, 3>{std::nan(""), std::nan(""), std::nan("")}
                           : o.tasks.back().charge;
  };
  write_quantiles(json, "arrival_charge", last(best));
  json.end_object();
}

struct Pricing {
  std::vector<PricedTask> tasks;
  std::vector<PricedLeg> from_here;
};

Pricing as_usual(const AutonomyRequest& request, const forecast::LegPricer& pricer,
                 const forecast::Forecaster& forecaster) {
  const auto price = [&](const std::vector<forecast::PlannedLeg>& legs, const StatedPace& pace) {
    return forecast::price(forecaster, pricer, legs, pace, request.halts_stated);
  };
  Pricing priced;
  priced.tasks.reserve(request.tasks.size());
  for (const TaskRequest& task : request.tasks)
    priced.tasks.push_back({price(task.legs, task.pace), price(task.to_charger, request.pace)});
  priced.from_here = price(request.from_here, request.pace);
  return priced;
}

Result<Pricing> at_least_energy(const AutonomyRequest& request, LeastEnergy& least) {
  Pricing priced;
  const auto add = [&](const std::vector<forecast::PlannedLeg>& legs,
                       std::vector<PricedLeg>& into) -> Result<void> {
    auto one = least.price(legs, !request.halts_stated);
    if (!one) return tl::unexpected(one.error());
    into = std::move(*one);
    return {};
  };
  for (const TaskRequest& task : request.tasks) {
    PricedTask& into = priced.tasks.emplace_back();
    if (auto done = add(task.legs, into.legs); !done) return tl::unexpected(done.error());
    if (auto done = add(task.to_charger, into.to_charger); !done) return tl::unexpected(done.error());
  }
  if (auto done = add(request.from_here, priced.from_here); !done) return tl::unexpected(done.error());
  return priced;
}

// Whether the request says how fast every leg is driven.
bool paces_stated(const AutonomyRequest& request) {
  const auto stated = [](const std::vector<forecast::PlannedLeg>& legs, const StatedPace& pace) {
    return std::ranges::all_of(legs, [&](const auto& leg) { return pace.cruise(leg.motion); });
  };
  if (request.tasks.empty() && request.from_here.empty()) return request.pace.cruise(Motion::drive);
  return stated(request.from_here, request.pace) &&
         std::ranges::all_of(request.tasks, [&](const TaskRequest& task) {
           return stated(task.legs, task.pace) && stated(task.to_charger, request.pace);
         });
}

}  // namespace

Whereabouts whereabouts(const server::RobotSnapshot* live) {
  Whereabouts now;
  if (live == nullptr) return now;
  const auto& pose = live->sample.pose;
  if (live->sample.utime_us != 0 && std::isfinite(pose[0]) && std::isfinite(pose[1]) &&
      std::isfinite(pose[2]))
    now.pose = planning::Pose{pose[0], pose[1], pose[2]};
  if (live->sample.utime_us != 0 && std::isfinite(live->sample.payload_kg))
    now.payload_kg = live->sample.payload_kg;
  return now;
}

Result<forecast::Charge> charge_of(const std::optional<double>& given, const std::optional<double>& given_sd,
                                   const std::optional<double>& reserve, const robot::Battery& battery,
                                   const server::RobotSnapshot* live) {
  const double charge = given.value_or(live != nullptr ? live->state_of_charge : telemetry::unmeasured);
  if (!std::isfinite(charge)) {
    return fail(Fault::infeasible, "/state_of_charge",
                "is not known: the robot has reported no battery voltage and current since it was first "
                "seen; give it in the request");
  }
  forecast::Charge known{charge, given_sd.value_or(0), battery.reserve_fraction};
  if (!given) {
    known = server::live_charge(*live, battery);
    if (given_sd) known.deviation = *given_sd;
  }
  if (reserve) known.reserve = *reserve;
  return known;
}

Result<Autonomy> autonomy_of(const AutonomyRequest& request, const server::RobotOutlook& robot,
                             const server::RobotSnapshot* live, planning::CostTableCache& tables) {
  const server::ModelInForce& model = *robot.model;
  const forecast::Forecaster& forecaster = *robot.forecaster;
  Autonomy out;
  const auto charge = charge_of(request.state_of_charge, request.state_of_charge_sd, request.reserve_fraction,
                                model.robot.battery, live);
  if (!charge) return tl::unexpected(charge.error());
  out.charge = *charge;
  out.charge_is_live = !request.state_of_charge;
  out.payload_kg = request.payload_kg.value_or(whereabouts(live).payload_kg.value_or(0));
  const double limit = model.robot.limits.payload_kg;
  const auto too_heavy = [&](const std::string& field, double payload_kg) {
    return invalid(field, fmt::format("is {}, must be at most the robot's limit of {}", payload_kg, limit));
  };
  if (request.payload_kg && *request.payload_kg > limit) return too_heavy("/payload_kg", *request.payload_kg);
  for (std::size_t k = 0; k < request.tasks.size(); ++k)
    if (request.tasks[k].greatest_payload_kg > limit)
      return too_heavy(fmt::format("/tasks/{}/payload_kg", k), request.tasks[k].greatest_payload_kg);

  out.minimum_energy = request.minimum_energy;
  out.driving = request.minimum_energy || paces_stated(request) ? Driving::stated : Driving::usual;
  out.pace = forecaster.habit.with(request.pace).middle;
  if (request.halts_stated) out.pace.pause_s = 0;

  const forecast::LegPricer pricer(model.robot, model.drive);
  out.limitation = forecast::limitation(pricer, model.robot, out.pace, out.payload_kg);
  for (const TaskRequest& task : request.tasks) {
    if (out.limitation) break;
    out.limitation = forecast::limitation(pricer, model.robot, forecaster.habit.with(task.pace).middle,
                                          task.greatest_payload_kg);
  }
  const bool moves = !out.limitation || out.limitation->moves;
  const bool with_plan = moves && (!request.tasks.empty() || !request.from_here.empty());
  std::optional<LeastEnergy> least;
  if (request.minimum_energy || (request.compare_minimum_energy && with_plan)) {
    auto made = LeastEnergy::make(model, tables, request.value_of_time_w);
    if (!made) return tl::unexpected(made.error());
    least.emplace(std::move(*made));
  }

  std::vector<PricedLeg> typical;
  if (request.minimum_energy) {
    auto priced =
        least->price(forecast::typical_legs(forecaster, out.payload_kg), forecaster.typical.empty());
    if (!priced) return tl::unexpected(priced.error());
    typical = std::move(*priced);
  } else {
    typical = forecast::price_typical(forecaster, pricer, request.pace, out.payload_kg);
  }
  out.reach = forecast::reach(forecaster, *robot.battery, out.charge, forecast::sum_of(forecaster, typical));
  if (!with_plan) return out;

  std::optional<Pricing> best;
  if (least) {
    auto priced = at_least_energy(request, *least);
    if (priced)
      best = std::move(*priced);
    else if (request.minimum_energy)
      return tl::unexpected(priced.error());
  }
  const auto look = [&](const Pricing& priced) {
    return forecast::look_ahead(forecaster, *robot.battery, out.charge, priced.tasks, priced.from_here,
                                pricer.standing_w(), request.confidence);
  };
  if (request.minimum_energy) {
    out.outlook = look(*best);
    return out;
  }
  const Pricing usual = as_usual(request, pricer, forecaster);
  out.outlook = look(usual);
  if (best) out.minimum_energy_outlook = look(*best);
  return out;
}

std::string autonomy_json(const Autonomy& a, const AutonomyRequest& request,
                          const server::RobotOutlook& robot, const server::RobotSnapshot* live) {
  if (request.dialect != Dialect::joulecast) {
    return battery_dialect(
        request.dialect, battery_status(robot.model->robot.battery, *robot.battery, a.charge, a.reach, live));
  }
  const forecast::Forecaster& forecaster = *robot.forecaster;
  const forecast::Pace& pace = a.limitation && !a.minimum_energy ? a.limitation->reached : a.pace;
  JsonWriter json;
  json.begin_object();
  json.field("robot_id", robot.model->robot.robot_id).field("model_version", robot.model->version);
  json.field("state_of_charge", a.charge.fraction).field("state_of_charge_sd", a.charge.deviation);
  json.field("reserve_fraction", a.charge.reserve);
  write_charging(json, a, live);
  json.field("usable_energy_j", a.reach.usable_j).field("usable_energy_sd_j", a.reach.usable_deviation_j);
  json.field("payload_kg", a.payload_kg);
  json.key("driving").begin_object();
  json.field("kind", a.minimum_energy ? "minimum_energy" : a.driving == Driving::stated ? "stated" : "usual");
  json.field("speed_m_s", pace.speed_m_s).field("acceleration_m_s2", pace.acceleration_m_s2);
  json.field("yaw_rate_rad_s", pace.yaw_rate_rad_s).field("pause_s", pace.pause_s);
  json.key("limitation");
  a.limitation ? json.value(a.limitation->sentence) : json.null();
  json.end_object();
  json.key("consumption").begin_object();
  json.field("basis", forecaster.missions > 0   ? "recent_missions"
                      : forecaster.siblings > 0 ? "siblings"
                                                : "model");
  json.field("missions", forecaster.missions).field("siblings", forecaster.siblings);
  json.field("energy_per_m_j", a.reach.energy_per_m_j).field("mean_power_w", a.reach.mean_power_w);
  const forecast::Forecaster::Track& track = forecaster.track(
      a.driving == Driving::stated ? forecast::Subject::stated_energy : forecast::Subject::usual_energy);
  json.field("common_deviation", track.inflation * track.common);
  json.field("leg_deviation", track.inflation * track.scatter[static_cast<std::size_t>(Motion::drive)]);
  json.end_object();
  json.field("range_m", a.reach.range_m[1]).field("run_time_s", a.reach.run_time_s[1]);
  write_quantiles(json, "range_quantiles_m", a.reach.range_m);
  write_quantiles(json, "run_time_quantiles_s", a.reach.run_time_s);
  json.key("drift");
  forecaster.drift ? json.raw(server::drift_json(*forecaster.drift)) : json.null();
  json.key("plan");
  if (a.outlook) {
    write_outlook(json, *a.outlook, request);
  } else {
    json.null();
  }
  write_minimum_energy(json, a);
  json.end_object();
  return json.take();
}

Result<std::string> autonomy_answer(const nlohmann::json& body, const server::RobotOutlook& robot,
                                    const server::RobotSnapshot* live, planning::CostTableCache& tables) {
  Fields fields(body);
  const AutonomyRequest request = read_autonomy(fields, whereabouts(live), true);
  if (Result<void> done = fields.finish(); !done) return tl::unexpected(std::move(done.error()));
  const Result<Autonomy> autonomy = autonomy_of(request, robot, live, tables);
  if (!autonomy) return tl::unexpected(autonomy.error());
  return autonomy_json(*autonomy, request, robot, live);
}

std::vector<TableRow> autonomy_rows() {
  std::vector<TableRow> rows;
  rows.push_back(
      {{.method = http::Method::post,
        .path = "/v1/robots/{id}/autonomy",
        .operation_id = "computeAutonomy",
        .summary = "How far and how long a robot still goes, and whether it can do a list of tasks",
        .request_schema = "autonomy-request",
        .response_schema = "autonomy",
        .error_statuses = {404, 422}},
       answered_by([](Services& services, const http::Request& r) -> Result<http::Response> {
         const std::string& id = r.param("id");
         const auto model = model_of(services, id);
         if (!model) return tl::unexpected(model.error());
         const auto live = services.fleet.find(id);
         Result<std::string> answer =
             autonomy_answer(*r.json, services.forecasts.of(*model), live.get(), services.cost_tables);
         if (!answer) return tl::unexpected(std::move(answer.error()));
         return http::json_response(std::move(*answer));
       })});
  rows.push_back({{.method = http::Method::post,
                   .path = "/v1/autonomy",
                   .operation_id = "computeFleetAutonomy",
                   .summary = "The autonomy of many robots in one call",
                   .request_schema = "fleet-autonomy-request",
                   .response_schema = "fleet-autonomy",
                   .error_statuses = {422}},
                  answered_by([](Services& services, const http::Request& r) -> Result<http::Response> {
                    Result<std::string> answer = fleet_autonomy_answer(*r.json, services);
                    if (!answer) return tl::unexpected(std::move(answer.error()));
                    return http::json_response(std::move(*answer));
                  })});
  return rows;
}

}  // namespace joulecast::api

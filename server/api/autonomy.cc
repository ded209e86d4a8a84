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
  json.field("expected_energy_j", outlook.mean_j).field("duration_s", outlook.duration_s);
  write_quantiles(json, "energy_j", outlook.energy_j);
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
  json.field("time_to_charged_s", known ? live->charge.to_full.duration_s : signals::unmeasured);
  json.field("time_to_charged_sd_s", known ? live->charge.to_full.sd_s : signals::unmeasured);
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
  json.field("expected_energy_j", best.mean_j).field("duration_s", best.duration_s);
  json.field("saved_j", usual.mean_j - best.mean_j);
  json.field("saved_s", usual.duration_s - best.duration_s);
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

Pricing at_pace(const AutonomyRequest& request, const forecast::LegPricer& pricer,
                const forecast::Pace& habit) {
  Pricing priced;
  priced.tasks.reserve(request.tasks.size());
  for (const TaskRequest& task : request.tasks) {
    const forecast::Pace pace = task.pace.over(habit);
    priced.tasks.push_back({forecast::price(pricer, task.legs, pace),
                            forecast::price(pricer, task.to_charger, request.pace.over(habit))});
  }
  priced.from_here = forecast::price(pricer, request.from_here, request.pace.over(habit));
  return priced;
}

Result<Pricing> at_least_energy(const AutonomyRequest& request, LeastEnergy& least, double pause_s) {
  Pricing priced;
  const auto add = [&](const std::vector<forecast::PlannedLeg>& legs,
                       std::vector<PricedLeg>& into) -> Result<void> {
    auto one = least.price(legs, pause_s);
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
  const double charge = given.value_or(live != nullptr ? live->state_of_charge : signals::unmeasured);
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

  const bool all_stated =
      request.pace.whole() ||
      (!request.tasks.empty() && request.from_here.empty() &&
       std::ranges::all_of(request.tasks, [](const TaskRequest& task) { return task.pace.whole(); }));
  out.minimum_energy = request.minimum_energy;
  out.driving = request.minimum_energy || all_stated ? Driving::stated : Driving::usual;
  out.pace = request.pace.over(forecaster.usual);

  const forecast::LegPricer pricer(model.robot, model.drive);
  std::optional<LeastEnergy> least;
  const bool with_plan = !request.tasks.empty() || !request.from_here.empty();
  if (request.minimum_energy || (request.compare_minimum_energy && with_plan)) {
    auto made = LeastEnergy::make(model, tables, request.value_of_time_w);
    if (!made) return tl::unexpected(made.error());
    least.emplace(std::move(*made));
  }

  if (request.minimum_energy) {
    const auto priced = least->price(forecast::typical_legs(forecaster, out.payload_kg), out.pace.pause_s);
    if (!priced) return tl::unexpected(priced.error());
    out.reach = forecast::reach(forecaster, Driving::stated, *robot.battery, out.charge,
                                forecast::sum_of(forecaster, Driving::stated, *priced));
  } else {
    const auto priced = forecast::price_typical(forecaster, pricer, out.pace, out.payload_kg);
    out.reach = forecast::reach(forecaster, out.driving, *robot.battery, out.charge,
                                forecast::sum_of(forecaster, out.driving, priced));
  }
  if (!with_plan) return out;

  std::optional<Pricing> best;
  if (least) {
    auto priced = at_least_energy(request, *least, out.pace.pause_s);
    if (priced)
      best = std::move(*priced);
    else if (request.minimum_energy)
      return tl::unexpected(priced.error());
  }
  const auto look = [&](const Pricing& priced, Driving driving) {
    return forecast::look_ahead(forecaster, driving, *robot.battery, out.charge, priced.tasks,
                                priced.from_here, pricer.standing_w(), request.confidence);
  };
  if (request.minimum_energy) {
    out.outlook = look(*best, Driving::stated);
    return out;
  }
  out.outlook = look(at_pace(request, pricer, forecaster.usual), out.driving);
  if (best) out.minimum_energy_outlook = look(*best, Driving::stated);
  return out;
}

std::string autonomy_json(const Autonomy& a, const AutonomyRequest& request,
                          const server::RobotOutlook& robot, const server::RobotSnapshot* live) {
  if (request.dialect != Dialect::joulecast) {
    return battery_dialect(
        request.dialect, battery_status(robot.model->robot.battery, *robot.battery, a.charge, a.reach, live));
  }
  const forecast::Forecaster& forecaster = *robot.forecaster;
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
  json.field("speed_m_s", a.pace.speed_m_s).field("acceleration_m_s2", a.pace.acceleration_m_s2);
  json.field("yaw_rate_rad_s", a.pace.yaw_rate_rad_s).field("pause_s", a.pace.pause_s).end_object();
  json.key("consumption").begin_object();
  json.field("basis", forecaster.missions > 0   ? "recent_missions"
                      : forecaster.siblings > 0 ? "siblings"
                                                : "model");
  json.field("missions", forecaster.missions).field("siblings", forecaster.siblings);
  json.field("energy_per_m_j", a.reach.energy_per_m_j).field("mean_power_w", a.reach.mean_power_w);
  const forecast::Forecaster::Track& track = forecaster.track(a.driving);
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
        .error_statuses = {404, 422},
        .run = http::Run::compute},
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
                   .error_statuses = {422},
                   .run = http::Run::compute},
                  answered_by([](Services& services, const http::Request& r) -> Result<http::Response> {
                    Result<std::string> answer = fleet_autonomy_answer(*r.json, services);
                    if (!answer) return tl::unexpected(std::move(answer.error()));
                    return http::json_response(std::move(*answer));
                  })});
  return rows;
}

}  // namespace joulecast::api

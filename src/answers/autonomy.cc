#include "answers/autonomy.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

#include "answers/least_energy.h"
#include "base/try.h"

namespace joulecast::answers {
namespace {

using forecast::Motion;
using forecast::PlannedLeg;
using forecast::PricedLeg;
using forecast::PricedTask;
using Track = forecast::Driving;

std::vector<PlannedLeg> to_charger(const std::optional<Charger>& charger, const planning::Pose& from,
                                   const std::optional<double>& distance_m, double payload_kg) {
  std::vector<PlannedLeg> legs;
  if (distance_m) {
    if (*distance_m > 0) legs.push_back({Motion::drive, *distance_m, 0, payload_kg, 0});
  } else if (charger) {
    const double dx = charger->at.x_m - from.x_m, dy = charger->at.y_m - from.y_m;
    const double turn =
        std::fabs(std::remainder(std::atan2(dy, dx) - from.heading_rad, 2 * std::numbers::pi));
    const double distance = std::hypot(dx, dy);
    if (distance > 0 && turn > 0) legs.push_back({Motion::turn, turn, 0, payload_kg, 0});
    if (distance > 0) legs.push_back({Motion::drive, distance * charger->detour_factor, 0, payload_kg, 0});
  } else {
    return legs;
  }
  // At the charger already: a charger is given, and the way there costs nothing.
  if (legs.empty()) legs.push_back({Motion::stand, 0, 0, payload_kg, 0});
  return legs;
}

// The task's legs; `pose` and `payload_kg` are advanced to its end. Beyond so many `knots` of all tasks,
// which take memory, curves count with their mean curvature.
Result<std::vector<PlannedLeg>> legs_of(const AutonomyTask& task, planning::Pose& pose, double& payload_kg,
                                        std::size_t& knots) {
  std::vector<PlannedLeg> legs;
  if (!task.way.path.empty()) {
    planning::PathOptions options;
    options.start = pose;
    options.payload_kg = payload_kg;
    TRY_ASSIGN(const planning::Path path, path_of(task.way, options));
    legs = forecast::planned_legs(path);
    for (PlannedLeg& leg : legs) {
      if (leg.run && (!task.way.placed || (knots += leg.run->knots.size()) > planning::most_rows))
        leg.run.reset();
    }
    payload_kg = path.final_payload_kg;
    if (!path.runs.empty()) pose = path.runs.back().knots.back().pose;
  }
  if (task.dwell_s.value_or(0) > 0) legs.push_back({Motion::stand, 0, 0, payload_kg, *task.dwell_s});
  return legs;
}

struct Pricing {
  std::vector<PricedTask> tasks;
  std::vector<PricedLeg> from_here;
};

Result<Pricing> as_usual(const AutonomyInput& input, const TaskPlan& plan, const forecast::LegPricer& pricer,
                         const forecast::Forecaster& forecaster) {
  std::optional<Error> stuck;
  const auto price = [&](const std::vector<PlannedLeg>& legs, const StatedPace& pace) {
    auto priced = forecast::price(forecaster, pricer, legs, pace, plan.halts_stated);
    if (!stuck) stuck = forecast::obstacle(pricer, legs, priced);
    return priced;
  };
  Pricing priced;
  priced.tasks.reserve(plan.tasks.size());
  for (std::size_t k = 0; k < plan.tasks.size(); ++k)
    priced.tasks.push_back(
        {price(plan.tasks[k].legs, input.tasks[k].pace), price(plan.tasks[k].to_charger, input.pace)});
  priced.from_here = price(plan.from_here, input.pace);
  if (stuck) return tl::unexpected(std::move(*stuck));
  return priced;
}

Result<Pricing> at_least_energy(const TaskPlan& plan, LeastEnergy& least) {
  Pricing priced;
  const auto add = [&](const std::vector<forecast::PlannedLeg>& legs,
                       std::vector<PricedLeg>& into) -> Result<void> {
    TRY_ASSIGN(into, least.price(legs));
    return {};
  };
  for (const TaskPlan::Task& task : plan.tasks) {
    PricedTask& into = priced.tasks.emplace_back();
    TRY(add(task.legs, into.legs));
    TRY(add(task.to_charger, into.to_charger));
  }
  TRY(add(plan.from_here, priced.from_here));
  return priced;
}

// By halving the logarithm of what a second costs, the standing robot's power included. `look` makes the
// outlook of a pricing.
template <class Look>
Result<std::optional<FastestDriving>> fastest_driving(const TaskPlan& plan, const ModelInForce& model,
                                                      planning::CostTableCache& tables, double confidence,
                                                      Look&& look, const std::stop_token& stop) {
  const double standing_w = std::max(model.drive.battery_power_for({0, 0}), 1e-3);
  double slow = std::log(standing_w), fast = std::log(standing_w + most_value_of_time_w);
  std::optional<FastestDriving> best;
  constexpr int tries = 16;  // both ends, and halves to 1e-3 of what a second costs
  for (int k = 0; k < tries; ++k) {
    const double x = k == 0 ? fast : k == 1 ? slow : 0.5 * (slow + fast);
    const double value_of_time_w = k == 1 ? 0 : std::exp(x) - standing_w;
    TRY_ASSIGN(auto least, LeastEnergy::make(model, tables, value_of_time_w, stop));
    TRY_ASSIGN(const auto priced, at_least_energy(plan, least));
    forecast::Outlook outlook = look(priced);
    const bool keeps = outlook.probability >= confidence;
    if (keeps) best = FastestDriving{value_of_time_w, std::move(outlook)};
    if (keeps ? k == 0 : k == 1) break;
    (keeps ? slow : fast) = x;
  }
  return best;
}

// Whether the request states the pace of every leg.
bool paces_stated(const AutonomyInput& input, const TaskPlan& plan) {
  const auto stated = [](const std::vector<PlannedLeg>& legs, const StatedPace& pace) {
    return std::ranges::all_of(legs, [&](const auto& leg) { return pace.cruise(leg.motion); });
  };
  if (plan.tasks.empty() && plan.from_here.empty()) return input.pace.cruise(Motion::drive);
  if (!stated(plan.from_here, input.pace)) return false;
  for (std::size_t k = 0; k < plan.tasks.size(); ++k) {
    if (!stated(plan.tasks[k].legs, input.tasks[k].pace) || !stated(plan.tasks[k].to_charger, input.pace))
      return false;
  }
  return true;
}

// Where the motors do not move the robot, or else do not reach the pace: of the whole request before those of
// its tasks.
std::optional<forecast::Limitation> limitation_of(const AutonomyInput& input, const TaskPlan& plan,
                                                  const forecast::LegPricer& pricer,
                                                  const RobotOutlook& robot, const AutonomyOutput& out) {
  const robot::RobotModel& model = robot.model->robot;
  auto limitation = forecast::limitation(pricer, model, out.pace, out.payload_kg);
  for (std::size_t k = 0; k < input.tasks.size() && (!limitation || limitation->moves); ++k) {
    auto of_task =
        forecast::limitation(pricer, model, robot.forecaster->habit.with(input.tasks[k].pace).middle,
                             plan.tasks[k].greatest_payload_kg);
    if (of_task && (!limitation || !of_task->moves)) limitation = std::move(of_task);
  }
  return limitation;
}

}  // namespace

Result<TaskPlan> task_plan(const AutonomyInput& input, const LiveRobot& now) {
  planning::Pose pose = input.start_pose.value_or(now.pose.value_or(planning::Pose{}));
  double payload_kg = input.payload_kg.value_or(now.payload_kg.value_or(0));
  TaskPlan plan;
  std::size_t knots = 0;
  plan.from_here = to_charger(input.charger, pose, input.to_charger_m, payload_kg);
  plan.tasks.reserve(input.tasks.size());
  for (std::size_t k = 0; k < input.tasks.size(); ++k) {
    const AutonomyTask& task = input.tasks[k];
    if (task.payload_kg && !task.way.stations) payload_kg = *task.payload_kg;
    auto legs = legs_of(task, pose, payload_kg, knots);
    if (!legs) {
      legs.error().field.insert(0, fmt::format("/tasks/{}", k));
      return tl::unexpected(std::move(legs.error()));
    }
    TaskPlan::Task& into = plan.tasks.emplace_back();
    into.legs = std::move(*legs);
    plan.halts_stated =
        plan.halts_stated || task.dwell_s || task.way.halts_stated() || forecast::states_halts(into.legs);
    for (const PlannedLeg& leg : into.legs)
      into.greatest_payload_kg = std::max(into.greatest_payload_kg, leg.payload_kg);
    into.to_charger = to_charger(input.charger, pose, task.to_charger_m, payload_kg);
  }
  return plan;
}

Result<forecast::Charge> charge_of(const std::optional<double>& given, const std::optional<double>& given_sd,
                                   const std::optional<double>& reserve, const robot::Battery& battery,
                                   const LiveRobot& now) {
  const double charge = given.value_or(now.state_of_charge);
  if (!std::isfinite(charge)) {
    return fail(Fault::infeasible, "/state_of_charge",
                "is unknown: the robot has never reported battery voltage and current; state it in the "
                "request");
  }
  const double live_sd = std::isfinite(now.state_of_charge_sd) ? now.state_of_charge_sd : 0;
  return forecast::Charge{charge, given_sd.value_or(given ? 0 : live_sd),
                          reserve.value_or(battery.reserve_fraction)};
}

Result<AutonomyOutput> autonomy(const AutonomyInput& input, const TaskPlan& plan, const RobotOutlook& robot,
                                const LiveRobot& now, planning::CostTableCache& tables,
                                const std::stop_token& stop) {
  const ModelInForce& model = *robot.model;
  const forecast::Forecaster& forecaster = *robot.forecaster;
  AutonomyOutput out;
  TRY_ASSIGN(const auto charge, charge_of(input.state_of_charge, input.state_of_charge_sd,
                                          input.reserve_fraction, model.robot.battery, now));
  out.charge = charge;
  out.charge_is_live = !input.state_of_charge;
  out.payload_kg = input.payload_kg.value_or(now.payload_kg.value_or(0));
  const double limit = model.robot.limits.payload_kg;
  const auto too_heavy = [&](const std::string& field, double payload_kg) {
    return invalid(field, fmt::format("is {}, must be at most the robot's limit of {}", payload_kg, limit));
  };
  if (input.payload_kg && *input.payload_kg > limit) return too_heavy("/payload_kg", *input.payload_kg);
  for (std::size_t k = 0; k < input.tasks.size(); ++k)
    if (plan.tasks[k].greatest_payload_kg > limit)
      return too_heavy(fmt::format("/tasks/{}/payload_kg", k), plan.tasks[k].greatest_payload_kg);

  const bool minimum_energy = input.driving == Driving::minimum_energy;
  out.track = minimum_energy || paces_stated(input, plan) ? Track::stated : Track::usual;
  out.pace = forecaster.habit.with(input.pace).middle;
  if (plan.halts_stated || minimum_energy) out.pace.pause_s = 0;

  const forecast::LegPricer pricer(model.robot, model.drive);
  out.limitation = limitation_of(input, plan, pricer, robot, out);
  const bool moves = !out.limitation || out.limitation->moves;
  const bool with_plan = moves && (!input.tasks.empty() || !plan.from_here.empty());
  std::optional<LeastEnergy> least;
  if (minimum_energy || (input.compare_minimum_energy && with_plan)) {
    TRY_ASSIGN(auto made, LeastEnergy::make(model, tables, input.value_of_time_w, stop));
    least.emplace(std::move(made));
  }

  std::vector<PricedLeg> typical;
  if (minimum_energy) {
    TRY_ASSIGN(typical, least->price(forecast::typical_legs(forecaster, out.payload_kg)));
  } else {
    typical = forecast::price_typical(forecaster, pricer, input.pace, out.payload_kg);
  }
  out.reach = forecast::reach(forecaster, *robot.battery, out.charge, forecast::sum_of(forecaster, typical));
  if (!with_plan) return out;

  std::optional<Pricing> best;
  if (least) {
    auto priced = at_least_energy(plan, *least);
    if (priced)
      best = std::move(*priced);
    else if (minimum_energy)
      return tl::unexpected(priced.error());
  }
  const auto look = [&](const Pricing& priced) {
    return forecast::look_ahead(forecaster, *robot.battery, out.charge, priced.tasks, priced.from_here,
                                pricer.standing_w(), input.confidence);
  };
  if (input.compare_fastest) {
    TRY_ASSIGN(out.fastest, fastest_driving(plan, model, tables, input.confidence, look, stop));
  }
  if (minimum_energy) {
    out.outlook = look(*best);
    return out;
  }
  TRY_ASSIGN(const auto usual, as_usual(input, plan, pricer, forecaster));
  out.outlook = look(usual);
  if (best) out.minimum_energy_outlook = look(*best);
  return out;
}

}  // namespace joulecast::answers

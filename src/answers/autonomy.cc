#include "answers/autonomy.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <memory>
#include <nlohmann/json.hpp>
#include <numbers>
#include <utility>

#include "answers/mission.h"
#include "base/try.h"

namespace joulecast::answers {
namespace {

using forecast::LegCost;
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
    legs = planned_legs(path);
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

// Prices legs driven as the planner would: minimum energy from stop to stop, within the robot's limits. In
// free time straight legs and turns come from the robot's cost table, which is made once for its model (some
// tenths of a second) and kept; curves, all legs where a second has its price, and those of paths where the
// floor has effects, are solved one by one, equal ones once. All end with an error when the token is set. Not
// thread-safe.
class LeastEnergy {
 public:
  static Result<LeastEnergy> make(const ModelInForce& model, planning::CostTableCache& tables,
                                  double value_of_time_w, const std::stop_token& stop) {
    LeastEnergy least(model, value_of_time_w, stop);
    if (!(value_of_time_w > 0)) {
      TRY_ASSIGN(least.table_, tables.get(model.robot, {}, stop));
    }
    return least;
  }
  // The planner's drives are followed by no halts but those among the legs. Error: a leg that cannot be
  // driven within the limits.
  Result<Pricing> price(const TaskPlan& plan) {
    Pricing priced;
    for (const TaskPlan::Task& task : plan.tasks) {
      PricedTask& into = priced.tasks.emplace_back();
      TRY_ASSIGN(into.legs, price(task.legs));
      TRY_ASSIGN(into.to_charger, price(task.to_charger));
    }
    TRY_ASSIGN(priced.from_here, price(plan.from_here));
    return priced;
  }
  Result<std::vector<PricedLeg>> price(const std::vector<PlannedLeg>& legs) {
    std::vector<PricedLeg> priced;
    priced.reserve(legs.size());
    for (const PlannedLeg& leg : legs) {
      TRY_ASSIGN(const LegCost best, cost(leg));
      priced.push_back({leg.motion, leg.payload_kg, leg.motion == Motion::drive ? leg.way : 0, best,
                        forecast::Driving::stated, false});
    }
    return priced;
  }

 private:
  struct Solved {
    PlannedLeg leg;
    planning::LegCost cost;
  };

  LeastEnergy(const ModelInForce& model, double value_of_time_w, std::stop_token stop)
      : model_(&model),
        standing_w_(model.drive.battery_power_for({0, 0})),
        value_of_time_w_(value_of_time_w),
        stop_(std::move(stop)) {
    const auto effects = dynamics::active_effects(model.robot);
    on_floor_ = effects && std::ranges::any_of(*effects, [](const dynamics::ActiveEffect& active) {
                  return active.effect->info().depends_on_place();
                });
  }

  Result<LegCost> cost(const PlannedLeg& leg) {
    if (leg.motion == Motion::stand || !(leg.way > 0))
      return LegCost{leg.duration_s, standing_w_ * leg.duration_s, 0, 0};
    planning::LegCost best;
    const bool in_table = table_ != nullptr && !(on_floor_ && leg.run);
    const bool straight = leg.run ? leg.run->straight() : leg.curvature_1_m == 0;
    if (in_table && leg.motion == Motion::turn && leg.way <= planning::widest_turn_rad) {
      best = table_->turn(leg.way, leg.payload_kg);
    } else if (in_table && leg.motion == Motion::drive && straight && leg.way <= planning::longest_leg_m) {
      best = table_->straight(leg.way, leg.payload_kg);
    } else {
      TRY_ASSIGN(best, solved(leg));
    }
    if (!std::isfinite(best.energy_j))
      return fail(Fault::infeasible, "/tasks",
                  "no motion of one of the legs keeps within the robot's limits");
    LegCost cost;
    cost.duration_s = best.duration_s;
    cost.standing_j = standing_w_ * best.duration_s;
    cost.motor_j = best.energy_j - cost.standing_j;
    const robot::Limits& limits = model_->robot.limits;
    const double limit = leg.motion == Motion::turn ? limits.yaw_rate_rad_s : limits.speed_m_s;
    constexpr double peak_over_mean = 1.25;  // between a parabola's 1.5 and a plateau's 1
    cost.speed_fraction = std::min(1.0, peak_over_mean * leg.way / best.duration_s / limit);
    return cost;
  }

  // Whether the planner's costs of two legs are equal wherever they begin.
  bool same(const PlannedLeg& a, const PlannedLeg& b) const {
    if (a.motion != b.motion || a.way != b.way || a.curvature_1_m != b.curvature_1_m ||
        a.payload_kg != b.payload_kg)
      return false;
    if (a.run == b.run || !a.run || !b.run) return a.run == b.run;
    return !on_floor_ && std::ranges::equal(a.run->knots, b.run->knots, [](const auto& k, const auto& l) {
      return k.way == l.way && k.curvature_1_m == l.curvature_1_m;
    });
  }

  Result<planning::LegCost> solved(const PlannedLeg& leg) {
    const auto known = [&](const Solved& other) { return same(other.leg, leg); };
    if (const auto found = std::ranges::find_if(solved_, known); found != solved_.end()) return found->cost;
    planning::Run run;
    if (leg.run) {
      run = *leg.run;
    } else {
      if (leg.motion == Motion::turn) run.turn = 1;
      run.knots = {{0, leg.curvature_1_m, {}}, {leg.way, leg.curvature_1_m, {}}};
    }
    planning::Problem problem;
    problem.limits = planning::limits_of(model_->robot);
    problem.value_of_time_w = value_of_time_w_;
    TRY_ASSIGN(const auto best, model_->planner.cost(std::move(run), leg.payload_kg, problem, stop_));
    solved_.push_back({leg, {best.energy_j, best.duration_s}});
    return solved_.back().cost;
  }

  std::shared_ptr<const planning::CostTable> table_;  // null where a second has its price
  const ModelInForce* model_;
  double standing_w_, value_of_time_w_;
  std::stop_token stop_;
  bool on_floor_ = false;  // effects of places and headings are in force
  std::vector<Solved> solved_;
};

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
    TRY_ASSIGN(const auto priced, least.price(plan));
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

// Where the motors do not move the robot, or do not reach the pace: of the whole request, then of its tasks.
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

using described::Input;

constexpr described::Count tasks_of_autonomy{0, 1000, "tasks"};
constexpr std::size_t max_id_bytes = 200;
constexpr Bounds payload_kg_bounds{.minimum = 0, .maximum = 1e6};
constexpr Bounds charger_way_m{.minimum = 0, .maximum = 1e6};
constexpr std::array<std::string_view, 7> what_to_do{"path",    "distances_m", "turns_rad", "pickup",
                                                     "dwell_s", "turn_rad",    "distance_m"};

// The members of the request that its tasks depend on.
struct AutonomyContext : PathContext {
  const AutonomyInput* input = nullptr;
  bool placed = true;  // the next task begins at a known place
};

const auto pace_input =
    Input<StatedPace>()
        .number("speed_m_s", &StatedPace::speed_m_s, positive,
                "stated cruise speed; if ramps are stated too, the forecast contains no halts after drives")
        .number("acceleration_m_s2", &StatedPace::acceleration_m_s2, positive,
                "acceleration of ramps in drives")
        .number("yaw_rate_rad_s", &StatedPace::yaw_rate_rad_s, positive, "cruise rate of turns in place")
        .number("yaw_acceleration_rad_s2", &StatedPace::yaw_acceleration_rad_s2, positive,
                "acceleration of ramps in turns in place");

void take_common_pace(Fields&, AutonomyTask& task, AutonomyContext& context) {
  for (const auto member : {&StatedPace::speed_m_s, &StatedPace::acceleration_m_s2,
                            &StatedPace::yaw_rate_rad_s, &StatedPace::yaw_acceleration_rad_s2})
    if (!(task.pace.*member)) task.pace.*member = context.input->pace.*member;
}

void check_charger(Fields& fields, AutonomyTask& task, AutonomyContext& context) {
  const AutonomyInput& input = *context.input;
  if (!task.to_charger_m && !input.charger && input.to_charger_m)
    fields.fault("to_charger_m", "is required for every task where the charger's place is not given");
  if (!task.to_charger_m && input.charger && !context.placed)
    fields.fault(
        "to_charger_m",
        "is required after a task that states distances without turns, which ends at no known place");
  if (task.to_charger_m && !input.charger && !input.to_charger_m)
    fields.fault("to_charger_m", "needs the charger's place or \"to_charger_m\" of the request");
}

void check_place(Fields& fields, AutonomyTask& task, AutonomyContext& context) {
  if (task.way.stations && !context.placed)
    fields.fault("pickup", "needs a known place to come from: a task before states distances without turns");
  context.placed = context.placed && task.way.placed;
}

void check_something_to_do(Fields& fields, AutonomyTask&, AutonomyContext&) {
  if (std::ranges::none_of(what_to_do, [&](std::string_view name) { return fields.has(name); }))
    fields.fault("path", fmt::format("is required where none of {} is given: a task drives or stands",
                                     fmt::join(what_to_do.begin() + 1, what_to_do.end(), ", ")));
}

const auto task_input =
    Input<AutonomyTask, AutonomyContext>(
        "A task of a list",
        "drive, then dwell; each task begins where the one before ended; a path, or distances and turns, "
        "or a pick-up and a drop-off, or dwell_s alone")
        .named("task")
        .text("task_id", &AutonomyTask::task_id, max_id_bytes, "the caller's name of the task", "")
        .number("payload_kg", &AutonomyTask::payload_kg, payload_kg_bounds,
                "carried from here on, absent: as before; with pickup, from there to dropoff, absent: none")
        .include(pace_input, &AutonomyTask::pace)
        .check(take_common_pace)
        .include(way_input(), &AutonomyTask::way)
        .include(former_way_input(), &AutonomyTask::way)
        .check(check_place)
        .number("dwell_s", &AutonomyTask::dwell_s, dwell_bounds_s,
                "time at rest at the end of the task. If any task states it, 0 included, the forecast "
                "contains no other halts")
        .number("to_charger_m", &AutonomyTask::to_charger_m, charger_way_m,
                "distance from this task's end to the charger; required where the charger's position is not "
                "given, and from a task on that states distances without turns, which ends at no known place")
        .check(check_charger)
        .finally(check_something_to_do);

const auto charger_input =
    Input<Charger>()
        .include(point_input<planning::Point>("place of the charger on the map"), &Charger::at)
        .number("detour_factor", &Charger::detour_factor, {.minimum = 1, .maximum = 100},
                "of the way to it over the straight line", 1);
const auto autonomy_input =
    Input<AutonomyRequest, AutonomyContext>(
        "Conditions of an autonomy forecast; with an empty object, those of the robot at present")
        .named("autonomy-request")
        .number("state_of_charge", AT(input.state_of_charge), fraction,
                "state of charge; default: the live one")
        .number("state_of_charge_sd", AT(input.state_of_charge_sd), {.minimum = 0, .maximum = 0.5},
                "standard deviation of state_of_charge")
        .number("reserve_fraction", AT(input.reserve_fraction), fraction,
                "charge to be left at the end; default: that of the robot file")
        .number("payload_kg", AT(input.payload_kg), payload_kg_bounds,
                "present payload; default: the live one, else 0")
        .choice("driving", AT(input.driving), driving_names,
                "driving model. usual: at the robot's own pace or the stated one, which predicts how long "
                "the charge lasts in operation; minimum_energy: along the planner's profiles",
                static_cast<std::size_t>(Driving::usual))
        .boolean(
            "compare_minimum_energy",
            [](AutonomyRequest& request, std::optional<bool> given) {
              bool& compare = request.input.compare_minimum_energy;
              compare = given.value_or(compare) && request.input.driving == Driving::usual;
            },
            "report what minimum-energy profiles would change; default true for one robot, false for a "
            "fleet")
        .boolean("compare_fastest", AT(input.compare_fastest),
                 "report the fastest minimum-energy profiles with which the plan ends with the reserve at "
                 "the probability confidence",
                 false)
        .number("value_of_time_w", AT(input.value_of_time_w), value_of_time_bounds_w,
                "value of time in minimum-energy profiles, W; the time_multiplier_w of a profile's "
                "certificate, with or without a deadline, reproduces that profile",
                0)
        .include(pace_input, AT(input.pace))
        .number("confidence", AT(input.confidence), {.minimum = 0.01, .maximum = 0.999},
                "probability for the latest departure", 0.95)
        .choice("dialect", &AutonomyRequest::dialect, dialect_names,
                "format of the response: that of this service or a battery message of another standard",
                static_cast<std::size_t>(Dialect::joulecast))
        .object("start_pose", AT(input.start_pose),
                "start of the tasks; default: the robot's position, else the origin", pose_input())
        .object("charger", AT(input.charger),
                "charger at which the plan ends: reached by a turn and a straight line, its length times "
                "detour_factor",
                charger_input)
        .number("to_charger_m", AT(input.to_charger_m), charger_way_m,
                "distance from the start to the charger, if its position is not given")
        .check([](Fields&, AutonomyRequest& request, AutonomyContext& context) {
          context.input = &request.input;
        })
        .list("tasks", AT(input.tasks), tasks_of_autonomy,
              "tasks in the order of execution; null or absent: no task forecast", task_input,
              described::Presence::optional);

using described::Table;
using forecast::Outlook;
using forecast::TaskOutlook;

const auto stage_table =
    Table<TaskOutlook>()
        .number_or_null("expected_energy_j", AT(mean_j),
                        "mean energy of this leg; the legs add up to the whole")
        .number_or_null("ends_after_s", AT(duration_s), "expected time from now to its end")
        .number_or_null("success_probability", AT(probability),
                        "probability that the reserve is not used until its end")
        .object("energy_since_start_j", AT(energy_j), "energy from now at the quantiles 5, 50 and 95 %",
                quantiles_table())
        .object("arrival_charge", AT(charge), "charge when it ends at the quantiles 5, 50 and 95 %",
                quantiles_table());

struct PlannedTask {
  const TaskOutlook& stage;
  const std::string& task_id;
};

// A task; its members are null for the way to the charger.
struct Place {
  std::optional<std::size_t> task;
  std::optional<std::string> task_id;
};

struct LatestDeparture {
  const forecast::Departure& leave;
  double confidence;
};

struct PlanAnswer {
  const Outlook& outlook;
  const AutonomyInput& input;
};

std::vector<PlannedTask> planned_tasks(const PlanAnswer& plan) {
  std::vector<PlannedTask> tasks;
  for (std::size_t k = 0; k < plan.outlook.tasks.size(); ++k)
    tasks.push_back({plan.outlook.tasks[k], plan.input.tasks[k].task_id});
  return tasks;
}

auto place(std::optional<std::size_t> Outlook::*member) {
  return [member](const PlanAnswer& plan) -> std::optional<Place> {
    const std::optional<std::size_t>& index = plan.outlook.*member;
    if (!index) return std::nullopt;
    if (*index >= plan.input.tasks.size()) return Place{};
    return Place{*index, plan.input.tasks[*index].task_id};
  };
}

std::optional<LatestDeparture> latest_departure(const PlanAnswer& plan) {
  if (!plan.outlook.latest_departure) return std::nullopt;
  return LatestDeparture{*plan.outlook.latest_departure, plan.input.confidence};
}

const auto departure_table =
    Table<LatestDeparture>()
        .value("after_tasks", AT(leave.after_tasks),
               "number of tasks before the departure; 0: immediate departure")
        .number_or_null("at_s", AT(leave.at_s), "expected time from now when they are done")
        .number_or_null("wait_s", AT(leave.wait_s), "permitted waiting time there")
        .number_or_null(
            "latest_s", [](const LatestDeparture& d) { return d.leave.at_s + d.leave.wait_s; },
            "at_s + wait_s")
        .number_or_null("probability", AT(leave.probability),
                        "probability of reaching the charger with the reserve when leaving at at_s")
        .number_or_null("confidence", AT(confidence), "as requested");
const auto leg_table = Table<PlannedTask>()
                           .value("task_id", AT(task_id), "the caller's name of the task")
                           .include(stage_table, AT(stage));
const auto place_table = Table<Place>()
                             .value("task", AT(task), "index into tasks; null: the way to the charger")
                             .value("task_id", AT(task_id), "null: the way to the charger");
const auto plan_table =
    Table<PlanAnswer>()
        .number_or_null("success_probability", AT(outlook.probability),
                        "probability of finishing all tasks and reaching the charger with the reserve")
        .number_or_null("expected_energy_j", AT(outlook.mean_j), "mean total energy, the sum over the legs")
        .number_or_null("duration_s", AT(outlook.duration_s[1]), "median")
        .object("energy_j", AT(outlook.energy_j), "total energy at the quantiles 5, 50 and 95 %",
                quantiles_table())
        .object(
            "duration_quantiles_s", AT(outlook.duration_s),
            "total duration at the quantiles 5, 50 and 95 %; all equal if the plan states the pace and all "
            "dwells",
            quantiles_table())
        .list("legs", planned_tasks, "one per task", leg_table)
        .object("charger", AT(outlook.charger), "the way to the charger after the last task", stage_table)
        .object("fails_at", place(&Outlook::fails_at),
                "first task at which use of the reserve is more likely than not; null: none", place_table)
        .object("likeliest_failure", place(&Outlook::likeliest_failure),
                "task at which use of the reserve most likely begins; null: none", place_table)
        .object("latest_departure", latest_departure,
                "last moment to leave for the charger; null: no charger given, or too late already",
                departure_table);

Quantiles charge_at_end(const Outlook& outlook) {
  constexpr double none = std::numeric_limits<double>::quiet_NaN();
  return outlook.charger         ? outlook.charger->charge
         : outlook.tasks.empty() ? Quantiles{none, none, none}
                                 : outlook.tasks.back().charge;
}

const auto end_table =
    Table<Outlook>()
        .number_or_null("success_probability", AT(probability), "probability that the charge lasts")
        .number_or_null("expected_energy_j", AT(mean_j), "mean energy, the sum over the legs")
        .number_or_null("duration_s", AT(duration_s[1]), "of the tasks")
        .object("arrival_charge", charge_at_end, "charge at the end at the quantiles 5, 50 and 95 %",
                quantiles_table());

struct AutonomyAnswer {
  const AutonomyRequest& request;
  const AutonomyOutput& output;
  const RobotOutlook& robot;
  const LiveRobot& now;

  // For what is known of the live charge only.
  LiveRobot charging() const { return output.charge_is_live ? now : LiveRobot{}; }
  const forecast::Pace& pace() const {
    const bool reached = output.limitation && request.input.driving != Driving::minimum_energy;
    return reached ? output.limitation->reached : output.pace;
  }
  const forecast::Forecaster& forecaster() const { return *robot.forecaster; }
  const forecast::Forecaster::Track& track() const {
    const bool stated = output.track == forecast::Driving::stated;
    return forecaster().track(stated ? forecast::Subject::stated_energy : forecast::Subject::usual_energy);
  }
};

std::optional<std::string_view> charging_phase(const AutonomyAnswer& a) {
  const battery::ChargingPhase phase = a.charging().charging;
  return battery::at_charger(phase) ? std::optional(battery::name(phase)) : std::nullopt;
}

std::string_view driven(const AutonomyAnswer& a) {
  if (a.request.input.driving == Driving::minimum_energy) return "minimum_energy";
  return a.output.track == forecast::Driving::stated ? "stated" : "usual";
}

std::string_view basis(const AutonomyAnswer& a) {
  const forecast::Forecaster& forecaster = a.forecaster();
  return forecaster.missions > 0 ? "recent_missions" : forecaster.siblings > 0 ? "siblings" : "model";
}

const auto pace_table =
    Table<AutonomyAnswer>()
        .number_or_null("speed_m_s", AT(pace().speed_m_s), "forward speed; negative: backwards")
        .number_or_null("acceleration_m_s2", AT(pace().acceleration_m_s2), "forward acceleration")
        .number_or_null("yaw_rate_rad_s", AT(pace().yaw_rate_rad_s), "rate of turning, positive to the left")
        .number_or_null("pause_s", AT(pace().pause_s),
                        "mean time at rest after a leg, with 0 for legs without a halt")
        .value(
            "limitation",
            [](const AutonomyAnswer& a) {
              return a.output.limitation ? std::optional(a.output.limitation->sentence) : std::nullopt;
            },
            "sentence present if the motors, within the robot's current limit and its battery's nominal "
            "voltage, do not reach the pace; the other members then contain the pace that they reach, or "
            "0, without range and plan, if they cannot move the robot");

const auto consumption_table =
    Table<AutonomyAnswer>()
        .word("basis", basis, std::array{"recent_missions", "siblings", "model"},
              "data on which the forecast is based")
        .value("missions", AT(forecaster().missions), "number of this robot's missions used for the forecast")
        .value("siblings", AT(forecaster().siblings),
               "number of robots with equal body and motors used for the forecast")
        .value("siblings_pending", AT(robot.siblings_pending),
               "the daemon has started and still reads missions of its siblings: the forecast will improve")
        .number_or_null("energy_per_m_j", AT(output.reach.energy_per_m_j),
                        "median consumption over the range: usable_energy_j / range_m")
        .number_or_null("mean_power_w", AT(output.reach.mean_power_w),
                        "median power over the run time: usable_energy_j / run_time_s")
        .number_or_null(
            "common_deviation",
            [](const AutonomyAnswer& a) { return a.track().inflation * a.track().common; },
            "relative standard deviation that all legs of a mission share")
        .number_or_null(
            "leg_deviation",
            [](const AutonomyAnswer& a) {
              return a.track().inflation *
                     a.track().scatter[static_cast<std::size_t>(forecast::Motion::drive)];
            },
            "relative standard deviation of each driven leg, independent of the other legs");

// Under the model in force.
std::optional<drift::Mark> drift_of(const AutonomyAnswer& a) {
  const std::optional<drift::Mark>& change = a.forecaster().change;
  return change && change->model_version == a.robot.model->version ? change : std::nullopt;
}

// The same plan in another driving, and the difference.
struct Comparison {
  const Outlook& best;
  const Outlook& usual;
};

std::optional<Comparison> minimum_energy(const AutonomyAnswer& a) {
  if (!a.output.minimum_energy_outlook || !a.output.outlook) return std::nullopt;
  return Comparison{*a.output.minimum_energy_outlook, *a.output.outlook};
}

const auto comparison_table =
    Table<Comparison>()
        .include(end_table, AT(best))
        .number_or_null(
            "saved_j", [](const Comparison& c) { return c.usual.mean_j - c.best.mean_j; },
            "energy saved compared with usual driving")
        .number_or_null(
            "saved_s", [](const Comparison& c) { return c.usual.duration_s[1] - c.best.duration_s[1]; },
            "time saved; negative: longer duration");

const auto fastest_table =
    Table<FastestDriving>()
        .value("value_of_time_w", AT(value_of_time_w),
               "value of time with which profiles and estimates reproduce this driving")
        .include(end_table, AT(outlook));
const auto autonomy_table =
    Table<AutonomyAnswer>("Remaining range and run time of a robot")
        .named("robot-autonomy")
        .include(model_table(), [](const AutonomyAnswer& a) -> const ModelInForce& { return *a.robot.model; })
        .value("state_of_charge", AT(output.charge.fraction), "state of charge of the forecast, 0 to 1")
        .number_or_null("state_of_charge_sd", AT(output.charge.deviation),
                        "standard deviation; 0 if not available")
        .text_or_null(
            "state_of_charge_limitation",
            [](const AutonomyAnswer& a) { return a.charging().charge_limitation; },
            "why the standard deviation is large, as a sentence; null: no such reason, or the request "
            "states the charge")
        .value("reserve_fraction", AT(output.charge.reserve), "reserved share of the charge")
        .word("charging", charging_phase, std::array{"constant_current", "taper", "full"},
              "present charging phase; null: not charging, or the request states the charge")
        .number_or_null(
            "time_to_charged_s", [](const AutonomyAnswer& a) { return a.charging().to_full.duration_s; },
            "time until the end of charging, if charging starts now; null: its charging current is "
            "unknown, or the request states the charge")
        .number_or_null(
            "time_to_charged_sd_s", [](const AutonomyAnswer& a) { return a.charging().to_full.sd_s; },
            "standard deviation of time_to_charged_s")
        .number_or_null("usable_energy_j", AT(output.reach.usable_j),
                        "energy at the terminals above the reserve and the cut-off voltage")
        .number_or_null("usable_energy_sd_j", AT(output.reach.usable_deviation_j),
                        "standard deviation of usable_energy_j")
        .number_or_null("payload_kg", AT(output.payload_kg), "payload of the forecast")
        .word("driving", driven, std::array{"usual", "stated", "minimum_energy"},
              "stated: at the pace of the request")
        .object("pace", std::identity(), "usual driving of the robot; null: not available", pace_table)
        .object("consumption", std::identity(), "expected consumption", consumption_table)
        .number_or_null("range_m", AT(output.reach.range_m[1]), "median")
        .number_or_null("run_time_s", AT(output.reach.run_time_s[1]), "median")
        .object("range_quantiles_m", AT(output.reach.range_m),
                "remaining range with driving as in its recent legs; at the quantiles 5, 50 and 95 %",
                quantiles_table())
        .object("run_time_quantiles_s", AT(output.reach.run_time_s),
                "remaining run time; at the quantiles 5, 50 and 95 %", quantiles_table())
        .object("drift", drift_of,
                "the last change of the robot under this model, as in its gap history; null: none",
                mark_table())
        .object(
            "plan",
            [](const AutonomyAnswer& a) -> std::optional<PlanAnswer> {
              if (!a.output.outlook) return std::nullopt;
              return PlanAnswer{*a.output.outlook, a.request.input};
            },
            "null without tasks and charger", plan_table)
        .object("minimum_energy", minimum_energy,
                "the same plan driven by minimum-energy profiles; null: not requested, or no such profile "
                "exists",
                comparison_table)
        .object("fastest", AT(output.fastest),
                "the plan driven as fast as the reserve allows with at least the requested confidence; null: "
                "not requested, or even minimum-energy profiles do not keep it",
                fastest_table);

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
  if (!std::isfinite(charge))
    return fail(Fault::infeasible, "/state_of_charge",
                "is unknown: the robot has never reported battery voltage and current; state it in the "
                "request");
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
  const described::Limit limit{model.robot.limits.payload_kg, payload_limit_member};
  if (input.payload_kg > limit.value)
    return invalid("/payload_kg", described::above(*input.payload_kg, limit));
  for (std::size_t k = 0; k < input.tasks.size(); ++k)
    if (const double payload_kg = plan.tasks[k].greatest_payload_kg; payload_kg > limit.value)
      return invalid(fmt::format("/tasks/{}/payload_kg", k), described::above(payload_kg, limit));

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

  forecast::TypicalDriving typical;
  if (minimum_energy) {
    TRY_ASSIGN(auto legs, least->price(forecast::typical_legs(forecaster, out.payload_kg)));
    typical = forecast::typical_driving(forecaster, std::move(legs));
  } else {
    typical = forecast::typical_driving(forecaster, pricer, input.pace, out.payload_kg);
  }
  out.reach = forecast::reach(forecaster, *robot.battery, out.charge, typical);
  if (!with_plan) return out;

  std::optional<Pricing> best;
  if (least) {
    auto priced = least->price(plan);
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

bool AutonomyRequest::former() const {
  return std::ranges::any_of(input.tasks, AT(way.former));
}

described::Schemas autonomy_schemas() {
  described::Schema task = task_input.schema();
  for (const std::string_view name : what_to_do) task["anyOf"].push_back({{"required", {name}}});
  const described::Schema any{
      {"title", "Remaining range and run time of a robot, and feasibility of a list of tasks"},
      {"anyOf", {autonomy_table.of_member(), described::of_reference("battery-status")}}};
  return {{"autonomy-request", autonomy_input.schema()},
          {"task", std::move(task)},
          {"autonomy", any},
          {"battery-status", battery_status_schema()},
          {"robot-autonomy", autonomy_table.schema()}};
}

Result<AutonomyRequest> read_autonomy(const nlohmann::json& body, bool single, const std::string& at) {
  AutonomyRequest request;
  request.input.compare_minimum_energy = single;
  AutonomyContext context;
  context.may_stand = true;
  return autonomy_input.read(body, std::move(request), context, at);
}

std::string autonomy_json(const AutonomyRequest& request, const AutonomyOutput& a, const RobotOutlook& robot,
                          const LiveRobot& now) {
  if (request.dialect != Dialect::joulecast)
    return battery_dialect(
        request.dialect, battery_status(robot.model->robot.battery, *robot.battery, a.charge, a.reach, now));
  return autonomy_table.text({request, a, robot, now});
}

Result<std::string> autonomy_text(const AutonomyRequest& request, const RobotOutlook& robot,
                                  const LiveRobot& now, planning::CostTableCache& tables,
                                  const std::stop_token& stop) {
  TRY_ASSIGN(const auto plan, task_plan(request.input, now));
  TRY_ASSIGN(const auto output, autonomy(request.input, plan, robot, now, tables, stop));
  return autonomy_json(request, output, robot, now);
}

Result<std::string> autonomy_answer(const nlohmann::json& request, const RobotOutlook& robot,
                                    const LiveRobot& now, planning::CostTableCache& tables) {
  TRY_ASSIGN(const AutonomyRequest read, read_autonomy(request, true));
  return autonomy_text(read, robot, now, tables);
}

}  // namespace joulecast::answers

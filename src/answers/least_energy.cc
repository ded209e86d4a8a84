#include "answers/least_energy.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "base/try.h"

namespace joulecast::answers {

using forecast::LegCost;
using forecast::Motion;
using forecast::PlannedLeg;
using forecast::PricedLeg;

LeastEnergy::LeastEnergy(std::shared_ptr<const planning::CostTable> table, const ModelInForce& model,
                         double value_of_time_w, std::stop_token stop)
    : table_(std::move(table)),
      model_(&model),
      standing_w_(model.drive.battery_power_for({0, 0})),
      value_of_time_w_(value_of_time_w),
      stop_(std::move(stop)) {
  const auto effects = dynamics::active_effects(model.robot);
  on_floor_ = effects && std::ranges::any_of(*effects, [](const dynamics::ActiveEffect& active) {
                return active.effect->info().depends_on_place();
              });
}

Result<LeastEnergy> LeastEnergy::make(const ModelInForce& model, planning::CostTableCache& tables,
                                      double value_of_time_w, std::stop_token stop) {
  if (value_of_time_w > 0) return LeastEnergy(nullptr, model, value_of_time_w, std::move(stop));
  TRY_ASSIGN(auto table, tables.get(model.robot, {}, stop));
  return LeastEnergy(std::move(table), model, 0, std::move(stop));
}

// Whether the planner's costs of two legs are equal wherever they begin.
bool LeastEnergy::same(const PlannedLeg& a, const PlannedLeg& b) const {
  if (a.motion != b.motion || a.way != b.way || a.curvature_1_m != b.curvature_1_m ||
      a.payload_kg != b.payload_kg)
    return false;
  if (a.run == b.run || !a.run || !b.run) return a.run == b.run;
  return !on_floor_ && std::ranges::equal(a.run->knots, b.run->knots, [](const auto& k, const auto& l) {
    return k.way == l.way && k.curvature_1_m == l.curvature_1_m;
  });
}

Result<planning::LegCost> LeastEnergy::solved(const PlannedLeg& leg) {
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

Result<LegCost> LeastEnergy::cost(const PlannedLeg& leg) {
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
    return fail(Fault::infeasible, "/tasks", "no motion of one of the legs keeps within the robot's limits");
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

Result<std::vector<PricedLeg>> LeastEnergy::price(const std::vector<PlannedLeg>& legs) {
  std::vector<PricedLeg> priced;
  priced.reserve(legs.size());
  for (const PlannedLeg& leg : legs) {
    TRY_ASSIGN(const LegCost best, cost(leg));
    priced.push_back({leg.motion, leg.payload_kg, leg.motion == Motion::drive ? leg.way : 0, best,
                      forecast::Driving::stated, false});
  }
  return priced;
}

}  // namespace joulecast::answers

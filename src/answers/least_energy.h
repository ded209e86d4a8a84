#pragma once

#include <memory>
#include <stop_token>
#include <vector>

#include "answers/model.h"
#include "forecast/outlook.h"
#include "planning/cost_table.h"

namespace joulecast::answers {

// Prices legs driven as the planner would: minimum energy from stop to stop, within the robot's limits. In
// free time straight legs and turns come from the robot's cost table, which is made once for its model (some
// tenths of a second) and kept; curves, all legs where a second has its price, and those of paths where the
// floor has effects, are solved one by one, equal ones once. Not thread-safe.
class LeastEnergy {
 public:
  static Result<LeastEnergy> make(const ModelInForce& model, planning::CostTableCache& tables,
                                  double value_of_time_w = 0, std::stop_token stop = {});

  // Both end with an error when the token is set. The planner's drives are followed by no halts but those
  // among the legs. Error: a leg that cannot be driven within the limits.
  Result<std::vector<forecast::PricedLeg>> price(const std::vector<forecast::PlannedLeg>& legs);

 private:
  struct Solved {
    forecast::PlannedLeg leg;
    planning::LegCost cost;
  };
  LeastEnergy(std::shared_ptr<const planning::CostTable> table, const ModelInForce& model,
              double value_of_time_w, std::stop_token stop);
  Result<forecast::LegCost> cost(const forecast::PlannedLeg& leg);
  bool same(const forecast::PlannedLeg& a, const forecast::PlannedLeg& b) const;
  Result<planning::LegCost> solved(const forecast::PlannedLeg& leg);

  std::shared_ptr<const planning::CostTable> table_;  // null where a second has its price
  const ModelInForce* model_;
  double standing_w_, value_of_time_w_;
  std::stop_token stop_;
  bool on_floor_ = false;  // effects of places and headings are in force
  std::vector<Solved> solved_;
};

}  // namespace joulecast::answers

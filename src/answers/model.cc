#include "answers/model.h"

#include <utility>

#include "base/try.h"

namespace joulecast::answers {

Result<std::shared_ptr<const ModelInForce>> model_in_force(robot::RobotModel robot, std::int64_t version) {
  TRY_ASSIGN(dynamics::DriveModel drive, dynamics::drive_model(robot));
  TRY_ASSIGN(planning::Planner planner, planning::Planner::make(robot));
  return std::make_shared<const ModelInForce>(
      ModelInForce{std::move(robot), std::move(drive), version, std::move(planner)});
}

std::shared_ptr<const forecast::ChargeMap> charge_map(const robot::Battery& battery) {
  return std::make_shared<const forecast::ChargeMap>(battery::Circuit(battery));
}

RobotOutlook untried(std::shared_ptr<const ModelInForce> model) {
  const forecast::RobotForecast forecast(model->robot, model->drive);
  auto battery = charge_map(model->robot.battery);
  return {std::move(model), forecast.forecaster(), std::move(battery)};
}

}  // namespace joulecast::answers

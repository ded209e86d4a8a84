#pragma once

#include <span>
#include <string_view>
#include <vector>

#include "gap/equations/channels.h"
#include "gap/posterior/catalogue.h"
#include "gap/verdict/diagnosis.h"
#include "tests/plausibility/made_recordings.h"

namespace joulecast::gap::made {

using namespace joulecast::made;

// A robot's drives with the battery power of the model. Motors are not measured.
class Drives {
 public:
  Drives() {
    const auto readings = windows::find_readings(robot_.recordings.missions);
    windows_ = windows::make_windows(robot_.recordings.missions, robot_.model, readings);
    const dynamics::DriveModel model(robot_.model, {});
    for (Window& w : windows_) w.battery_power_w = metered_powers(model, w).battery_w;
  }

  const robot::RobotModel& robot() const { return robot_.model; }
  const std::vector<Window>& windows() const { return windows_; }

 private:
  Robot robot_ = joulecast::made::virtual_robot(
      "nomad", 41, [](vr::SimulationSpec& spec) { spec.sensors.motor_channels = false; });
  std::vector<Window> windows_;
};

inline Cause cause(std::string_view id, double strength) {
  Cause c;
  c.effect.effect = dynamics::find_effect(id);
  for (std::size_t k = 0; k < c.effect.effect->info().parameters.size(); ++k)
    c.effect.values[k] = c.effect.effect->info().parameters[k].initial;
  c.effect.values[0] = strength;
  return c;
}

}  // namespace joulecast::gap::made

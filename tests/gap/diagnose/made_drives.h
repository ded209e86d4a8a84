#pragma once

#include <span>
#include <string_view>
#include <vector>

#include "gap/diagnose/fit.h"
#include "gap/equations/power.h"
#include "gap/verdict/diagnosis.h"
#include "tests/gap/checks/made_recordings.h"

namespace joulecast::gap::made {

// A robot's drives whose battery power is what the model with known causes gives for them, and nothing else
// is measured: what a fit has to find is known to the last digit.
class Drives {
 public:
  explicit Drives(std::vector<Cause> causes) : truth(std::move(causes)) {
    const auto readings = windows::find_readings(robot_.recordings.missions);
    windows_ = windows::make_windows(robot_.recordings.missions, robot_.model, readings);
    blocks_ = windows::assign_blocks(windows_, robot_.recordings.missions);
    power_w = modelled_power(robot_.model, {}, truth, windows_);
    set_power();
  }

  // Every twelfth reading is far off.
  void throw_readings() {
    for (std::size_t k = 0; k < power_w.size(); k += 12) power_w[k] += 300;
    set_power();
  }

  Material material() const {
    return {robot_.model, {}, windows_, blocks_, {.power = true, .voltage = false}, 0.04};
  }
  double gap(const std::vector<Cause>& causes) const {
    return gap_size(power_w, modelled_power(robot_.model, {}, causes, windows_)).absolute_relative;
  }

  std::vector<Cause> truth;
  std::vector<double> power_w;

 private:
  void set_power() {
    for (std::size_t k = 0; k < windows_.size(); ++k) windows_[k].battery_power_w = power_w[k];
  }

  Robot robot_ =
      virtual_robot("nomad", 41, [](vr::SimulationSpec& spec) { spec.sensors.motor_channels = false; });
  std::vector<Window> windows_;
  std::size_t blocks_ = 0;
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

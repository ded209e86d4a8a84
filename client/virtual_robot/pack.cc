#include "client/virtual_robot/pack.h"

#include <algorithm>
#include <cmath>

namespace joulecast::virtual_robot {
namespace {

constexpr double branch_fraction = 0.25;  // of the ohmic resistance
constexpr double branch_time_s = 35;

// Over the nominal voltage; a blend of the flat middle of iron phosphate and the slope of lead.
const std::vector<std::pair<double, double>> relative_curve{{0.0, 0.84},  {0.05, 0.92}, {0.15, 0.965},
                                                            {0.35, 0.99}, {0.6, 1.01},  {0.8, 1.03},
                                                            {0.95, 1.05}, {1.0, 1.08}};

}  // namespace

Pack::Pack(const RobotParameters& robot, double resistance_error, double state_of_charge)
    : curve_(robot.open_circuit_voltage),
      resistance_ohm_(robot.internal_resistance_ohm * (1 + resistance_error)),
      branch_resistance_ohm_(branch_fraction * resistance_ohm_),
      capacity_c_(3600 * robot.capacity_ah),
      charge_(state_of_charge) {
  if (curve_.empty()) {
    curve_ = relative_curve;
    for (auto& point : curve_) point.second *= robot.nominal_voltage_v;
  }
}

double Pack::open_circuit_voltage_v() const {
  const auto above =
      std::find_if(curve_.begin(), curve_.end(), [&](const auto& point) { return point.first >= charge_; });
  if (above == curve_.begin()) return curve_.front().second;
  if (above == curve_.end()) return curve_.back().second;
  const auto below = above - 1;
  const double share = (charge_ - below->first) / (above->first - below->first);
  return below->second + share * (above->second - below->second);
}

Pack::Terminals Pack::terminals(double power_w) const {
  const double source_v = open_circuit_voltage_v() - branch_v_;
  // power = (source - R i) i; the smaller root, written so that R = 0 is no special case.
  const double root = std::sqrt(std::max(0.0, source_v * source_v - 4 * resistance_ohm_ * power_w));
  const double current_a = 2 * power_w / (source_v + root);
  return {source_v - resistance_ohm_ * current_a, current_a};
}

double Pack::charging_power_w(double most_current_a, double most_voltage_v) const {
  const double source_v = open_circuit_voltage_v() - branch_v_;
  const double resistance_ohm = std::max(resistance_ohm_, 1e-6);
  const double current_a = std::clamp((most_voltage_v - source_v) / resistance_ohm, 0.0, most_current_a);
  return -current_a * (source_v + resistance_ohm_ * current_a);
}

void Pack::advance(double power_w, double step_s) {
  const double current_a = terminals(power_w).current_a;
  charge_ = std::clamp(charge_ - current_a * step_s / capacity_c_, 0.0, 1.0);
  branch_v_ += (branch_resistance_ohm_ * current_a - branch_v_) * -std::expm1(-step_s / branch_time_s);
}

}  // namespace joulecast::virtual_robot

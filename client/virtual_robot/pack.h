#pragma once

#include <utility>
#include <vector>

#include "client/virtual_robot/robot_parameters.h"

namespace joulecast::virtual_robot {

// Battery: open-circuit voltage by charge, ohmic resistance and one resistor-capacitor branch for the slow
// sag.
class Pack {
 public:
  // resistance_error: fraction by which both resistances exceed the file's.
  Pack(const RobotParameters& robot, double resistance_error, double state_of_charge);

  // Draw power_w (negative: charge) for a time step.
  void advance(double power_w, double step_s);

  // Terminal current and voltage while power_w is drawn. A demand beyond the pack's greatest power draws the
  // current of the greatest power.
  struct Terminals {
    double voltage_v;
    double current_a;
  };
  Terminals terminals(double power_w) const;

  // The power (negative) with which a charger of this greatest current and terminal voltage charges.
  double charging_power_w(double most_current_a, double most_voltage_v) const;

  double open_circuit_voltage_v() const;
  double full_voltage_v() const { return curve_.back().second; }  // at rest
  double capacity_ah() const { return capacity_c_ / 3600; }
  double state_of_charge() const { return charge_; }
  void exchange() { charge_ = exchanged_charge, branch_v_ = 0; }

  static constexpr double exchanged_charge = 0.95;

 private:
  std::vector<std::pair<double, double>> curve_;
  double resistance_ohm_;
  double branch_resistance_ohm_;
  double capacity_c_;
  double charge_;
  double branch_v_ = 0;
};

}  // namespace joulecast::virtual_robot

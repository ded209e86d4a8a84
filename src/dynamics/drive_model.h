#pragma once

#include <array>
#include <vector>

#include "base/error.h"
#include "dynamics/catalogue.h"
#include "dynamics/motion.h"
#include "robot/robot_model.h"
#include "signals/ledger.h"

namespace joulecast::dynamics {

// True power flows of one instant, before any sensor. Watts; out of the battery is positive.
template <class S>
struct PowerFlow {
  std::array<S, 2> torque_nm{};  // at the wheel, delivered by the motor
  std::array<S, 2> current_a{};
  std::array<S, 2> voltage_v{};
  std::array<S, 2> motor_power_w{};  // negative while braking regenerates
  S battery_power_w = 0;             // at the battery terminals
  // Where it goes; adds up to battery_power_w. Without `sensor` and `unexplained`, which are not physical.
  signals::BasicLedger<S> ledger;
};

// The torque balance of both wheels at one instant.
template <class S>
struct TorqueBalance {
  Body<S> body;
  std::array<S, 2> inertial_nm{};  // accelerating the body and the wheels
  std::array<S, 2> gear_nm{};      // gear loss
  std::array<S, 2> friction_nm{};  // T_m sgn(w) + nu w
  Loads<S> loads;
  std::array<S, 2> transmitted_nm{}, inside_nm{};  // inertia and loads, through the gear and in the motor
  std::array<S, 2> total_nm{};                     // the motor's torque at the wheel
};

// The drive of one robot: motion -> torque -> current -> voltage -> power, with the effects in force. Thesis,
// chapter 2: load torque tau = r F/2 +- c N + I_w alpha, motor K_t n i = I_s alpha + nu w + T_m sgn(w) + tau,
// V = R i + K_w n w. S is double, or Dual to differentiate with respect to one parameter of one effect.
template <class S>
class BasicDriveModel {
 public:
  // `effects` replace the ones of the robot file.
  BasicDriveModel(const robot::RobotModel& robot,
                  std::span<const ActiveEffect> effects) requires std::is_same_v<S, double>;
  // Seeds the derivative with respect to parameter `parameter` of effects[effect].
  BasicDriveModel(const robot::RobotModel& robot, std::span<const ActiveEffect> effects, std::size_t effect,
                  std::size_t parameter) requires std::is_same_v<S, Dual>;

  const Parameters<S>& parameters() const { return parameters_; }

  // Torques that the motion requires of the motors.
  TorqueBalance<S> balance(const Instant& at) const;

  // Motor current for a wheel torque, i = T/(K_t n) [A].
  S current_for(S torque_nm) const { return torque_nm / parameters_.torque_constant_nm_a; }

  // Armature voltage of one side for a current at a wheel speed: R i + L di/dt + K_w n w + brush drop [V].
  S voltage_for(std::size_t side, S current_a, const Instant& at) const;

  // Armature resistance of one side, warm by its copper heat [ohm].
  S resistance(std::size_t side, const Instant& at) const;

  // Battery power for the motors' powers: idle and accessories, driver loss, unreturned braking power [W].
  S battery_power_for(const std::array<S, 2>& motor_power_w) const;

  // All of it, from the motion alone.
  PowerFlow<S> flow(const Instant& at) const;

  // The reading of the robot's power meter for a true battery power of `power_w`; `battery_voltage_v` (the
  // nominal voltage where unknown) turns a current bias into power.
  S metered_battery_power(S power_w, double battery_voltage_v) const;

 private:
  template <class Values>
  void apply(std::span<const ActiveEffect> effects, Values&& values_of);
  S winding_voltage(std::size_t side, S current_a, const Instant& at) const;  // without the brushes

  Parameters<S> parameters_;
  struct LoadEffect {
    const Effect* effect;
    EffectValues<S> values;
  };
  std::vector<LoadEffect> loads_;
};

using DriveModel = BasicDriveModel<double>;

extern template class BasicDriveModel<double>;
extern template class BasicDriveModel<Dual>;

// The drive model of a robot file with its adopted effects; an effect that the catalogue rejects is an error.
Result<DriveModel> drive_model(const robot::RobotModel& robot);

// The adopted effects of a robot file, activated.
Result<std::vector<ActiveEffect>> active_effects(const robot::RobotModel& robot);

}  // namespace joulecast::dynamics

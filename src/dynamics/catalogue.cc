#include "dynamics/catalogue.h"

#include <algorithm>
#include <string>

#include "base/nearest_word.h"
#include "dynamics/effects/accessory_load.h"
#include "dynamics/effects/aerodynamic_drag.h"
#include "dynamics/effects/battery_resistance.h"
#include "dynamics/effects/brush_drop.h"
#include "dynamics/effects/chassis_mass_error.h"
#include "dynamics/effects/com_offset.h"
#include "dynamics/effects/coulomb_friction.h"
#include "dynamics/effects/current_sensor_bias.h"
#include "dynamics/effects/current_sensor_gain.h"
#include "dynamics/effects/driver_loss.h"
#include "dynamics/effects/floor_resistance_zone.h"
#include "dynamics/effects/friction_asymmetry.h"
#include "dynamics/effects/gear_efficiency.h"
#include "dynamics/effects/grade.h"
#include "dynamics/effects/inductance.h"
#include "dynamics/effects/linear_inertia_error.h"
#include "dynamics/effects/load_rolling_resistance.h"
#include "dynamics/effects/no_regeneration.h"
#include "dynamics/effects/payload_mass_error.h"
#include "dynamics/effects/resistance_error.h"
#include "dynamics/effects/sensor_delay.h"
#include "dynamics/effects/slope.h"
#include "dynamics/effects/stribeck_friction.h"
#include "dynamics/effects/torque_constant_loss.h"
#include "dynamics/effects/track_error.h"
#include "dynamics/effects/turning_scrub.h"
#include "dynamics/effects/viscous_friction.h"
#include "dynamics/effects/voltage_sensor_gain.h"
#include "dynamics/effects/wheel_radius_asymmetry.h"
#include "dynamics/effects/wheel_radius_error.h"
#include "dynamics/effects/wheel_slip.h"
#include "dynamics/effects/winding_temperature.h"
#include "dynamics/effects/yaw_inertia_error.h"

namespace joulecast::dynamics {
namespace {

template <class E>
const Effect* entry() {
  static const EffectOf<E> effect;
  return &effect;
}

// One line an effect.
const std::array table = {
    entry<CoulombFriction>(),
    entry<ViscousFriction>(),
    entry<StribeckFriction>(),
    entry<FrictionAsymmetry>(),
    entry<LoadRollingResistance>(),
    entry<FloorResistanceZone>(),
    entry<Slope>(),
    entry<Grade>(),
    entry<AerodynamicDrag>(),
    entry<TurningScrub>(),
    entry<GearEfficiency>(),
    entry<ChassisMassError>(),
    entry<PayloadMassError>(),
    entry<YawInertiaError>(),
    entry<LinearInertiaError>(),
    entry<ComOffset>(),
    entry<ResistanceError>(),
    entry<WindingTemperature>(),
    entry<BrushDrop>(),
    entry<TorqueConstantLoss>(),
    entry<Inductance>(),
    entry<AccessoryLoad>(),
    entry<DriverLoss>(),
    entry<NoRegeneration>(),
    entry<BatteryResistance>(),
    entry<WheelRadiusError>(),
    entry<WheelRadiusAsymmetry>(),
    entry<TrackError>(),
    entry<WheelSlip>(),
    entry<CurrentSensorGain>(),
    entry<CurrentSensorBias>(),
    entry<VoltageSensorGain>(),
    entry<SensorDelay>(),
};

}  // namespace

std::span<const Effect* const> catalogue() {
  return table;
}

const Effect* find_effect(std::string_view id) {
  const auto found =
      std::ranges::find_if(table, [&](const Effect* effect) { return effect->info().id == id; });
  return found == table.end() ? nullptr : *found;
}

ActiveEffect initial(const Effect& effect) {
  ActiveEffect active{&effect, {}};
  const auto& parameters = effect.info().parameters;
  for (std::size_t k = 0; k < parameters.size(); ++k) active.values[k] = parameters[k].initial;
  return active;
}

Result<ActiveEffect> activate(const robot::AdoptedEffect& adopted) {
  const std::string at = "/effects/" + adopted.id;
  const Effect* effect = find_effect(adopted.id);
  if (effect == nullptr) {
    const auto id = [](const Effect* known) { return known->info().id; };
    return invalid(at, "is not an effect of the catalogue" + did_you_mean(adopted.id, catalogue(), id));
  }
  ActiveEffect active = initial(*effect);
  const auto& parameters = effect->info().parameters;
  bool strength_given = false;
  for (const auto& [name, value] : adopted.parameters) {
    const auto found =
        std::ranges::find_if(parameters, [&](const EffectParameter& p) { return p.name == name; });
    if (found == parameters.end()) return invalid(at + "/" + name, "is not a parameter of this effect");
    if (!(value >= found->minimum && value <= found->maximum)) {
      return invalid(at + "/" + name, "is " + std::to_string(value) + ", must be from " +
                                          std::to_string(found->minimum) + " to " +
                                          std::to_string(found->maximum) + " " + std::string(found->unit));
    }
    const auto index = static_cast<std::size_t>(found - parameters.begin());
    active.values[index] = value;
    strength_given = strength_given || index == 0;
  }
  if (!strength_given) return invalid(at + "/" + std::string(parameters[0].name), "is required");
  return active;
}

robot::AdoptedEffect adopt(const ActiveEffect& active) {
  const EffectInfo& info = active.effect->info();
  robot::AdoptedEffect adopted{std::string(info.id), {}};
  for (std::size_t k = 0; k < info.parameters.size(); ++k) {
    adopted.parameters.emplace_back(info.parameters[k].name, active.values[k]);
  }
  return adopted;
}

}  // namespace joulecast::dynamics

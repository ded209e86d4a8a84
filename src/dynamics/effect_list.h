#pragma once

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

template <class... Effects>
struct EffectList {};

// Every effect of the catalogue, in the order in which they are applied. One name an effect.
using AllEffects =
    EffectList<CoulombFriction, ViscousFriction, StribeckFriction, FrictionAsymmetry, LoadRollingResistance,
               FloorResistanceZone, Slope, Grade, AerodynamicDrag, TurningScrub, GearEfficiency,
               ChassisMassError, PayloadMassError, YawInertiaError, LinearInertiaError, ComOffset,
               ResistanceError, WindingTemperature, BrushDrop, TorqueConstantLoss, Inductance, AccessoryLoad,
               DriverLoss, NoRegeneration, BatteryResistance, WheelRadiusError, WheelRadiusAsymmetry,
               TrackError, WheelSlip, CurrentSensorGain, CurrentSensorBias, VoltageSensorGain, SensorDelay>;

}  // namespace joulecast::dynamics

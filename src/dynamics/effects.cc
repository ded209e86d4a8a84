#include <array>
#include <cmath>
#include <string_view>
#include <tuple>
#include <type_traits>
#include <utility>
#include <vector>

#include "dynamics/catalogue.h"
#include "dynamics/stribeck_curve.h"

namespace joulecast::dynamics {
namespace {

// Adapts a law to the interface; an effect has one. A law is a generic function without state, for double and
// Dual, so that every derivative is exact:
//   (EffectValues<S>, Parameters<S>&)                        changes constants
//   (EffectValues<S>, const LoadContext<S>&, Loads<S>&)      adds torque at the wheels
template <class Law>
class EffectOf final : public Effect {
  static constexpr bool is_load =
      std::is_invocable_v<Law, const EffectValues<double>&, const LoadContext<double>&, Loads<double>&>;

 public:
  explicit EffectOf(EffectInfo info) : info_(std::move(info)) {}

  const EffectInfo& info() const override { return info_; }
  bool loads() const override { return is_load; }
  void adjust(const EffectValues<double>& a, Parameters<double>& p) const override { adjust_any(a, p); }
  void adjust(const EffectValues<Dual>& a, Parameters<Dual>& p) const override { adjust_any(a, p); }
  void load(const EffectValues<double>& a, const LoadContext<double>& c, Loads<double>& l) const override {
    load_any(a, c, l);
  }
  void load(const EffectValues<Dual>& a, const LoadContext<Dual>& c, Loads<Dual>& l) const override {
    load_any(a, c, l);
  }

 private:
  template <class S>
  static void adjust_any(const EffectValues<S>& a, Parameters<S>& p) {
    if constexpr (!is_load) Law{}(a, p);
  }
  template <class S>
  static void load_any(const EffectValues<S>& a, const LoadContext<S>& c, Loads<S>& l) {
    if constexpr (is_load) Law{}(a, c, l);
  }

  EffectInfo info_;
};

template <class Law>
EffectOf<Law> effect(std::string_view id, ActsOn acts_on, std::string_view formula, std::string_view validity,
                     std::string_view source, std::vector<EffectParameter> parameters, Law,
                     Needs needs = Needs::nothing) {
  return EffectOf<Law>({id, acts_on, formula, validity, source, std::move(parameters), needs});
}

// Shares of a sensor's error.
constexpr EffectParameter motors_share{"motors", "1", 1, 0, 1, "share that the motor sensors have of it"};
constexpr EffectParameter battery_share{"battery", "1", 1, 0, 1, "share that the battery sensor has of it"};

// In the order in which they are applied.
const std::tuple effects{
    effect(
        "coulomb_friction", ActsOn::wheel_torque, "T = ((1 + a) T_m + b) sgn(w)", "any speed above creep",
        "thesis (2-32), T_m",
        {{"ratio", "1", 0, -0.9, 20, "extra internal dry friction over the nominal T_m of each side"},
         {"extra_nm", "N m", 0, -1000, 10000, "extra internal dry friction of each side, beside that", true}},
        [](const auto& a, auto& p) {
          for (auto& torque : p.friction_torque_nm) torque = torque * (1.0 + a[0]) + a[1];
        }),
    effect("viscous_friction", ActsOn::wheel_torque, "T = ((1 + a) nu + b) w",
           "lubricated gears and bearings", "thesis (2-32), nu",
           {{"ratio", "1", 0, -1, 200, "extra viscous friction over the nominal nu"},
            {"extra_nm_s_rad", "N m s/rad", 0, -100, 1000, "extra viscous friction of each side, beside that",
             true}},
           [](const auto& a, auto& p) {
             p.viscous_friction_nm_s_rad = p.viscous_friction_nm_s_rad * (1.0 + a[0]) + a[1];
           }),
    effect("stribeck_friction", ActsOn::wheel_torque, "T = a T_m exp(-|w/w_s|^d) sgn(w)",
           "low speed, boundary lubrication",
           "Armstrong-Helouvry, Control of Machines with Friction, 1991, ch. 2",
           {{"ratio", "1", 0, 0, 20,
             "breakaway friction above T_m, over T_m with coulomb_friction and friction_asymmetry"},
            {"speed_rad_s", "rad/s", 2, 0.2, 100, "Stribeck speed of the wheel"},
            {"exponent", "1", 2, 1, 2, "of the speed in the exponential"}},
           [](const auto& a, const auto& c, auto& loads) {
             for (std::size_t s : {0u, 1u}) {
               const auto x = c.at.wheel_speed_rad_s[s] / a[1];
               loads.wheel(
                   Load::internal, s,
                   a[0] * c.parameters.friction_torque_nm[s] * stribeck_curve(x, a[2]) * c.direction[s]);
             }
           }),
    effect("friction_asymmetry", ActsOn::wheel_torque, "T = (1 + a) T_m sgn(w) on one side only",
           "one motor or gear worn", "thesis section 3.1: T_m differs between the sides",
           {{"ratio", "1", 0, -0.9, 20,
             "extra dry friction of that side over its T_m, coulomb_friction included"},
            {"side", "1", 0, 0, 1, "0 right, 1 left"}},
           [](const auto& a, auto& p) { p.friction_torque_nm[value_of(a[1]) < 0.5 ? 0 : 1] *= 1.0 + a[0]; }),
    effect("load_rolling_resistance", ActsOn::wheel_torque,
           "F = a m_p g, half on each wheel, opposing its rotation", "hard floor, payload over the axle",
           "thesis (1-3), F_r = m g f_r; tables 3-3 and 3-4 show that T_m grows with payload",
           {{"coefficient", "1", 0, 0, 0.3, "rolling resistance of the payload weight"}},
           [](const auto& a, const auto& c, auto& loads) {
             for (std::size_t s : {0u, 1u})
               loads.wheel(Load::rolling, s,
                           a[0] * c.payload_weight_n * c.parameters.wheel_radius_m[s] * 0.5 * c.direction[s]);
           }),
    effect(
        "floor_resistance_zone", ActsOn::wheel_torque,
        "F = a m g inside a disc of the floor, half on each wheel, opposing its rotation",
        "carpet, ramps of rubber, dirt: a patch that stays", "thesis (1-3), F_r = m g f_r",
        {{"coefficient", "1", 0, 0, 0.5, "extra rolling resistance inside"},
         {"x_m", "m", 0, -1000, 1000, "centre"},
         {"y_m", "m", 0, -1000, 1000, "centre"},
         {"radius_m", "m", 3, 0.2, 1000, "radius"}},
        [](const auto& a, const auto& c, auto& loads) {
          const double dx = c.at.x_m - value_of(a[1]), dy = c.at.y_m - value_of(a[2]),
                       radius = value_of(a[3]);
          if (!(dx * dx + dy * dy <= radius * radius)) return;  // also when the position is unknown
          for (std::size_t s : {0u, 1u})
            loads.wheel(Load::zone, s,
                        a[0] * c.weight_n * c.parameters.wheel_radius_m[s] * 0.5 * c.direction[s]);
        },
        Needs::position),
    effect(
        "slope", ActsOn::wheel_torque, "F = m g sin(a) cos(heading - b)", "a plane floor, small tilt",
        "thesis (1-3), F_g = m g sin(alpha)",
        {{"angle_rad", "rad", 0, 0, 0.3, "tilt of the floor"},
         {"uphill_rad", "rad", 0, -7, 7, "heading in which the floor rises"}},
        [](const auto& a, const auto& c, auto& loads) {
          if (!std::isfinite(c.at.heading_rad)) return;
          c.force(loads, Load::potential, c.weight_n * sin(a[0]) * cos(c.at.heading_rad - a[1]));
        },
        Needs::heading),
    effect(
        "grade", ActsOn::wheel_torque, "F = a m g sin(climb + b)",
        "a floor of any shape whose climb is known: pitch, or height over the way",
        "thesis (1-3), F_g = m g sin(alpha)",
        {{"share", "1", 0, 0, 2, "of the climb's force that counts; 1: the whole of it"},
         {"zero_rad", "rad", 0, -0.2, 0.2, "added to the climb: by how much the pitch reads low"}},
        [](const auto& a, const auto& c, auto& loads) {
          if (!std::isfinite(c.at.climb_rad)) return;
          c.force(loads, Load::potential, a[0] * c.weight_n * sin(c.at.climb_rad + a[1]));
        },
        Needs::climb),
    effect("aerodynamic_drag", ActsOn::wheel_torque, "F = a v |v|, a = rho A C / 2", "still air",
           "thesis (1-3), F_a", {{"coefficient_n_s2_m2", "N s^2/m^2", 0, 0, 1000, "drag over speed squared"}},
           [](const auto& a, const auto& c, auto& loads) {
             const auto v = c.body.speed_m_s;
             c.force(loads, Load::drag, a[0] * v * abs(v));
           }),
    effect("turning_scrub", ActsOn::wheel_torque, "M = a (m g l / 2) tanh(yaw / b), opposing the turn",
           "tyres and castors twisting on the floor; saturated above creeping yaw rates",
           "Morales et al., Power analysis for a skid-steered tracked mobile robot, 2006",
           {{"coefficient", "1", 0, 0, 3, "friction coefficient of the twisting contacts"},
            {"rate_rad_s", "rad/s", 0.02, 0.001, 2, "yaw rate at which the moment has built up"}},
           [](const auto& a, const auto& c, auto& loads) {
             c.moment(
                 loads, Load::scrub,
                 a[0] * c.weight_n * c.parameters.half_track_m * 0.5 * tanh(c.body.yaw_rate_rad_s / a[1]));
           }),
    effect("gear_efficiency", ActsOn::wheel_torque,
           "T = tau + f + a |tau + b f| sgn(w), tau the torque passed on, f the drive's own friction",
           "steady mesh; driving and braking alike",
           "Giberti, Cinquemani and Legnani, Effects of transmission mechanical characteristics, 2010",
           {{"loss", "1", 0, 0, 0.9, "fraction of the transmitted torque lost"},
            {"of_friction", "1", 0, 0, 1,
             "share of T_m and viscous friction that the gear passes on: 0 where "
             "they act at the motor, 1 where at the wheel"}},
           [](const auto& a, auto& p) {
             // Losses add, each with its own share of friction.
             const auto of_friction = p.gear_loss * p.gear_friction_share + a[0] * a[1];
             p.gear_loss += a[0];
             p.gear_friction_share = value_of(p.gear_loss) == 0 ? a[1] : of_friction / p.gear_loss;
           }),
    effect("chassis_mass_error", ActsOn::inertia, "m_c (1 + a)", "rigid chassis", "thesis (2-31)",
           {{"ratio", "1", 0, -0.8, 3, "error of the chassis mass over its nominal value"}},
           [](const auto& a, auto& p) { p.chassis_kg *= 1.0 + a[0]; }),
    effect("payload_mass_error", ActsOn::inertia, "m_p (1 + a) + b", "payload over the axle",
           "thesis section 2.1.1, m_p",
           {{"ratio", "1", 0, -1, 10, "error over the declared payload"},
            {"extra_kg", "kg", 0, -500, 1000, "payload that was not declared", true}},
           [](const auto& a, auto& p) {
             p.payload_factor += a[0];
             p.payload_extra_kg += a[1];
           }),
    effect("yaw_inertia_error", ActsOn::inertia, "I (1 + a)", "rigid body", "thesis (2-12), I",
           {{"ratio", "1", 0, -0.9, 20,
             "error of the robot file's yaw inertia over its value; a payload's is not scaled"}},
           [](const auto& a, auto& p) { p.yaw_inertia_kg_m2 *= 1.0 + a[0]; }),
    effect("linear_inertia_error", ActsOn::inertia, "F = m (1 + a) dv/dt",
           "rotating parts or sloshing load that add inertia without weight", "thesis (2-31), m",
           {{"ratio", "1", 0, -0.8, 5, "error of the translational inertia over the mass"}},
           [](const auto& a, auto& p) { p.inertial_factor += a[0]; }),
    effect("com_offset", ActsOn::inertia, "d + a", "centre of mass on the axis of symmetry",
           "thesis (2-12), d", {{"offset_m", "m", 0, -1, 1, "centre of mass further ahead of the axle"}},
           [](const auto& a, auto& p) { p.com_offset_m += a[0]; }),
    effect("resistance_error", ActsOn::motor, "R (1 + a)", "constant temperature", "thesis (2-32), R",
           {{"ratio", "1", 0, -0.99, 20, "error of the armature resistance over its nominal value"}},
           [](const auto& a, auto& p) {
             for (auto& ohm : p.resistance_ohm) ohm *= 1.0 + a[0];
           }),
    effect("winding_temperature", ActsOn::motor, "R (1 + 0.00393 a q), q = R i^2 low-passed over b",
           "one thermal mass for each winding",
           "copper: 0.393 % per kelvin; Hughes and Drury, Electric Motors and Drives, ch. 3",
           {{"thermal_resistance_k_w", "K/W", 0, 0, 300, "winding over ambient"},
            {"time_constant_s", "s", 600, 10, 7200, "of the winding"}},
           [](const auto& a, auto& p) {
             p.thermal_resistance_k_w += a[0];
             p.thermal_time_constant_s = value_of(a[1]);
           }),
    effect("brush_drop", ActsOn::motor, "V + a sgn(i)", "brushed motors",
           "Hughes and Drury, Electric Motors and Drives, section 3.3",
           {{"voltage_v", "V", 0, 0, 20, "across both brushes"}},
           [](const auto& a, auto& p) { p.brush_drop_v += a[0]; }),
    effect("torque_constant_loss", ActsOn::motor, "K_t (1 - a), K_w (1 - b a)",
           "magnets warm or aged; in SI units both constants fall together (b = 1)",
           "thesis (2-32), K_t and K_w",
           {{"loss", "1", 0, -0.5, 0.8, "fraction of the constant lost"},
            {"voltage_share", "1", 1, 0, 1, "how much of the loss the voltage constant shares"}},
           [](const auto& a, auto& p) {
             p.torque_constant_nm_a *= 1.0 - a[0];
             p.voltage_constant_v_s_rad *= 1.0 - a[1] * a[0];
           }),
    effect("inductance", ActsOn::motor, "V + a di/dt", "mean-value drivers",
           "thesis (2-32), L, dropped in (2-33)", {{"inductance_h", "H", 0, 0, 1, "armature inductance"}},
           [](const auto& a, auto& p) { p.inductance_h += a[0]; }),
    effect("accessory_load", ActsOn::battery_side, "P + a", "constant while the robot is on",
           "Mei et al., Deployment of mobile robots with energy and timing constraints, 2006",
           {{"power_w", "W", 0, -2000, 20000, "extra constant power"}},
           [](const auto& a, auto& p) { p.accessory_power_w += a[0]; }),
    effect("driver_loss", ActsOn::battery_side, "P + a |V i| for each motor",
           "switching and conduction losses together",
           "Mohan, Undeland and Robbins, Power Electronics, ch. 2",
           {{"fraction", "1", 0, 0, 1, "of the absolute motor power"}},
           [](const auto& a, auto& p) { p.driver_loss += a[0]; }),
    effect("no_regeneration", ActsOn::battery_side,
           "braking power of each motor reaches the battery as (1 - a)",
           "a = 1: all burnt in a resistor or blocked", "the thesis returns all of it, (2-46)",
           {{"fraction", "1", 0, 0, 1, "of the braking power that is not returned"}},
           [](const auto& a, auto& p) { p.unreturned += a[0]; }),
    effect("battery_resistance", ActsOn::battery_side, "V_t = V_oc - (1 + a) R_b i", "ohmic part only",
           "Plett, Battery Management Systems I, ch. 2",
           {{"ratio", "1", 0, -0.9, 20, "error of the internal resistance over its nominal value"}},
           [](const auto& a, auto& p) { p.battery_resistance_ohm *= 1.0 + a[0]; }),
    effect("wheel_radius_error", ActsOn::kinematics, "r (1 + a), both wheels", "worn or soft tyres",
           "Borenstein and Feng, Measurement and correction of systematic odometry errors, 1996",
           {{"ratio", "1", 0, -0.6, 1.5, "error of both radii over the nominal one"}},
           [](const auto& a, auto& p) {
             for (auto& radius : p.wheel_radius_m) radius *= 1.0 + a[0];
           }),
    effect("wheel_radius_asymmetry", ActsOn::kinematics, "r_right (1 + a/2), r_left (1 - a/2)",
           "unequal wear or load", "Borenstein and Feng 1996, E_d",
           {{"ratio", "1", 0, -0.5, 0.5, "difference of the radii over the nominal one"}},
           [](const auto& a, auto& p) {
             p.wheel_radius_m[0] *= 1.0 + a[0] * 0.5;
             p.wheel_radius_m[1] *= 1.0 - a[0] * 0.5;
           }),
    effect("track_error", ActsOn::kinematics, "l (1 + a)", "effective contact width",
           "Borenstein and Feng 1996, E_b",
           {{"ratio", "1", 0, -0.7, 2, "error of the track over its nominal value"}},
           [](const auto& a, auto& p) { p.half_track_m *= 1.0 + a[0]; }),
    effect("wheel_slip", ActsOn::kinematics, "v = (1 - a) r w", "small constant slip of both wheels",
           "Wong, Theory of Ground Vehicles, section 1.3",
           {{"slip", "1", 0, -0.2, 0.8, "part of the wheel travel that moves nothing"}},
           [](const auto& a, auto& p) { p.slip += a[0]; }),
    effect("current_sensor_gain", ActsOn::sensors, "reading = (1 + a) truth", "linear sensors",
           "ISO/IEC Guide 98-3 (GUM), systematic effects",
           {{"gain", "1", 0, -0.5, 0.5, "error of the reading"}, motors_share, battery_share},
           [](const auto& a, auto& p) {
             p.motor_current.gain += a[0] * a[1];
             p.battery_current.gain += a[0] * a[2];
           }),
    effect("current_sensor_bias", ActsOn::sensors, "reading = truth + a", "linear sensors",
           "ISO/IEC Guide 98-3 (GUM), systematic effects",
           {{"bias_a", "A", 0, -20, 20, "error of the reading"}, motors_share, battery_share},
           [](const auto& a, auto& p) {
             p.motor_current.bias += a[0] * a[1];
             p.battery_current.bias += a[0] * a[2];
           }),
    effect("voltage_sensor_gain", ActsOn::sensors, "reading = (1 + a) truth", "linear sensors",
           "ISO/IEC Guide 98-3 (GUM), systematic effects",
           {{"gain", "1", 0, -0.5, 0.5, "error of the reading"}, motors_share, battery_share},
           [](const auto& a, auto& p) {
             p.motor_voltage.gain += a[0] * a[1];
             p.battery_voltage.gain += a[0] * a[2];
           }),
    effect("sensor_delay", ActsOn::sensors, "electrical reading(t) = truth(t - a)",
           "delay below the time constants of motion", "Ljung, System Identification, section 14.5",
           {{"delay_s", "s", 0, -0.5, 0.5, "by which electrical channels lag the encoders"}},
           [](const auto& a, auto& p) { p.sensor_delay_s += a[0]; })};

}  // namespace

std::span<const Effect* const> catalogue() {
  static const std::array table = std::apply(
      [](const auto&... each) { return std::array<const Effect*, sizeof...(each)>{&each...}; }, effects);
  return table;
}

}  // namespace joulecast::dynamics

#include "tests/study/trial/foreign/foreign_plant.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <numbers>

namespace joulecast::trial::foreign {
namespace {

constexpr double gravity_m_s2 = 9.80665;
constexpr double uphill_rad = 0.7;  // heading in which a tilted floor rises
constexpr std::array<double, 2> place_m{1.5, 1};
constexpr double bristle_rad = 0.005;  // bending at which the bristles slide
constexpr double payload_gyration_m2 = 0.02;

// Speed, yaw rate, currents, bristles, place and heading.
using State = std::array<double, 9>;
struct At {
  static constexpr std::size_t speed = 0, yaw = 1, current = 2, bristle = 4, x = 6, y = 7, heading = 8;
};

// A torque or voltage of constant size against the way of its argument.
double saturated(double size, double argument) {
  return size == 0 ? 0 : size * std::tanh(argument);
}

struct Plant {
  ForeignRobot robot;
  Departures with;
  double mass_kg, inertia_kg, yaw_inertia_kg_m2, payload_kg;
  std::array<double, 2> friction_nm, voltage_v{}, extra_nm{};
  double time_s = 0;

  Plant(const ForeignRobot& r, const Departures& d, double payload) : robot(r), with(d), payload_kg(payload) {
    mass_kg = r.chassis_kg * (1 + d.chassis_ratio) + 2 * r.wheel_kg + payload;
    inertia_kg = mass_kg + 2 * r.wheel_inertia_kg_m2 / (r.radius_m * r.radius_m);
    yaw_inertia_kg_m2 =
        r.yaw_inertia_kg_m2 + payload_gyration_m2 * payload +
        2 * r.wheel_inertia_kg_m2 * r.half_track_m * r.half_track_m / (r.radius_m * r.radius_m);
    friction_nm = r.friction_nm;
    for (double& torque : friction_nm) torque *= 1 + d.coulomb_ratio;
    friction_nm[0] *= 1 + d.right_friction_ratio;
  }

  std::array<double, 2> wheels(const State& s) const {
    const double turn = robot.half_track_m * s[At::yaw];
    return {(s[At::speed] + turn) / robot.radius_m, (s[At::speed] - turn) / robot.radius_m};
  }

  double constant() const { return robot.constant_nm_a * (1 - with.constant_loss); }

  // d/dt of the state with the voltages held.
  State slope_of(const State& s) const {
    State d{};
    const auto wheel = wheels(s);
    std::array<double, 2> force_n{};
    for (std::size_t k : {0u, 1u}) {
      const double w = wheel[k], i = s[At::current + k], z = s[At::bristle + k];
      d[At::current + k] = (voltage_v[k] - robot.resistance_ohm * (1 + with.resistance_ratio) * i -
                            constant() * w - saturated(with.brush_v, i / 0.05)) /
                           robot.inductance_h;
      const double stiffness = friction_nm[k] / bristle_rad;
      d[At::bristle + k] = w - std::fabs(w) * z / bristle_rad;
      const double own = stiffness * z + 0.01 * stiffness * d[At::bristle + k] +
                         robot.viscous_nm_s_rad * (1 + with.viscous_ratio) * w;
      const double rolling =
          0.5 * with.payload_rolling * payload_kg * gravity_m_s2 * robot.radius_m + extra_nm[k];
      double passed = constant() * i - own;
      passed /= 1 + saturated(with.gear_loss, w / 0.02) * (passed < 0 ? -1 : 1);
      force_n[k] = (passed - saturated(rolling, w / 0.02)) / robot.radius_m;
    }
    const double hill =
        mass_kg * gravity_m_s2 * std::sin(with.slope_rad) * std::cos(s[At::heading] - uphill_rad);
    d[At::speed] =
        (force_n[0] + force_n[1] - with.drag_n_s2_m2 * s[At::speed] * std::fabs(s[At::speed]) - hill) /
        inertia_kg;
    const double twist =
        saturated(with.scrub * mass_kg * gravity_m_s2 * robot.half_track_m / 2, s[At::yaw] / 0.02);
    d[At::yaw] = (robot.half_track_m * (force_n[0] - force_n[1]) - twist) / yaw_inertia_kg_m2;
    d[At::x] = s[At::speed] * std::cos(s[At::heading]);
    d[At::y] = s[At::speed] * std::sin(s[At::heading]);
    d[At::heading] = s[At::yaw];
    return d;
  }

  void step(State& s, double dt_s) {
    const auto plus = [&](const State& d, double h) {
      State out = s;
      for (std::size_t k = 0; k < out.size(); ++k) out[k] += h * d[k];
      return out;
    };
    const State a = slope_of(s), b = slope_of(plus(a, dt_s / 2)), c = slope_of(plus(b, dt_s / 2)),
                d = slope_of(plus(c, dt_s));
    for (std::size_t k = 0; k < s.size(); ++k) s[k] += dt_s / 6 * (a[k] + 2 * b[k] + 2 * c[k] + d[k]);
    time_s += dt_s;
  }

  ForeignState seen(const State& s) const {
    ForeignState out;
    out.time_s = time_s;
    out.wheel_rad_s = wheels(s);
    out.voltage_v = voltage_v;
    double power_w = robot.idle_w + with.accessory_w;
    for (std::size_t k : {0u, 1u}) {
      out.current_a[k] = s[At::current + k];
      out.torque_nm[k] = constant() * s[At::current + k];
      const double motor_w = voltage_v[k] * s[At::current + k];
      power_w += motor_w + with.driver_loss * std::fabs(motor_w) + with.unreturned * std::max(0.0, -motor_w);
    }
    if (std::fmod(time_s, 37) < 6) power_w += with.switched_w;
    if (std::hypot(s[At::x] - place_m[0], s[At::y] - place_m[1]) < 1.5) power_w += with.place_w;
    // (V - R i) i = P, the smaller root.
    const double v = robot.battery_v, r = robot.battery_ohm;
    out.battery_current_a = (v - std::sqrt(std::max(0.0, v * v - 4 * r * power_w))) / (2 * r);
    out.battery_voltage_v = v - r * out.battery_current_a;
    out.battery_power_w = power_w;
    out.x_m = s[At::x];
    out.y_m = s[At::y];
    out.heading_rad = s[At::heading];
    out.yaw_rate_rad_s = s[At::yaw];
    return out;
  }
};

// Sampled speed control of both wheels: feed-forward from the robot file and a proportional-integral
// correction.
struct Controller {
  const ForeignRobot& robot;
  std::array<double, 2> integral{};

  std::array<double, 2> voltages(const std::array<double, 2>& asked, const std::array<double, 2>& wheel) {
    constexpr double bandwidth_rad_s = 15;
    const ForeignRobot& r = robot;
    const double inertia = r.wheel_inertia_kg_m2 + r.radius_m * r.radius_m * (r.chassis_kg / 2 + r.wheel_kg);
    const double gain = bandwidth_rad_s * r.resistance_ohm * inertia / r.constant_nm_a;
    std::array<double, 2> out{};
    for (std::size_t k : {0u, 1u}) {
      const double error = asked[k] - wheel[k];
      const bool rests = asked[k] == 0 && std::fabs(wheel[k]) < 0.02;
      integral[k] = rests ? 0 : integral[k] + 3 * gain * error * controller_period_s;
      const double friction_nm = r.friction_nm[k] * std::tanh(asked[k] / 0.1) + r.viscous_nm_s_rad * asked[k];
      const double wanted_v = r.constant_nm_a * asked[k] + r.resistance_ohm * friction_nm / r.constant_nm_a +
                              gain * error + integral[k];
      out[k] = rests ? 0 : std::clamp(wanted_v, -r.battery_v, r.battery_v);
    }
    return out;
  }
};

// Moves a speed towards a goal within a controller period.
double toward(double value, double goal, double most) {
  return value + std::clamp(goal - value, -most, most);
}

}  // namespace

const std::vector<DepartureEntry>& departures() {
  using D = Departures;
  static const std::vector<DepartureEntry> entries{
      {"coulomb_friction", &D::coulomb_ratio, 3, true},
      {"viscous_friction", &D::viscous_ratio, 8, true},
      {"friction_asymmetry", &D::right_friction_ratio, 4, true},
      {"load_rolling_resistance", &D::payload_rolling, 0.1, false},
      {"turning_scrub", &D::scrub, 1, false},
      {"aerodynamic_drag", &D::drag_n_s2_m2, 60, false},
      {"slope", &D::slope_rad, 0.06, false},
      {"gear_efficiency", &D::gear_loss, 0.6, false},
      {"chassis_mass_error", &D::chassis_ratio, 1, true},
      {"resistance_error", &D::resistance_ratio, 2.5, true},
      {"torque_constant_loss", &D::constant_loss, 0.4, false},
      {"brush_drop", &D::brush_v, 3, false},
      {"accessory_load", &D::accessory_w, 200, false},
      {"driver_loss", &D::driver_loss, 0.6, false},
      {"no_regeneration", &D::unreturned, 1, false},
      {"current_sensor_gain", &D::current_gain, 0.25, true},
      {"x_switched_load", &D::switched_w, 600, false},
      {"x_dragging_brake", &D::dragging_brake_nm, 30, false},
      {"x_warming_friction", &D::warming_nm, 20, false},
      {"x_place_load", &D::place_w, 600, false},
      {"x_caster", &D::caster_nm, 30, false},
  };
  return entries;
}

Drive draw_drive(const ForeignRobot& robot, double duration_s, virtual_robot::Rng& rng) {
  Drive drive;
  drive.payload_kg = rng.chance(0.35) ? 0 : rng.uniform(0.2, 1) * robot.payload_kg;
  const double dt = controller_period_s;
  const auto steps = static_cast<std::size_t>(duration_s / dt);
  double v = 0, yaw_rate = 0, heading = 0, px = 0, py = 0;
  const auto ask = [&] {
    const double turn = robot.half_track_m * yaw_rate;
    drive.wheel_rad_s.push_back({(v + turn) / robot.radius_m, (v - turn) / robot.radius_m});
    px += v * std::cos(heading) * dt;
    py += v * std::sin(heading) * dt;
    heading += yaw_rate * dt;
  };
  while (drive.wheel_rad_s.size() < steps) {
    const double gx = rng.uniform(-5, 5), gy = rng.uniform(-5, 5);
    const double acceleration = rng.uniform(0.35, 0.95) * robot.acceleration_m_s2;
    const double top = rng.uniform(0.3, 0.9) * robot.speed_m_s;
    const double spin = rng.uniform(0.3, 0.9) * robot.yaw_rate_rad_s, twist = 1.5 * spin;
    // Turn in place to the goal.
    double left = std::remainder(std::atan2(gy - py, gx - px) - heading, 2 * std::numbers::pi);
    const double sign = left < 0 ? -1 : 1;
    for (left = std::fabs(left); left > 1e-3 && drive.wheel_rad_s.size() < steps;
         left -= std::fabs(yaw_rate) * dt) {
      const double allowed = std::max(std::sqrt(2 * twist * left), 0.01);
      yaw_rate = sign * toward(std::fabs(yaw_rate), std::min(spin, allowed), twist * dt);
      ask();
    }
    yaw_rate = 0;
    // A leg, of which some are arcs.
    const double bend = rng.chance(0.3) ? rng.uniform(-0.3, 0.3) : 0;
    for (double way = std::hypot(gx - px, gy - py); way > 1e-3 && drive.wheel_rad_s.size() < steps;
         way -= v * dt) {
      const double allowed = std::max(std::sqrt(2 * acceleration * way), 0.005);
      v = toward(v, std::min(top, allowed), acceleration * dt);
      yaw_rate = bend * v;
      ask();
    }
    v = yaw_rate = 0;
    for (double wait = rng.chance(0.6) ? rng.uniform(0.5, 5) : 0; wait > 0; wait -= dt) ask();
  }
  drive.wheel_rad_s.resize(steps);
  return drive;
}

std::vector<ForeignState> driven(const ForeignRobot& robot, const Departures& with, const Drive& drive,
                                 double period_s, double resolution_s) {
  Plant plant(robot, with, drive.payload_kg);
  Controller controller{robot};
  State state{};
  std::vector<ForeignState> out;
  const auto steps = static_cast<std::size_t>(std::lround(controller_period_s / resolution_s));
  double next_s = 0, braked_until_s = -1, turned_m = 10, last_turn = 0;
  std::size_t starts = 0;
  bool moved = false;
  for (const auto& asked : drive.wheel_rad_s) {
    const bool moves = asked[0] != 0 || asked[1] != 0;
    if (moves && !moved && ++starts % 3 == 0) braked_until_s = plant.time_s + 8;
    moved = moves;
    if (const double turn = asked[0] - asked[1]; std::fabs(turn) > 0.1 && turn * last_turn <= 0) {
      turned_m = 0;
      last_turn = turn;
    }
    turned_m += std::fabs(state[At::speed]) * controller_period_s;
    const double warm = 1 - std::exp(-plant.time_s / 60);
    for (std::size_t k : {0u, 1u}) {
      plant.extra_nm[k] = with.warming_nm * warm + with.caster_nm * std::max(0.0, 1 - turned_m);
    }
    if (plant.time_s < braked_until_s) plant.extra_nm[1] += with.dragging_brake_nm;
    plant.voltage_v = controller.voltages(asked, plant.wheels(state));
    for (std::size_t k = 0; k < steps; ++k) {
      if (plant.time_s + 1e-9 >= next_s) {
        out.push_back(plant.seen(state));
        next_s += period_s;
      }
      plant.step(state, resolution_s);
    }
  }
  return out;
}

}  // namespace joulecast::trial::foreign

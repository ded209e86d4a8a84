#include "tests/study/trial/motion/plant.h"

#include <algorithm>
#include <cmath>
#include <numbers>

namespace joulecast::trial::motion {
namespace {

constexpr double unbounded = 1e12;

double of(const Scene& s, Term term) {
  return s.base[static_cast<std::size_t>(term)];
}
double sign(double x) {
  return x > 0 ? 1 : x < 0 ? -1 : 0;
}
double rim(const Moment& m, std::size_t side) {
  return m.at.rim_m_s[side];
}
// Dry friction of one side.
double dry_n(const Scene& s) {
  return of(s, Term::friction) / 2;
}
// A yaw moment against a turn to the left, as force of one side.
double by_moment(const Scene& s, std::size_t side, double moment_nm) {
  return (side == 0 ? 1 : -1) * moment_nm / (2 * s.half_track_m);
}
// Yaw moment of a friction coefficient of 1.
double scrub_nm(const Scene& s) {
  return 0.5 * of(s, Term::inertia) * robot::standard_gravity_m_s2 * s.half_track_m;
}
double built_up(const Scene& s, const Moment& m) {
  return std::tanh(m.at.yaw_rate_rad_s / s.form.turning_rate_rad_s);
}
double inertial_n(const Scene& s, const Moment& m) {
  return of(s, Term::inertia) * m.at.acceleration_m_s2 / 2;
}
bool driving(const Moment& m) {
  return m.at.speed_m_s * m.at.acceleration_m_s2 > 0;
}
double absolute_motor_w(const Moment& m) {
  return std::fabs(m.motor_w[0]) + std::fabs(m.motor_w[1]);
}
double braking_w(const Moment& m) {
  return std::max(0.0, -m.motor_w[0]) + std::max(0.0, -m.motor_w[1]);
}
double fading(const Scene& s, const Moment& m, std::size_t side) {
  return std::fabs(rim(m, side)) / s.slow_m_s;
}

double by_ratio(const Scene&) {
  return -0.7;
}
double any(const Scene&) {
  return -unbounded;
}

using S = const Scene&;
using M = const Moment&;
using N = std::size_t;

// Strengths in the catalogue's units: friction and inertia as ratios to the robot file's, the others in SI
// units or as shares. At most 70 % of the robot file's value may be removed.
constexpr auto
    table =
        std::to_array<Form>(
            {
                {"accessory_load", "constant power", true, Stage::battery, [](S, M, N) { return 1.0; },
                 unbounded, [](S s) { return -0.7 * of(s, Term::idle); }},
                {"accessory_load", "a resistance across the battery", false, Stage::battery,
                 [](S s, M m, N) { return std::pow(m.at.voltage_v / s.nominal_voltage_v, 2); }, unbounded,
                 nullptr},
                {"coulomb_friction", "same at any speed", true, Stage::friction,
                 [](S s, M m, N n) { return dry_n(s) * sign(rim(m, n)); }, 15, by_ratio},
                {"coulomb_friction", "falls by 40 % up to the top speed", false, Stage::friction,
                 [](S s, M m, N n) {
                   return dry_n(s) * sign(rim(m, n)) *
                          (1 - 0.4 * std::min(1.0, std::fabs(rim(m, n)) / s.top_m_s));
                 },
                 15, by_ratio},
                {"viscous_friction", "in proportion to speed", true, Stage::friction,
                 [](S s, M m, N n) { return dry_n(s) * s.form.viscous_s_m * rim(m, n); }, 180, nullptr},
                {"viscous_friction", "half as steep above half the top speed", false, Stage::friction,
                 [](S s, M m, N n) {
                   const double u = std::fabs(rim(m, n)), knee = s.top_m_s / 2;
                   return dry_n(s) * s.form.viscous_s_m * sign(rim(m, n)) *
                          (u < knee ? u : knee + (u - knee) / 2);
                 },
                 180, nullptr},
                {"viscous_friction", "speed to the power of 1.3", false, Stage::friction,
                 [](S s, M m, N n) {
                   return dry_n(s) * s.form.viscous_s_m * sign(rim(m, n)) * s.top_m_s *
                          std::pow(std::fabs(rim(m, n)) / s.top_m_s, 1.3);
                 },
                 180, nullptr},
                {"stribeck_friction", "exponential", true, Stage::friction,
                 [](S s, M m, N n) {
                   return dry_n(s) * sign(rim(m, n)) * std::exp(-std::pow(fading(s, m, n), s.slow_exponent));
                 },
                 15, nullptr},
                {"stribeck_friction", "one over one plus speed squared", false, Stage::friction,
                 [](S s, M m, N n) {
                   return dry_n(s) * sign(rim(m, n)) / (1 + std::pow(fading(s, m, n), 2));
                 },
                 15, nullptr},
                {"aerodynamic_drag", "speed squared", true, Stage::transmitted,
                 [](S, M m, N) { return m.at.speed_m_s * std::fabs(m.at.speed_m_s) / 2; }, 900,
                 [](S s) { return -0.7 * of(s, Term::drag); }},
                {"aerodynamic_drag", "speed to the power of 1.7", false, Stage::transmitted,
                 [](S, M m,
                    N) { return sign(m.at.speed_m_s) * std::pow(std::fabs(m.at.speed_m_s), 1.7) / 2; },
                 900, nullptr},
                {"turning_scrub", "the same at any yaw rate", true, Stage::transmitted,
                 [](S s, M m, N n) { return by_moment(s, n, scrub_nm(s) * built_up(s, m)); }, 1.4,
                 [](S s) { return -0.7 * of(s, Term::turning) / scrub_nm(s); }},
                {"turning_scrub", "yaw rate to the power of 0.6", false, Stage::transmitted,
                 [](S s, M m, N n) {
                   const double share = std::fabs(m.at.yaw_rate_rad_s) / s.top_yaw_rad_s;
                   return by_moment(s, n, scrub_nm(s) * sign(m.at.yaw_rate_rad_s) * std::pow(share, 0.6));
                 },
                 1.4, nullptr},
                {"turning_scrub", "a quarter of a sine up to the top yaw rate", false, Stage::transmitted,
                 [](S s, M m, N n) {
                   const double share = std::min(1.0, std::fabs(m.at.yaw_rate_rad_s) / s.top_yaw_rad_s);
                   return by_moment(
                       s, n,
                       scrub_nm(s) * sign(m.at.yaw_rate_rad_s) * std::sin(share * std::numbers::pi / 2));
                 },
                 1.4, nullptr},
                {"chassis_mass_error", "inertia and weight", true, Stage::transmitted,
                 [](S s, M m,
                    N n) { return inertial_n(s, m) + by_moment(s, n, of(s, Term::turning) * built_up(s, m)); },
                 2, by_ratio},
                {"linear_inertia_error", "mass times acceleration", true, Stage::transmitted,
                 [](S s, M m, N) { return inertial_n(s, m); }, 2, by_ratio},
                {"linear_inertia_error", "half as much while braking", false, Stage::transmitted,
                 [](S s, M m, N) { return inertial_n(s, m) * (driving(m) ? 1 : 0.5); }, 2, by_ratio},
                {"gear_efficiency", "of the transmitted torque", true, Stage::gear,
                 [](S, M m, N n) { return std::fabs(m.transmitted_n[n]) * sign(rim(m, n)); }, 0.6, nullptr},
                {"gear_efficiency", "of the motor's whole torque", true, Stage::gear,
                 [](S, M m,
                    N n) { return std::fabs(m.transmitted_n[n] + m.friction_n[n]) * sign(rim(m, n)); },
                 0.6, nullptr},
                {"gear_efficiency", "of the whole torque, half as much while braking", false, Stage::gear,
                 [](S, M m, N n) {
                   const double whole_n = m.transmitted_n[n] + m.friction_n[n];
                   return std::fabs(whole_n) * sign(rim(m, n)) * (whole_n * rim(m, n) > 0 ? 1 : 0.5);
                 },
                 0.6, nullptr},
                {"driver_loss", "share of the motors' power", true, Stage::battery,
                 [](S, M m, N) { return absolute_motor_w(m); }, 0.6, nullptr},
                {"driver_loss", "and a third of its mean at any time", false, Stage::battery,
                 [](S s, M m, N) { return absolute_motor_w(m) + s.motor_power_w / 3; }, 0.6, nullptr},
                {"no_regeneration", "share of the braking power", true, Stage::battery,
                 [](S, M m, N) { return braking_w(m); }, 1, nullptr},
                {"no_regeneration", "below 40 % of the top speed only", false, Stage::battery,
                 [](S s, M m, N) { return std::fabs(m.at.speed_m_s) < 0.4 * s.top_m_s ? braking_w(m) : 0.0; },
                 1, nullptr},
                {"current_sensor_gain", "share of the reading", true, Stage::reading,
                 [](S, M m, N) { return m.power_w; }, 0.3, [](S) { return -0.3; }},
                {"current_sensor_bias", "constant current", true, Stage::reading,
                 [](S, M m, N) { return m.at.voltage_v; }, unbounded, any},
            });

Moment base_moment(const Scene& s, const Instant& at) {
  Moment m{at, {}, {}, {}, 0};
  const double along_n = of(s, Term::inertia) * at.acceleration_m_s2 +
                         of(s, Term::drag) * at.speed_m_s * std::fabs(at.speed_m_s);
  const double turn_nm = of(s, Term::inertia) * s.form.gyration_m2 * at.yaw_acceleration_rad_s2 +
                         of(s, Term::turning) * built_up(s, m);
  for (std::size_t n : {0u, 1u}) {
    m.transmitted_n[n] = along_n / 2 + by_moment(s, n, turn_nm);
    m.friction_n[n] = dry_n(s) * (sign(at.rim_m_s[n]) + s.form.viscous_s_m * at.rim_m_s[n]);
  }
  return m;
}

void add_forces(const Scene& s, std::span<const Planted> planted, Stage stage, Moment& m) {
  std::array<double, 2> gear_n{};
  for (const Planted& p : planted) {
    if (p.form->stage != stage) continue;
    for (std::size_t n : {0u, 1u}) {
      const double force_n = p.strength * p.form->unit(s, m, n);
      (stage == Stage::transmitted ? m.transmitted_n
       : stage == Stage::friction  ? m.friction_n
                                   : gear_n)[n] += force_n;
    }
  }
  for (std::size_t n : {0u, 1u}) m.friction_n[n] += gear_n[n];
}

double added_w(const Scene& s, std::span<const Planted> planted, Stage stage, const Moment& m) {
  double power_w = 0;
  for (const Planted& p : planted) {
    if (p.form->stage == stage) power_w += p.strength * p.form->unit(s, m, 0);
  }
  return power_w;
}

}  // namespace

std::span<const Form> forms() {
  return table;
}

MeteredPower planted_power(const Scene& scene, std::span<const Planted> planted, const Instant& at) {
  Moment m = base_moment(scene, at);
  for (const Stage stage : {Stage::transmitted, Stage::friction, Stage::gear})
    add_forces(scene, planted, stage, m);
  m.power_w = of(scene, Term::idle);
  for (std::size_t n : {0u, 1u}) {
    m.motor_w[n] = (m.transmitted_n[n] + m.friction_n[n]) * at.rim_m_s[n];
    m.power_w += m.motor_w[n];
  }
  m.power_w += added_w(scene, planted, Stage::battery, m);
  return {m.power_w, m.power_w + added_w(scene, planted, Stage::reading, m)};
}

std::optional<Planted> planted_at(const Scene& scene, const Form& form, double gap, bool downward,
                                  std::span<const Instant> instants) {
  if (downward && form.least == nullptr) return std::nullopt;
  // One effect alone adds in proportion to its strength.
  Planted planted{&form, downward ? -1e-3 : 1e-3, 0};
  double added = 0;
  for (const Instant& at : instants) {
    added += std::fabs(planted_power(scene, {&planted, 1}, at).read_w - planted_power(scene, {}, at).read_w);
  }
  added /= static_cast<double>(instants.size()) * scene.base_power_w;
  if (!(added > 0)) return std::nullopt;
  planted.strength *= gap / added;
  planted.gap = gap;
  if (planted.strength > form.most || (downward && planted.strength < form.least(scene))) return std::nullopt;
  return planted;
}

Scene scene_of(const MotionLog& log, const BaseFit& fit, virtual_robot::Rng& rng) {
  Scene s;
  s.form = fit.form;
  s.base = fit.base;
  s.half_track_m = log.kinematics.kinematics.half_track_m;
  const std::vector<Instant> instants = log.all_instants();
  std::vector<double> speeds, yaws, volts;
  for (const Instant& at : instants) {
    speeds.push_back(std::max(std::fabs(at.rim_m_s[0]), std::fabs(at.rim_m_s[1])));
    yaws.push_back(std::fabs(at.yaw_rate_rad_s));
    volts.push_back(at.voltage_v);
    s.base_power_w += std::fabs(base_power_w(s.form, s.base, at)) / static_cast<double>(instants.size());
    Moment m = base_moment(s, at);
    for (std::size_t n : {0u, 1u}) {
      s.motor_power_w += std::fabs((m.transmitted_n[n] + m.friction_n[n]) * at.rim_m_s[n]) /
                         static_cast<double>(instants.size());
    }
  }
  s.top_m_s = std::max(quantile_of(std::move(speeds), 0.95), 1e-3);
  s.top_yaw_rad_s = std::max(quantile_of(std::move(yaws), 0.95), 1e-3);
  s.nominal_voltage_v = quantile_of(std::move(volts), 0.5);
  s.slow_m_s = rng.uniform(0.05, 0.25) * s.top_m_s;
  s.slow_exponent = rng.chance(0.5) ? 1 : 2;
  return s;
}

double likeness(const Scene& scene, const Planted& a, const Planted& b, std::span<const Instant> instants) {
  double aa = 0, bb = 0, ab = 0;
  for (const Instant& at : instants) {
    const double base_w = planted_power(scene, {}, at).read_w;
    const double by_a = planted_power(scene, {&a, 1}, at).read_w - base_w;
    const double by_b = planted_power(scene, {&b, 1}, at).read_w - base_w;
    aa += by_a * by_a;
    bb += by_b * by_b;
    ab += by_a * by_b;
  }
  return aa > 0 && bb > 0 ? ab / std::sqrt(aa * bb) : 0;
}

}  // namespace joulecast::trial::motion

#include "tests/study/corrections/witnesses.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace joulecast::gap::corrections {
namespace {

using windows::missing;
using windows::Window;

constexpr double seconds_a_row = 2, most_independent = 60, fewest_independent = 8;
constexpr std::size_t most_rows = 300;  // of each kind
constexpr double block_s = 15;
constexpr double least_part = 0.2;    // of a witness's rows, that a hypothesis must leave
constexpr double steepest_rad = 0.3;  // of the floors that wheeled robots drive
constexpr double scrub_width_rad_s = 0.02;
constexpr double resting_rad_s = 0.03, moving_rad_s = 0.1;

constexpr Eigen::Index column(Witness w, std::size_t side = 0) {
  return static_cast<Eigen::Index>(static_cast<std::size_t>(w) + side);
}

template <class Rows, class Of>
std::vector<double> known(const Rows& rows, Of&& of) {
  std::vector<double> all;
  for (const auto& row : rows) {
    if (const double v = of(row); std::isfinite(v)) all.push_back(v);
  }
  return all;
}

double mean(const std::vector<double>& v) {
  double sum = 0;
  for (const double x : v) sum += x;
  return v.empty() ? 0 : sum / static_cast<double>(v.size());
}

// The value below which a part of |v| is; 0 of none.
double below(std::vector<double> v, double part) {
  if (v.empty()) return 0;
  for (double& x : v) x = std::fabs(x);
  const auto at = v.begin() + static_cast<std::ptrdiff_t>(part * static_cast<double>(v.size() - 1));
  std::ranges::nth_element(v, at);
  return *at;
}

bool varies(const std::vector<double>& v) {
  return !v.empty() && std::ranges::max(v) > std::ranges::min(v);
}

// Without a heading, the progress over a second is the distance of two positions.
void travel_by_positions(std::vector<Window>& windows) {
  constexpr double span_s = 1, least_m = 0.05;
  for (std::size_t k = 0; k < windows.size();) {
    Window& w = windows[k++];
    std::array<double, 2> angle{};
    std::size_t n = k;
    for (; n < windows.size() && windows[n].continues && !windows[n].reading; ++n) {
      const double dt = windows[n].t_s - windows[n - 1].t_s;
      for (const std::size_t s : {0u, 1u})
        angle[s] += dt * (windows[n].speed_rad_s[s] + windows[n - 1].speed_rad_s[s]) / 2;
      if (windows[n].t_s - w.t_s < span_s - 1e-6) continue;
      const double distance = std::hypot(windows[n].x_m - w.x_m, windows[n].y_m - w.y_m);
      if (distance > least_m) {
        w.forward_m = std::copysign(distance, angle[0] + angle[1]);
        w.span_angle_rad = angle;
        w.chord = 1;
      }
      k = n;
      break;
    }
  }
}

}  // namespace

Witnesses::Witnesses(const telemetry::RecordingSet& recordings, const robot::RobotModel& robot)
    : recordings_(recordings),
      robot_(robot),
      drive_(robot, dynamics::active_effects(robot).value_or(std::vector<dynamics::ActiveEffect>{})),
      file_(drive_.parameters()),
      readings_(windows::find_readings(recordings.missions)) {
  std::vector<Row>& rows = rebuilt_[nullptr] = rows_of(recordings_, most_rows);
  double length_s = 0;
  for (const telemetry::Recording& m : recordings_.missions) length_s += telemetry::length_s(m);
  usable_ = rows.size() >= 40;
  if (!usable_) return;
  const auto has = [&](auto&& of) {
    const std::vector<double> v = known(rows, of);
    return static_cast<double>(v.size()) > least_part * 0.2 * static_cast<double>(rows.size()) && varies(v);
  };
  measured_.wheels = true;
  measured_.motor_voltages = has([](const Row& r) { return r.voltage[0] + r.voltage[1]; });
  measured_.motor_currents = has([](const Row& r) { return r.current[0] + r.current[1]; });
  measured_.motor_currents_negative =
      std::ranges::any_of(rows, [](const Row& r) { return std::min(r.current[0], r.current[1]) < 0; });
  measured_.battery_current_negative =
      std::ranges::any_of(rows, [](const Row& r) { return r.battery_current < 0; });
  measured_.battery_voltage = has([](const Row& r) { return r.battery_voltage; });
  measured_.battery_current = has([](const Row& r) { return r.battery_current; });
  measured_.yaw_rate = has([](const Row& r) { return r.yaw_rate; });
  measured_.position = has([](const Row& r) { return r.travel; });
  measured_.heading = has([](const Row& r) { return r.turn; });
  measured_.pitch = std::ranges::any_of(recordings_.missions,
                                        [](const telemetry::Recording& m) {
                                          return std::ranges::any_of(m.samples, [](const auto& s) {
                                            return std::isfinite(s.pitch_rad);
                                          });
                                        }) &&
                    has([](const Row& r) { return r.climb; });
  measured_.battery_period_s = readings_.battery_held ? readings_.period_s : readings_.row_s;
  choose_unknowns();
  independent_.assign(witness_count,
                      std::clamp(length_s / seconds_a_row, fewest_independent, most_independent));
  for (const Witness w :
       {Witness::voltage_right, Witness::voltage_left, Witness::current_right, Witness::current_left})
    independent_[static_cast<std::size_t>(w)] *= 0.5;
  independent_[static_cast<std::size_t>(Witness::battery_voltage)] *= 0.3;  // its chemistry is slow
  fewest_.assign(witness_count, 0);
  Comparison all;
  compare({}, Eigen::VectorXd::Zero(static_cast<Eigen::Index>(unknowns_.size())), all);
  for (std::size_t w = 0; w < witness_count; ++w) {
    const auto col = static_cast<Eigen::Index>(w);
    const auto count = static_cast<double>((all.residual.col(col) + all.reading.col(col)).isFinite().count());
    if (count <= 20) independent_[w] = 0;
    fewest_[w] = least_part * count;
  }
}

std::vector<Witnesses::Row> Witnesses::rows_of(const telemetry::RecordingSet& recordings,
                                               std::size_t most) const {
  std::vector<Window> windows = windows::make_windows(recordings.missions, robot_, readings_);
  std::erase_if(windows, [](const Window& w) { return !std::isfinite(w.speed_rad_s[0] + w.speed_rad_s[1]); });
  if (std::ranges::none_of(windows, [](const Window& w) { return std::isfinite(w.heading_rad); }))
    travel_by_positions(windows);
  std::vector<bool> keep(windows.size(), false);
  const auto thin = [&](auto&& kind) {
    const auto count = static_cast<std::size_t>(std::ranges::count_if(windows, kind));
    const std::size_t each = std::max<std::size_t>(count / most, 1);
    for (std::size_t k = 0, n = 0; k < windows.size(); ++k) {
      if (kind(windows[k])) keep[k] = keep[k] || n++ % each == 0;
    }
  };
  thin([](const Window& w) { return !w.reading; });
  thin([](const Window& w) { return w.reading; });
  thin([](const Window& w) { return std::isfinite(w.forward_m) || std::isfinite(w.turn_rad); });
  std::vector<Row> rows;
  for (std::size_t k = 0; k < windows.size(); ++k) {
    if (!keep[k]) continue;
    const Window& w = windows[k];
    Row& r = rows.emplace_back();
    r.mission = w.mission;
    r.t_s = w.t_s;
    r.payload_kg = w.payload_kg;
    r.speed = w.speed_rad_s;
    r.acceleration = w.acceleration_rad_s2;
    r.span = w.span_angle_rad;
    r.moving = w.moving;
    r.resting = w.resting;
    r.voltage = w.motors_apart ? std::array{missing, missing} : w.voltage_v;
    r.current = w.motors_apart ? std::array{missing, missing} : w.current_a;
    r.current_slope = w.current_slope_a_s;
    r.power = w.motor_power_w;
    r.power_abs = w.motor_power_abs_w;
    r.braking = w.braking_w;
    r.sign = w.current_sign;
    r.battery_voltage = w.battery_voltage_v;
    r.battery_current = w.battery_current_a;
    r.battery_power = w.battery_power_w;
    r.charge = w.charge_as;
    r.yaw_rate = w.yaw_rate_rad_s;
    r.travel = w.forward_m;
    r.turn = w.turn_rad;
    r.chord = w.chord;
    r.climb = w.climb_rad;
  }
  return rows;
}

// Delays and headings act on recordings, all other errors on rows.
const std::vector<Witnesses::Row>& Witnesses::recorded(std::span<const Error> errors) {
  const Hypothesis* of = nullptr;
  for (const Error& e : errors) {
    if (e.what->kind == Kind::delay || e.what->of == Quantity::heading) of = e.what;
  }
  const auto at = rebuilt_.find(of);
  if (at != rebuilt_.end()) return at->second;
  telemetry::RecordingSet changed = recordings_;
  for (telemetry::Recording& m : changed.missions) remove_error(*of, 0, robot_, {}, m);
  return rebuilt_[of] = rows_of(changed, most_rows);
}

void Witnesses::remove(const Error& error, Row& row) const {
  const Hypothesis& h = *error.what;
  const double f = h.factor_at(error.value);
  const auto each = [&](auto&& change) {
    for (const std::size_t s : {0u, 1u}) {
      if (h.side[s]) change(s);
    }
  };
  const auto scaled_power = [&](std::size_t s) {
    row.power[s] /= f;
    row.power_abs[s] /= std::fabs(f);
    row.braking[s] = f < 0 ? std::max(-row.power[s], 0.0) : row.braking[s] / f;
  };
  if (h.kind == Kind::swapped) {
    if (h.of == Quantity::wheel_velocity) {
      std::swap(row.speed[0], row.speed[1]);
      std::swap(row.acceleration[0], row.acceleration[1]);
      std::swap(row.span[0], row.span[1]);
      std::swap(row.moving[0], row.moving[1]);
      std::swap(row.resting[0], row.resting[1]);
      return;
    }
    std::swap(row.voltage[0], row.voltage[1]);
    if (h.of == Quantity::motor_current) {
      std::swap(row.voltage[0], row.voltage[1]);
      std::swap(row.current[0], row.current[1]);
      std::swap(row.current_slope[0], row.current_slope[1]);
      std::swap(row.sign[0], row.sign[1]);
    }
    each([&](std::size_t s) {
      row.power[s] = row.voltage[s] * row.current[s];
      row.power_abs[s] = std::fabs(row.power[s]);
      row.braking[s] = std::max(-row.power[s], 0.0);
    });
    return;
  }
  switch (h.of) {
    case Quantity::wheel_velocity:
      each([&](std::size_t s) {
        row.speed[s] /= f;
        row.acceleration[s] /= f;
        row.span[s] /= f;
        if (std::fabs(f) == 1) return;
        row.resting[s] = std::fabs(row.speed[s]) < resting_rad_s;
        row.moving[s] = std::fabs(row.speed[s]) > moving_rad_s;
      });
      break;
    case Quantity::motor_voltage:
      if (h.kind == Kind::supply) break;
      each([&](std::size_t s) {
        const double inductive_v = robot_.motor.inductance_h * row.current_slope[s];
        row.voltage[s] = (row.voltage[s] + inductive_v) / f - inductive_v;
        scaled_power(s);
      });
      break;
    case Quantity::motor_current:
      if (h.kind == Kind::offset) break;
      each([&](std::size_t s) {
        if (h.kind == Kind::rectified) {
          const double sign = current_sign(row.voltage[s], row.speed[s], file_.voltage_constant_v_s_rad) *
                              (row.current[s] < 0 ? -1 : 1);
          row.current[s] *= sign;
          row.current_slope[s] *= sign;
          row.sign[s] = row.current[s] < 0 ? -1 : 1;
          row.power[s] = row.voltage[s] * row.current[s];
          row.braking[s] = std::max(-row.power[s], 0.0);
          return;
        }
        row.voltage[s] += robot_.motor.inductance_h * row.current_slope[s] * (1 - 1 / f);
        row.current[s] /= f;
        row.current_slope[s] /= f;
        row.sign[s] = std::copysign(row.sign[s], row.sign[s] * f);
        scaled_power(s);
      });
      break;
    case Quantity::battery_voltage:
      row.battery_voltage /= f;
      row.battery_power /= f;
      break;
    case Quantity::battery_current:
      row.battery_current /= f;
      row.battery_power /= f;
      row.charge /= f;
      break;
    case Quantity::yaw_rate:
      row.yaw_rate /= f;
      break;
    case Quantity::position:
      row.travel /= f;
      break;
    case Quantity::pitch:
      row.climb /= f;
      break;
    case Quantity::heading:
    case Quantity::battery_power:
      break;
  }
}

void Witnesses::derive(Row& row) const {
  dynamics::Instant at;
  at.payload_kg = row.payload_kg;
  at.climb_rad = row.climb;
  for (const std::size_t s : {0u, 1u}) {
    if (row.resting[s]) row.speed[s] = row.acceleration[s] = 0;
    row.direction[s] = dynamics::smooth_sign(row.speed[s], dynamics::friction_width_rad_s);
  }
  at.wheel_speed_rad_s = row.speed;
  at.wheel_acceleration_rad_s2 = row.acceleration;
  const auto balance = drive_.balance(at);
  for (const std::size_t s : {0u, 1u})
    row.load_nm[s] = balance.total_nm[s] - balance.inertial_nm[s] - balance.friction_nm[s];
  row.turning = dynamics::smooth_sign(balance.body.yaw_rate_rad_s, scrub_width_rad_s);
}

// The readings to which residuals are relative; of the battery their variation.
void Witnesses::read(Rows& rows) const {
  rows.reading.resize(static_cast<Eigen::Index>(rows.rows.size()), witness_count);
  const double power = mean(known(rows.rows, [](const Row& r) { return r.battery_power; }));
  const double voltage = mean(known(rows.rows, [](const Row& r) { return r.battery_voltage; }));
  for (std::size_t k = 0; k < rows.rows.size(); ++k) {
    const Row& r = rows.rows[k];
    const auto at = static_cast<Eigen::Index>(k);
    rows.reading.row(at) << r.voltage[0], r.voltage[1], r.current[0], r.current[1], r.battery_power - power,
        r.battery_voltage - voltage, r.yaw_rate - rows.offset_yaw, r.travel, r.turn;
  }
}

const Witnesses::Rows& Witnesses::corrected(std::span<const Error> errors) {
  std::vector<std::pair<const Hypothesis*, double>> key;
  for (const Error& e : errors) key.emplace_back(e.what, e.what->free() ? e.value : 0);
  if (made_any_ && key == made_for_) return made_;
  made_ = {};
  made_.rows = recorded(errors);
  for (const Error& e : errors) {
    const Hypothesis& h = *e.what;
    if (h.kind == Kind::offset)
      (h.of == Quantity::yaw_rate ? made_.offset_yaw : made_.offset_current) = e.value;
    if (h.kind == Kind::supply) made_.supply = true;
    if (h.kind == Kind::rectified && h.of == Quantity::battery_current) made_.rectified = true;
    for (Row& row : made_.rows) remove(e, row);
  }
  for (Row& row : made_.rows) {
    row.block = row.mission * 40 + std::min<std::size_t>(static_cast<std::size_t>(row.t_s / block_s), 39);
    derive(row);
  }
  read(made_);
  made_for_ = std::move(key);
  made_any_ = true;
  return made_;
}

void Witnesses::choose_unknowns() {
  const Rows& rows = corrected({});
  const robot::Limits& limits = robot_.limits;
  const double most_nm = limits.current_a * file_.torque_constant_nm_a, speed = limits.speed_m_s;
  const double most_rad_s = speed / file_.wheel_radius_m[0], volts = file_.battery_voltage_v;
  const double dry = (file_.friction_torque_nm[0] + file_.friction_torque_nm[1]) / 2;
  const double drag = 2 * most_nm / file_.wheel_radius_m[0] / (speed * speed);
  const auto add = [&](Physical what, double sd, double wall, bool positive = false) {
    which_.push_back(what);
    unknowns_.push_back({sd, wall, positive, true});
  };
  using P = Physical;
  add(P::base_load, 2 * robot_.idle_power_w + 0.03 * limits.current_a * volts, 2 * limits.current_a * volts);
  if (dry > 0.005 * most_nm) add(P::dry, 0.5, 3);
  if (dry <= 0.03 * most_nm) add(P::dry_more, 0.03 * most_nm, 0.5 * most_nm, true);
  if (file_.viscous_friction_nm_s_rad * most_rad_s > 0.005 * most_nm) add(P::viscous, 0.7, 4);
  add(P::viscous_more, 0.03 * most_nm / most_rad_s, most_nm / most_rad_s, true);
  add(P::mass, 0.2, 1.6);
  add(P::resistance, 0.4, 2.3);
  add(P::drag, 0.03 * drag, drag, true);
  add(P::unreturned, 0.2, 1);
  add(P::driver_loss, 0.12, 0.9, true);
  if (measured_.motor_voltages || measured_.motor_currents) add(P::constant, 0.08, 0.7);
  const auto size = [&](double sign) {
    return mean(known(rows.rows, [&](const Row& r) { return std::fabs(r.speed[0] + sign * r.speed[1]); }));
  };
  if (size(-1) > 0.02 * (size(1) + size(-1))) {
    add(P::scrub, 0.3, 2, true);
    add(P::yaw_inertia, 0.4, 2);
    turns_ = true;
  }
  if (varies(known(rows.rows, [](const Row& r) { return r.climb; }))) add(P::grade, 0.7, 2, true);
  if (measured_.battery_voltage) {
    add(P::battery_resistance, 1.5, 6);
    add(P::battery_level, 0.1, 0.5);
    add(P::battery_drift, 0.5 * volts / (3600 * robot_.battery.capacity_ah), 1e9);
  }
  if (measured_.yaw_rate || measured_.position || measured_.heading) {
    add(P::radius, 0.03, 0.3);
    add(P::track, 0.06, 1);
  }
}

std::array<double, physical_count> Witnesses::physical(const Eigen::VectorXd& x) const {
  std::array<double, physical_count> q{};
  for (std::size_t k = 0; k < which_.size(); ++k) {
    const double v = x[static_cast<Eigen::Index>(k)];
    double& to = q[static_cast<std::size_t>(which_[k])];
    switch (which_[k]) {
      case Physical::dry:
      case Physical::viscous:
      case Physical::mass:
      case Physical::resistance:
      case Physical::constant:
      case Physical::yaw_inertia:
      case Physical::battery_resistance:
      case Physical::battery_level:
      case Physical::radius:
      case Physical::track:
        to = std::expm1(which_[k] == Physical::constant ? -v : v);
        break;
      default:
        to = v;
    }
  }
  return q;
}

Witnesses::Predicted Witnesses::predict(const Row& r, const std::array<double, physical_count>& q) const {
  const auto of = [&](Physical p) { return q[static_cast<std::size_t>(p)]; };
  const double grip = 1 - file_.slip, larger = 1 + of(Physical::radius);
  const std::array<double, 2> radius{file_.wheel_radius_m[0] * larger, file_.wheel_radius_m[1] * larger};
  const double half = file_.half_track_m * (1 + of(Physical::track));
  const auto forward = [&](const std::array<double, 2>& w) {
    return grip * (radius[0] * w[0] + radius[1] * w[1]) / 2;
  };
  const auto turning = [&](const std::array<double, 2>& w) {
    return grip * (radius[0] * w[0] - radius[1] * w[1]) / (2 * half);
  };
  const double v = forward(r.speed), yaw = turning(r.speed);
  const double chassis = file_.chassis_kg * (1 + of(Physical::mass));
  const double payload = file_.payload_factor * r.payload_kg + file_.payload_extra_kg;
  const double mass = chassis + 2 * file_.wheel_kg + payload, weight = mass * robot::standard_gravity_m_s2;
  const double coupling = chassis * file_.com_offset_m;
  const double inertia =
      file_.yaw_inertia_kg_m2 * (1 + of(Physical::yaw_inertia)) + payload * robot::payload_yaw_inertia_m2;
  double force = mass * file_.inertial_factor * forward(r.acceleration) - coupling * yaw * yaw +
                 of(Physical::drag) * v * std::fabs(v);
  if (const double grade = of(Physical::grade); grade != 0 && std::isfinite(r.climb))
    force += grade * weight * std::sin(r.climb);
  const double moment = inertia * turning(r.acceleration) + coupling * v * yaw +
                        of(Physical::scrub) * weight * half / 2 * r.turning;
  const double constant = 1 + of(Physical::constant);
  Predicted p;
  p.power = file_.idle_power_w + file_.accessory_power_w +
            std::max(of(Physical::base_load), -file_.idle_power_w - file_.accessory_power_w);
  const bool still = r.resting[0] && r.resting[1];
  for (const std::size_t s : {0u, 1u}) {
    const double side = s == 0 ? 1 : -1;
    const double dry = file_.friction_torque_nm[s] * (1 + of(Physical::dry)) + of(Physical::dry_more);
    const double viscous =
        file_.viscous_friction_nm_s_rad * (1 + of(Physical::viscous)) + of(Physical::viscous_more);
    const double torque = radius[s] * (force / 2 + side * moment / (2 * half)) +
                          file_.wheel_inertia_kg_m2 * r.acceleration[s] + dry * r.direction[s] +
                          viscous * r.speed[s] + r.load_nm[s];
    p.current[s] = torque / (file_.torque_constant_nm_a * constant);
    p.voltage[s] = file_.resistance_ohm[s] * (1 + of(Physical::resistance)) * p.current[s] +
                   file_.voltage_constant_v_s_rad * constant * r.speed[s] +
                   file_.brush_drop_v * dynamics::smooth_sign(p.current[s], dynamics::brush_width_a);
    if (still || r.resting[s]) continue;
    const double w = p.current[s] * p.voltage[s];
    p.power += w + (file_.driver_loss + of(Physical::driver_loss)) * std::fabs(w) +
               (file_.unreturned + of(Physical::unreturned)) * std::max(-w, 0.0);
  }
  p.power *= (1 + file_.battery_voltage.gain) * (1 + file_.battery_current.gain);
  return p;
}

void Witnesses::compare(const Rows& rows, const Row& r, const std::array<double, physical_count>& q,
                        Eigen::Index at, Eigen::ArrayXXd& residual) const {
  const auto of = [&](Physical p) { return q[static_cast<std::size_t>(p)]; };
  const Predicted p = predict(r, q);
  const double constant = file_.voltage_constant_v_s_rad * (1 + of(Physical::constant));
  std::array<double, 2> power{}, power_abs{}, braking{};
  for (const std::size_t s : {0u, 1u}) {
    const double resistance = file_.resistance_ohm[s] * (1 + of(Physical::resistance));
    double& volts = residual(at, column(Witness::voltage_right, s));
    double& amps = residual(at, column(Witness::current_right, s));
    const double current = r.current[s] - rows.offset_current;
    const bool sure = r.resting[s] || std::fabs(r.sign[s]) > 0.9;
    amps = r.moving[s] ? current - p.current[s] : missing;
    const double needed = resistance * current + constant * r.speed[s] + file_.brush_drop_v * r.sign[s];
    power[s] = r.power[s] - rows.offset_current * r.voltage[s];
    power_abs[s] = r.power_abs[s];
    braking[s] = r.braking[s];
    if (rows.supply) {
      volts = std::fabs(r.voltage[s]) - r.battery_voltage;
      power[s] = needed * current;
      power_abs[s] = std::fabs(power[s]);
      braking[s] = std::max(-power[s], 0.0);
    } else if (measured_.motor_currents) {
      volts = sure ? r.voltage[s] - needed : missing;
    } else {
      volts = r.moving[s] || r.resting[s] ? r.voltage[s] - (r.resting[s] ? 0 : p.voltage[s]) : missing;
    }
  }
  double needed_w = file_.idle_power_w + file_.accessory_power_w +
                    std::max(of(Physical::base_load), -file_.idle_power_w - file_.accessory_power_w);
  for (const std::size_t s : {0u, 1u})
    needed_w += power[s] + (file_.driver_loss + of(Physical::driver_loss)) * power_abs[s] +
                (file_.unreturned + of(Physical::unreturned)) * braking[s];
  if (!measured_.motor_currents || !std::isfinite(needed_w)) needed_w = p.power;
  residual(at, column(Witness::power)) =
      rows.rectified ? r.battery_power - std::fabs(needed_w) : r.battery_power - needed_w;
  const double drawn = rows.rectified ? std::copysign(r.battery_current, p.power) : r.battery_current;
  residual(at, column(Witness::battery_voltage)) =
      measured_.battery_voltage
          ? r.battery_voltage - file_.battery_voltage_v * (1 + of(Physical::battery_level)) +
                file_.battery_resistance_ohm * (1 + of(Physical::battery_resistance)) * drawn +
                of(Physical::battery_drift) * r.charge
          : missing;
  const double grip = 1 - file_.slip, larger = 1 + of(Physical::radius);
  const double right = file_.wheel_radius_m[0] * larger * grip,
               left = file_.wheel_radius_m[1] * larger * grip;
  const double track = 2 * file_.half_track_m * (1 + of(Physical::track));
  residual(at, column(Witness::gyro)) =
      r.yaw_rate - rows.offset_yaw - (right * r.speed[0] - left * r.speed[1]) / track;
  residual(at, column(Witness::travel)) = r.travel - r.chord * (right * r.span[0] + left * r.span[1]) / 2;
  residual(at, column(Witness::turn)) = r.turn - (right * r.span[0] - left * r.span[1]) / track;
}

void Witnesses::compare(std::span<const Error> errors, const Eigen::VectorXd& x, Comparison& out) {
  const Rows& rows = corrected(errors);
  const auto q = physical(x);
  out.reading = rows.reading;
  out.residual.resize(out.reading.rows(), out.reading.cols());
  for (std::size_t k = 0; k < rows.rows.size(); ++k)
    compare(rows, rows.rows[k], q, static_cast<Eigen::Index>(k), out.residual);
}

double Witnesses::limits(std::span<const Error> errors) {
  const Rows& made = corrected(errors);
  const robot::Limits& limits = robot_.limits;
  const double radius = file_.wheel_radius_m[0], volts = 1.2 * file_.battery_voltage_v;
  const auto top = [&](auto&& of) { return below(known(made.rows, of), 0.98); };
  double sum = 0;
  const auto within = [&](double most, double limit, double sd) {
    if (most > limit && limit > 0) sum -= std::pow(std::log(most / limit) / sd, 2) / 2;
  };
  double fastest = 0;
  for (const std::size_t s : {0u, 1u}) {
    const double speed = radius * top([&](const Row& r) { return r.speed[s]; });
    fastest = std::max(fastest, speed);
    within(speed, limits.speed_m_s, 0.3);
    within(top([&](const Row& r) { return r.current[s]; }), limits.current_a, 0.3);
    within(top([&](const Row& r) { return r.voltage[s]; }), volts, 0.2);
  }
  within(top([](const Row& r) { return r.battery_current; }), 2 * limits.current_a, 0.5);
  within(top([](const Row& r) { return r.climb; }), steepest_rad, 0.3);
  const auto yaw = [&](const Row& r) {
    return radius * (r.speed[0] - r.speed[1]) / (2 * file_.half_track_m);
  };
  within(top(yaw), limits.yaw_rate_rad_s > 0 ? limits.yaw_rate_rad_s : 9, 0.3);
  // Robots drive forwards: 20 to 1.
  if (mean(known(made.rows, [](const Row& r) { return r.speed[0] + r.speed[1]; })) < 0) sum -= std::log(20.0);
  // A robot that stays far below its limit is unusual: Student's t of the logarithm, sd 1.5.
  if (fastest < limits.speed_m_s)
    sum -= 1.5 * std::log1p(std::pow(std::log(std::max(fastest, 1e-9) / limits.speed_m_s) / 1.5, 2) / 2);
  return sum;
}

std::vector<std::size_t> Witnesses::blocks(std::span<const Error> errors) {
  std::vector<std::size_t> all;
  for (const Row& row : corrected(errors).rows) all.push_back(row.block);
  return all;
}

double Witnesses::start_of(const Hypothesis& h) {
  if (h.kind == Kind::offset) return 0;
  const std::vector<Row>& rows = recorded({});
  const auto yaw = [&](const Row& r) {
    return file_.wheel_radius_m[0] * (r.speed[0] - r.speed[1]) / (2 * file_.half_track_m);
  };
  double factor = 1;
  if (h.of == Quantity::wheel_velocity && measured_.position) {
    std::vector<double> ratio;
    for (const Row& r : rows) {
      if (std::isfinite(r.travel) && std::fabs(r.travel) > 0.05)
        ratio.push_back(std::fabs(file_.wheel_radius_m[0] * (r.span[0] + r.span[1]) / 2 / r.travel));
    }
    if (ratio.size() > 10) factor = below(ratio, 0.5);
  } else if ((h.of == Quantity::wheel_velocity || h.of == Quantity::yaw_rate) && measured_.yaw_rate) {
    double cross = 0, wheels = 0, gyro = 0;
    for (const Row& r : rows) {
      if (!std::isfinite(r.yaw_rate)) continue;
      cross += yaw(r) * r.yaw_rate;
      wheels += yaw(r) * yaw(r);
      gyro += r.yaw_rate * r.yaw_rate;
    }
    factor = std::fabs(cross) / (h.of == Quantity::yaw_rate ? wheels : gyro);
  }
  return std::isfinite(factor) && factor > 0 ? std::log(factor) : 0;
}

std::vector<std::uint8_t> Witnesses::returned(std::span<const Error> errors, const Eigen::VectorXd& x,
                                              std::size_t mission) {
  const auto& samples = recordings_.missions[mission].samples;
  std::vector<std::uint8_t> all(samples.size(), 0);
  telemetry::RecordingSet one;
  one.missions = {recordings_.missions[mission]};
  std::vector<Row> rows = rows_of(one, std::numeric_limits<std::size_t>::max());
  std::erase_if(rows, [](const Row& r) { return !std::isfinite(r.speed[0] + r.speed[1]); });
  std::ranges::sort(rows, {}, &Row::t_s);
  if (rows.empty()) return all;
  const auto q = physical(x);
  std::vector<std::uint8_t> negative;
  for (Row& row : rows) {
    for (const Error& e : errors) remove(e, row);
    derive(row);
    negative.push_back(predict(row, q).power < 0 ? 1 : 0);
  }
  std::size_t at = 0;
  for (std::size_t k = 0; k < samples.size(); ++k) {
    const double t_s = 1e-6 * static_cast<double>(samples[k].utime_us - samples.front().utime_us);
    while (at + 1 < rows.size() && std::fabs(rows[at + 1].t_s - t_s) <= std::fabs(rows[at].t_s - t_s)) ++at;
    all[k] = negative[at];
  }
  return all;
}

}  // namespace joulecast::gap::corrections

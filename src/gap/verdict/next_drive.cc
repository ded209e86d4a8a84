#include "gap/verdict/next_drive.h"

#include <algorithm>
#include <cmath>

#include "gap/verdict/words.h"

namespace joulecast::gap {
namespace {

constexpr double step_s = 0.2;
constexpr std::size_t first_drives_named = 3;
// A Bayes factor of 3, below which evidence is not worth more than a bare mention (Kass and Raftery 1995).
const double least_log_evidence = std::log(3.0);

// Ramp up, hold, ramp down; speeds of the body.
struct Leg {
  double speed, yaw, acceleration, hold_s;
  double payload_kg = 0;
  double heading = missing;  // to which the robot turns before; NaN: it stays
};

struct Manoeuvre {
  std::string text;
  std::vector<Leg> legs;
};

std::vector<Manoeuvre> manoeuvres(const robot::Limits& limit) {
  const double v = 0.9 * limit.speed_m_s, a = 0.8 * limit.acceleration_m_s2, w = 0.9 * limit.yaw_rate_rad_s;
  std::vector<Manoeuvre> list;
  const auto add = [&](std::string text) -> std::vector<Leg>& {
    return list.emplace_back(std::move(text), std::vector<Leg>{}).legs;
  };
  add("60 s at rest with everything switched on") = {{0, 0, a, 60}};
  auto* legs = &add("straight legs at 20, 50 and 100 % of the speed limit, 8 s each, twice");
  for (const double part : {0.2, 0.5, 1.0, 0.2, 0.5, 1.0}) legs->push_back({part * v, 0, a, 8});
  legs = &add("six starts and stops, hard and gentle in turn");
  for (int k = 0; k < 6; ++k) legs->push_back({v, 0, k % 2 == 0 ? a : 0.3 * a, 1});
  legs = &add("turns in place both ways at 30 and 100 % of the yaw rate limit, 6 s each");
  for (const double part : {0.3, 1.0, -0.3, -1.0}) legs->push_back({0, part * w, a, 6});
  legs = &add("arcs to the left and to the right, 10 s each");
  for (const double part : {1.0, -1.0}) legs->push_back({0.6 * v, part * 0.6 * w, 0.6 * a, 10});
  if (limit.payload_kg > 0) {
    legs = &add("the same leg and turn with no, half and full payload");
    for (const double part : {0.0, 0.5, 1.0}) {
      legs->push_back({0.6 * v, 0, a, 8, part * limit.payload_kg});
      legs->push_back({0, 0.6 * w, a, 4, part * limit.payload_kg});
    }
  }
  legs = &add("legs in eight headings over one place");
  for (int k = 0; k < 8; ++k) legs->push_back({0.6 * v, 0, a, 5, 0, k * 0.785398});
  add("five minutes of driving without a halt").assign(12, {v, 0, a, 20});
  return list;
}

// The windows of these legs by the nominal model.
std::vector<Window> driven(const robot::RobotModel& robot, const std::vector<Leg>& legs) {
  const dynamics::DriveModel model(robot, {});
  const double r = robot.kinematics.wheel_radius_m, l = robot.kinematics.half_track_m;
  std::vector<Window> windows;
  decltype(Window::copper_heat_w) heat{};
  double time_s = 0, x_m = 0, y_m = 0, heading = 0;
  for (const Leg& leg : legs) {
    if (std::isfinite(leg.heading)) heading = leg.heading;
    const double ramp_s = std::max(std::fabs(leg.speed), l * std::fabs(leg.yaw)) / leg.acceleration;
    struct Phase {
      double from, rise, duration_s;  // share of the speeds at its begin, change over it
    };
    for (const Phase& phase : {Phase{0, 1, ramp_s}, {1, 0, leg.hold_s}, {1, -1, ramp_s}}) {
      const double acceleration = phase.rise == 0 ? 0 : phase.rise * leg.speed / ramp_s;
      const double yaw_acceleration = phase.rise == 0 ? 0 : phase.rise * leg.yaw / ramp_s;
      for (double t = 0.5 * step_s; t < phase.duration_s; t += step_s) {
        const double v = phase.from * leg.speed + acceleration * t;
        const double w = phase.from * leg.yaw + yaw_acceleration * t;
        Window n;
        n.t_s = time_s += step_s;
        n.continues = true;
        n.payload_kg = leg.payload_kg;
        n.speed_rad_s = {(v + l * w) / r, (v - l * w) / r};
        n.acceleration_rad_s2 = {(acceleration + l * yaw_acceleration) / r,
                                 (acceleration - l * yaw_acceleration) / r};
        heading += w * step_s;
        n.x_m = x_m += v * std::cos(heading) * step_s;
        n.y_m = y_m += v * std::sin(heading) * step_s;
        n.heading_rad = heading;
        dynamics::Instant at;
        at.wheel_speed_rad_s = n.speed_rad_s;
        at.wheel_acceleration_rad_s2 = n.acceleration_rad_s2;
        at.payload_kg = leg.payload_kg;
        const auto flow = model.flow(at);
        for (std::size_t s : {0u, 1u}) {
          n.moving[s] = std::fabs(n.speed_rad_s[s]) > 0.1;
          n.resting[s] = n.speed_rad_s[s] == 0;
          n.voltage_v[s] = n.resting[s] ? 0 : flow.voltage_v[s];
          n.current_a[s] = n.resting[s] ? 0 : flow.current_a[s];
          n.motor_power_w[s] = n.voltage_v[s] * n.current_a[s];
          n.motor_power_abs_w[s] = std::fabs(n.motor_power_w[s]);
          n.braking_w[s] = std::max(0.0, -n.motor_power_w[s]);
          n.current_sign[s] = n.current_a[s] > 0 ? 1.0 : n.current_a[s] < 0 ? -1.0 : 0.0;
          const double copper = robot.motor.resistance_ohm * n.current_a[s] * n.current_a[s];
          for (std::size_t q = 0; q < heat.size(); ++q)
            heat[q][s] += (copper - heat[q][s]) * (1 - std::exp(-step_s / windows::heat_time_constants_s[q]));
          n.span_angle_rad[s] = n.speed_rad_s[s];
        }
        n.copper_heat_w = heat;
        n.battery_power_w = robot.idle_power_w + n.motor_power_w[0] + n.motor_power_w[1];
        n.battery_voltage_v = n.mission_voltage_v = robot.battery.nominal_voltage_v;
        n.battery_current_a = n.battery_power_w / n.battery_voltage_v;
        n.yaw_rate_rad_s = w;
        if (windows.size() % 5 == 0) n.forward_m = v, n.turn_rad = w;
        windows.push_back(n);
      }
    }
  }
  return windows;
}

// The information of a manoeuvre on these columns, with the noise of the recordings.
statistics::Information expected_information(const posterior::Fit& fit, const std::vector<Window>& windows) {
  posterior::Data drive;
  drive.robot = fit.data.robot;
  drive.in_file = fit.data.in_file;
  drive.missions = drive.blocks = 1;
  drive.motors = fit.data.motors;
  drive.power = fit.data.power;
  drive.voltages = fit.data.voltages;
  drive.sample_s = fit.data.sample_s;
  drive.mean_power_w = fit.data.mean_power_w;
  drive.windows = drive.halves[0] = drive.halves[1] = windows;
  drive.battery_voltage_v.assign(windows.size(), windows.front().battery_voltage_v);
  for (const Window& w : windows) {
    drive.rows.instants.push_back(w);
    drive.rows.power_w.push_back(w.battery_power_w);
    drive.rows.first.push_back(drive.rows.instants.size());
  }
  const posterior::Equations e = posterior::linearise(drive, fit.catalogue, {}, fit.equations.point);
  statistics::Information info(posterior::ix(e.size()));
  for (const posterior::ChannelRows& rows : e.channels) {
    const auto same =
        std::ranges::find(fit.equations.channels, rows.channel, &posterior::ChannelRows::channel);
    if (same == fit.equations.channels.end()) continue;
    const posterior::Noise& noise =
        fit.noise[static_cast<std::size_t>(same - fit.equations.channels.begin())];
    if (!(noise.sigma > 0)) continue;
    const double root = 1 / (noise.sigma * std::sqrt(noise.inflation));
    info.add(root * rows.x, Eigen::VectorXd::Zero(rows.y.size()), rows.columns);
  }
  return info;
}

}  // namespace

std::vector<NextDrive> first_drives(const robot::RobotModel& robot) {
  std::vector<NextDrive> drives;
  for (const Manoeuvre& m : manoeuvres(robot.limits)) {
    if (drives.size() == first_drives_named) break;
    drives.push_back({m.text, "a gap from none", missing});
  }
  return drives;
}

std::vector<NextDrive> drives_for(const Outside& outside) {
  struct Advice {
    std::string_view variable, manoeuvre;
  };
  constexpr auto advice = std::to_array<Advice>({
      {"time", "the same drive twice: after an hour of rest, and again immediately"},
      {"recent_motion", "five minutes of standing, ten of driving without a halt, ten of standing"},
      {"position", "the same course on another part of the floor"},
      {"heading", "legs in eight headings over one place"},
      {"payload", "the same leg and turn with no, half and full payload"},
      {"speed", "straight legs at 10, 20, 40, 60, 80 and 100 % of the speed limit, 8 s each"},
      {"acceleration", "starts and stops at a quarter, half and all of the acceleration limit"},
      {"yaw_rate", "turns in place both ways at 10, 30, 60 and 100 % of the yaw rate limit, 6 s each"},
      {"wheel_angle", "straight legs at 5 and 10 % of the speed limit over ten turns of a wheel"},
      {"current", "the same leg with no, half and full payload, started hard and gently"},
      {"battery_current",
       "the same leg with no, half and full payload, on a full and on a half-empty battery"},
  });
  const auto* found = std::ranges::find(advice, outside.follows, &Advice::variable);
  if (found == advice.end()) return {};
  return {{std::string(found->manoeuvre), "a dependence on " + words_of(found->variable) + " from chance",
           missing}};
}

std::vector<NextDrive> next_drives(const posterior::Fit& fit, const std::vector<DiagnosedEffect>& effects) {
  std::vector<NextDrive> drives;
  const auto& all = fit.catalogue.hypotheses;
  const auto find = [&](const std::string& id) {
    return std::ranges::find_if(all, [&](const Hypothesis& h) { return h.id() == id && h.is_effect(); });
  };
  const std::vector<Eigen::Index> keep = posterior::without_functions(fit.equations);
  const Eigen::VectorXd tolerance =
      posterior::tolerances(fit.equations, posterior::tolerance_factors[fit.factor])(keep);
  const statistics::Information total =
      posterior::subset(posterior::weighted_sum(fit.grams.raw, fit.once()), keep);
  std::vector<std::pair<std::string, statistics::Information>> drivable;
  for (const DiagnosedEffect& effect : effects) {
    if (effect.alternatives.empty()) continue;
    const auto ours = find(effect.id), other = find(effect.alternatives.front());
    if (ours == all.end() || other == all.end()) continue;
    // Expected log odds of this strength over the best strength of the other effect: half the squared
    // distance that the other cannot follow.
    const auto separation = [&](statistics::Information information) {
      information.integrate_out(tolerance);
      const std::size_t own = ours->columns[0], column = other->columns[0];
      const auto& xx = information.xx;
      const double strength = effect.parameters.front().value,
                   expected = posterior::usual_slab * fit.equations.columns[column].unit,
                   both = xx(posterior::ix(own), posterior::ix(column));
      const double followed =
          both * both / (xx(posterior::ix(column), posterior::ix(column)) + 1 / (expected * expected));
      return 0.5 * strength * strength * std::max(0.0, xx(posterior::ix(own), posterior::ix(own)) - followed);
    };
    if (drivable.empty()) {
      for (const Manoeuvre& m : manoeuvres(fit.data.robot.limits))
        drivable.emplace_back(m.text, expected_information(fit, driven(fit.data.robot, m.legs)));
    }
    const double known = separation(total);
    if (known >= least_log_evidence) continue;
    std::vector<NextDrive> candidates;
    for (const auto& [manoeuvre, information] : drivable) {
      statistics::Information more = total;
      more += information;
      candidates.push_back(
          {manoeuvre, effect.id + " from " + effect.alternatives.front(), separation(more) - known});
    }
    const auto best = std::ranges::max_element(candidates, {}, &NextDrive::expected_log_evidence);
    if (best->expected_log_evidence >= least_log_evidence) drives.push_back(*best);
  }
  return drives;
}

}  // namespace joulecast::gap

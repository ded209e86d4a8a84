#include "gap/verdict/next_drive.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <string>
#include <string_view>

#include "gap/posterior/constants.h"
#include "statistics/evidence.h"

namespace joulecast::gap {
namespace {

using windows::heat_time_constants_s;

constexpr double step_s = 0.2;
constexpr std::size_t first_drives_named = 3;
// A Bayes factor of 3, below which evidence is not worth more than a bare mention (Kass and Raftery 1995).
const double least_log_evidence = std::log(3.0);

struct Manoeuvre {
  std::string text;
  std::vector<Window> windows;
};

// Builds the windows of a drive from the nominal model.
class Driver {
 public:
  explicit Driver(const robot::RobotModel& robot) : robot_(robot), model_(robot, {}) {}

  Driver& load(double payload_kg) {
    payload_kg_ = payload_kg;
    return *this;
  }
  Driver& stand(double duration_s) { return move(0, 0, 0, 0, duration_s); }
  // Ramp up, hold, ramp down; speeds of the body.
  Driver& run(double speed, double yaw, double acceleration, double hold_s) {
    const double l = robot_.kinematics.half_track_m;
    const double top = std::max(std::fabs(speed), l * std::fabs(yaw));
    const double ramp_s = top / acceleration;
    move(0, 0, speed / ramp_s, yaw / ramp_s, ramp_s);
    move(speed, yaw, 0, 0, hold_s);
    return move(speed, yaw, -speed / ramp_s, -yaw / ramp_s, ramp_s);
  }
  Driver& turn_to(double heading) {
    heading_ = heading;
    return *this;
  }
  std::vector<Window> take() { return std::move(windows_); }

 private:
  Driver& move(double speed, double yaw, double acceleration, double yaw_acceleration, double duration_s) {
    const double r = robot_.kinematics.wheel_radius_m, l = robot_.kinematics.half_track_m;
    for (double t = 0.5 * step_s; t < duration_s; t += step_s) {
      const double v = speed + acceleration * t, w = yaw + yaw_acceleration * t;
      Window n;
      n.t_s = time_s_ += step_s;
      n.continues = true;
      n.payload_kg = payload_kg_;
      n.speed_rad_s = {(v + l * w) / r, (v - l * w) / r};
      n.acceleration_rad_s2 = {(acceleration + l * yaw_acceleration) / r,
                               (acceleration - l * yaw_acceleration) / r};
      heading_ += w * step_s;
      x_m_ += v * std::cos(heading_) * step_s;
      y_m_ += v * std::sin(heading_) * step_s;
      n.x_m = x_m_;
      n.y_m = y_m_;
      n.heading_rad = heading_;
      dynamics::Instant at;
      at.wheel_speed_rad_s = n.speed_rad_s;
      at.wheel_acceleration_rad_s2 = n.acceleration_rad_s2;
      at.payload_kg = payload_kg_;
      const auto flow = model_.flow(at);
      for (std::size_t s : {0u, 1u}) {
        n.moving[s] = std::fabs(n.speed_rad_s[s]) > 0.1;
        n.resting[s] = n.speed_rad_s[s] == 0;
        n.voltage_v[s] = n.resting[s] ? 0 : flow.voltage_v[s];
        n.current_a[s] = n.resting[s] ? 0 : flow.current_a[s];
        n.motor_power_w[s] = n.voltage_v[s] * n.current_a[s];
        n.motor_power_abs_w[s] = std::fabs(n.motor_power_w[s]);
        n.braking_w[s] = std::max(0.0, -n.motor_power_w[s]);
        n.current_sign[s] = n.current_a[s] > 0 ? 1.0 : n.current_a[s] < 0 ? -1.0 : 0.0;
        const double copper = robot_.motor.resistance_ohm * n.current_a[s] * n.current_a[s];
        for (std::size_t q = 0; q < heat_time_constants_s.size(); ++q) {
          heat_[q][s] += (copper - heat_[q][s]) * (1 - std::exp(-step_s / heat_time_constants_s[q]));
          n.copper_heat_w[q][s] = heat_[q][s];
        }
        n.span_angle_rad[s] = n.speed_rad_s[s];
      }
      n.battery_power_w = robot_.idle_power_w + n.motor_power_w[0] + n.motor_power_w[1];
      n.battery_voltage_v = n.mission_voltage_v = robot_.battery.nominal_voltage_v;
      n.battery_current_a = n.battery_power_w / n.battery_voltage_v;
      n.yaw_rate_rad_s = w;
      if (windows_.size() % 5 == 0) {
        n.forward_m = v;
        n.turn_rad = w;
      }
      windows_.push_back(n);
    }
    return *this;
  }

  const robot::RobotModel& robot_;
  dynamics::DriveModel model_;
  std::vector<Window> windows_;
  std::array<std::array<double, 2>, heat_time_constants_s.size()> heat_{};
  double payload_kg_ = 0, time_s_ = 0, x_m_ = 0, y_m_ = 0, heading_ = 0;
};

std::vector<Manoeuvre> manoeuvres(const robot::RobotModel& robot) {
  const auto& limit = robot.limits;
  const double v = 0.9 * limit.speed_m_s, a = 0.8 * limit.acceleration_m_s2, w = 0.9 * limit.yaw_rate_rad_s;
  std::vector<Manoeuvre> list;
  list.push_back({"60 s at rest with everything switched on", Driver(robot).stand(60).take()});
  {
    Driver d(robot);
    for (const double part : {0.2, 0.5, 1.0, 0.2, 0.5, 1.0}) d.run(part * v, 0, a, 8);
    list.push_back({"straight legs at 20, 50 and 100 % of the speed limit, 8 s each, twice", d.take()});
  }
  {
    Driver d(robot);
    for (int k = 0; k < 6; ++k) d.run(v, 0, k % 2 == 0 ? a : 0.3 * a, 1);
    list.push_back({"six starts and stops, hard and gentle in turn", d.take()});
  }
  {
    Driver d(robot);
    for (const double part : {0.3, 1.0, -0.3, -1.0}) d.run(0, part * w, a, 6);
    list.push_back({"turns in place both ways at 30 and 100 % of the yaw rate limit, 6 s each", d.take()});
  }
  {
    Driver d(robot);
    for (const double part : {1.0, -1.0}) d.run(0.6 * v, part * 0.6 * w, 0.6 * a, 10);
    list.push_back({"arcs to the left and to the right, 10 s each", d.take()});
  }
  if (limit.payload_kg > 0) {
    Driver d(robot);
    for (const double part : {0.0, 0.5, 1.0})
      d.load(part * limit.payload_kg).run(0.6 * v, 0, a, 8).run(0, 0.6 * w, a, 4);
    list.push_back({"the same leg and turn with no, half and full payload", d.take()});
  }
  {
    Driver d(robot);
    for (int k = 0; k < 8; ++k) d.turn_to(k * 0.785398).run(0.6 * v, 0, a, 5);
    list.push_back({"legs in eight headings over one place", d.take()});
  }
  {
    Driver d(robot);
    for (int k = 0; k < 12; ++k) d.run(v, 0, a, 20);
    list.push_back({"five minutes of driving without a halt", d.take()});
  }
  return list;
}

// Columns of effects and nuisances: manoeuvres have no functions.
std::vector<Eigen::Index> without_functions(const posterior::Equations& e) {
  std::vector<Eigen::Index> keep;
  for (std::size_t k = 0; k < e.size(); ++k) {
    if (k < e.effects || k >= e.effects + e.functions) keep.push_back(posterior::ix(k));
  }
  return keep;
}

// The information of a manoeuvre on these columns, with the noise of the recordings.
statistics::Information expected_information(const posterior::Fit& fit, const std::vector<Window>& windows) {
  posterior::Data drive;
  drive.robot = fit.data.robot;
  drive.in_file = fit.data.in_file;
  drive.missions = drive.blocks = 1;
  drive.motors = fit.data.motors;
  drive.power = fit.data.power;
  drive.from_motion = fit.data.from_motion;
  drive.sample_s = fit.data.sample_s;
  drive.mean_power_w = fit.data.mean_power_w;
  drive.windows = windows;
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
    std::vector<std::size_t> columns(rows.columns.begin(), rows.columns.end());
    const double root = 1 / (noise.sigma * std::sqrt(noise.inflation));
    info.add(root * rows.x, Eigen::VectorXd::Zero(rows.y.size()), columns);
  }
  return info;
}

}  // namespace

std::vector<NextDrive> first_drives(const robot::RobotModel& robot) {
  std::vector<NextDrive> drives;
  for (const Manoeuvre& m : manoeuvres(robot)) {
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
  return {{std::string(found->manoeuvre), "what follows the " + std::string(found->variable) + " from chance",
           missing}};
}

std::vector<NextDrive> next_drives(const posterior::Fit& fit, const std::vector<DiagnosedEffect>& effects) {
  std::vector<NextDrive> drives;
  const auto& all = fit.catalogue.hypotheses;
  const auto find = [&](const std::string& id) {
    return std::ranges::find_if(all, [&](const Hypothesis& h) { return h.id() == id && h.is_effect(); });
  };
  const std::vector<Eigen::Index> keep = without_functions(fit.equations);
  const Eigen::VectorXd tolerance =
      posterior::tolerances(fit.equations, posterior::tolerance_factors[fit.factor])(keep);
  const std::vector<double> once(fit.data.blocks, 1.0);
  const statistics::Information total = posterior::subset(posterior::weighted_sum(fit.grams.raw, once), keep);
  std::vector<std::pair<std::string, statistics::Information>> driven;
  for (const DiagnosedEffect& effect : effects) {
    if (effect.alternatives.empty()) continue;
    const auto ours = find(effect.id), other = find(effect.alternatives.front());
    if (ours == all.end() || other == all.end()) continue;
    const auto separation = [&](const statistics::Information& information) {
      const statistics::Evidence evidence(information, tolerance);
      const std::size_t column = other->candidate.columns[0];
      return evidence.separation(ours->candidate.columns[0], effect.parameters.front().value, column,
                                 posterior::usual_slab * fit.equations.columns[column].unit);
    };
    if (driven.empty()) {
      for (const Manoeuvre& m : manoeuvres(fit.data.robot))
        driven.emplace_back(m.text, expected_information(fit, m.windows));
    }
    const double known = separation(total);
    if (known >= least_log_evidence) continue;
    std::vector<NextDrive> candidates;
    for (const auto& [manoeuvre, information] : driven) {
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

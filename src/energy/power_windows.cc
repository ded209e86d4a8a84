#include "energy/power_windows.h"

#include <algorithm>
#include <cmath>
#include <string>

namespace joulecast::energy {
namespace {

constexpr std::size_t fewest_windows = 40;
constexpr std::size_t most_windows = 3000;  // more add little information and make a fit slow
constexpr std::size_t fewest_blocks = 4;    // of 15 s or more

}  // namespace

Result<PowerWindows> power_windows(std::span<const telemetry::Recording> missions,
                                   const robot::RobotModel& robot) {
  std::vector<telemetry::Recording> driven;
  for (const telemetry::Recording& mission : missions)
    if (mission.samples.size() > 2) driven.push_back(mission);
  const bool measured = std::ranges::any_of(driven, [](const telemetry::Recording& mission) {
    return std::ranges::any_of(mission.samples, [](const signals::Sample& s) {
      return std::isfinite(s.battery_voltage_v * s.battery_current_a);
    });
  });
  if (!measured)
    return invalid("battery_current", "is not measured together with battery_voltage in any run");
  PowerWindows p;
  p.readings = windows::find_readings(driven);
  windows::WindowSettings settings;
  settings.most_windows = most_windows;
  // Inertias need accelerations of regular windows: a line about a reading attenuates them.
  windows::Readings regular = p.readings;
  regular.battery_power = false;
  p.windows = windows::make_windows(driven, robot, regular, settings);
  std::erase_if(p.windows, [](const windows::Window& w) { return !std::isfinite(w.battery_power_w); });
  p.blocks = windows::assign_blocks(p.windows, driven);
  for (const windows::Window& w : p.windows) p.whole.push_back(windows::steady(w));
  const auto whole = static_cast<std::size_t>(std::ranges::count(p.whole, true));
  if (whole < fewest_windows || p.blocks < fewest_blocks)
    return invalid("runs", "hold only " + std::to_string(whole) + " windows with battery power in " +
                               std::to_string(p.blocks) + " blocks of 15 s; " +
                               std::to_string(fewest_windows) + " windows and " +
                               std::to_string(fewest_blocks) + " blocks are needed");
  return p;
}

PowerScale scale_of(std::span<const windows::Window> windows) {
  double power = 0, speed = 0, moving = 0;
  for (const windows::Window& w : windows) {
    power += std::fabs(w.battery_power_w);
    for (const std::size_t side : {0u, 1u}) {
      if (!w.moving[side]) continue;
      speed += std::fabs(w.speed_rad_s[side]);
      ++moving;
    }
  }
  PowerScale scale;
  if (power > 0) scale.power_w = power / static_cast<double>(windows.size());
  if (moving > 0) scale.speed_rad_s = speed / moving;
  return scale;
}

double metered_power_w(const dynamics::DriveModel& model, const windows::Window& w) {
  dynamics::Instant at = windows::instant_of(w);
  if (w.resting[0] && w.resting[1]) {
    at.wheel_speed_rad_s = at.wheel_acceleration_rad_s2 = {};
    return model.metered_battery_power(model.flow(at).battery_power_w, w.mission_voltage_v);
  }
  double power_w = 0;
  for (std::size_t part = 0; part < w.part_weight.size(); ++part) {
    if (!(w.part_weight[part] > 0)) continue;
    at.wheel_speed_rad_s = w.part_speed_rad_s[part];
    at.wheel_acceleration_rad_s2 = w.part_acceleration_rad_s2[part];
    power_w += w.part_weight[part] * model.flow(at).battery_power_w;
  }
  return model.metered_battery_power(power_w, w.mission_voltage_v);
}

PlainRegression::PlainRegression(std::span<const windows::Window> windows, const robot::RobotModel& robot)
    : wheel_radius_m_(robot.kinematics.wheel_radius_m) {
  Eigen::MatrixXd x(static_cast<Eigen::Index>(windows.size()), 5);
  Eigen::VectorXd y(x.rows());
  std::vector<std::size_t> block;
  for (const windows::Window& w : windows) {
    const auto row = static_cast<Eigen::Index>(block.size());
    const std::array<double, 5> terms = windows::plain_terms(w, wheel_radius_m_);
    x.row(row) = Eigen::Map<const Eigen::RowVectorXd>(terms.data(), 5);
    y[row] = w.battery_power_w;
    block.push_back(w.block);
  }
  fit_ = statistics::robust_regression(x, y, block);
}

double PlainRegression::power_w(const windows::Window& window) const {
  const std::array<double, 5> terms = windows::plain_terms(window, wheel_radius_m_);
  return fit_.coefficients.dot(Eigen::Map<const Eigen::VectorXd>(terms.data(), 5));
}

double PlainRegression::copperless_friction_nm() const {
  return 0.5 * std::max(0.0, fit_.coefficients[1]) * wheel_radius_m_;
}

void MissedPowerMeter::add(const windows::Window& window, const dynamics::DriveModel& file,
                           const dynamics::DriveModel& corrected, const PlainRegression& regression) {
  const double measured_w = window.battery_power_w;
  measured_w_ += std::fabs(measured_w);
  missed_w_.file += std::fabs(measured_w - metered_power_w(file, window));
  missed_w_.corrected += std::fabs(measured_w - metered_power_w(corrected, window));
  missed_w_.regression += std::fabs(measured_w - regression.power_w(window));
}

MissedPower MissedPowerMeter::value() const {
  return {missed_w_.file / measured_w_, missed_w_.corrected / measured_w_,
          missed_w_.regression / measured_w_};
}

}  // namespace joulecast::energy

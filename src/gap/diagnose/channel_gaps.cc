#include "gap/diagnose/channel_gaps.h"

#include <algorithm>
#include <cmath>

#include "gap/diagnose/linear.h"
#include "gap/equations/power.h"

namespace joulecast::gap {
namespace {

constexpr std::size_t most_windows = 1500;
constexpr double anything = 1;  // share of the mean power that a coefficient may move

// Sums over the windows in which a reading speaks.
struct Sums {
  double gap = 0, rest = 0, size = 0;
  std::size_t count = 0;

  void add(double gap_here, double rest_here, double reading) {
    if (!std::isfinite(gap_here + rest_here + reading)) return;
    gap += std::fabs(gap_here);
    rest += std::fabs(rest_here);
    size += std::fabs(reading);
    ++count;
  }
  void report(std::string channel, std::vector<ChannelGap>& gaps) const {
    constexpr std::size_t fewest = 40;
    if (count >= fewest && size > 0) gaps.push_back({std::move(channel), gap / size, rest / size});
  }
};

// One equation's residual, as it is and after the fit of everything, of every window; NaN where it does not
// speak.
struct Leftover {
  std::vector<double> before, after;
};

Leftover leftover(const Linear& linear, Channel channel, std::size_t windows) {
  Leftover left{std::vector<double>(windows, missing), std::vector<double>(windows, missing)};
  const ChannelRows& rows = linear.rows[index_of(channel)];
  const Eigen::VectorXd& residual = linear.noise[index_of(channel)].residual;
  for (Eigen::Index k = 0; k < residual.size(); ++k) {
    const std::size_t w = rows.window[static_cast<std::size_t>(k)];
    left.before[w] = rows.y[k];
    left.after[w] = residual[k];
  }
  return left;
}

}  // namespace

std::vector<ChannelGap> channel_gaps(const Material& whole) {
  std::vector<Window> some;
  const std::size_t stride = (whole.windows.size() + most_windows - 1) / most_windows;
  for (std::size_t k = 0; k < whole.windows.size(); k += std::max<std::size_t>(1, stride))
    some.push_back(whole.windows[k]);
  Material material = whole;
  material.windows = some;
  material.from_motion.power = true;
  const Linear linear = linearise(material, {}, std::array{anything}, {});
  const auto left = [&](Channel c) { return leftover(linear, c, some.size()); };
  const Leftover power = left(Channel::power), volts = left(Channel::battery_voltage),
                 gyro = left(Channel::gyro);
  const std::array torque{left(Channel::torque_right), left(Channel::torque_left)};
  const std::array voltage{left(Channel::voltage_right), left(Channel::voltage_left)};
  const dynamics::DriveModel model(whole.robot, whole.adopted);
  const bool volts_read = voltages_read(whole.windows);
  Sums battery, motors, terminals, turning;
  for (std::size_t k = 0; k < some.size(); ++k) {
    const Window& w = some[k];
    battery.add(power.before[k], power.after[k], w.battery_power_w);
    // The level is a nuisance: only what changes counts, which the fit of everything leaves.
    terminals.add(volts.after[k], volts.after[k], w.battery_voltage_v);
    turning.add(gyro.before[k], gyro.after[k], w.yaw_rate_rad_s);
    const double read_w = motors_power(w, whole.robot, volts_read);
    double rest_w = 0;
    for (const std::size_t s : {0u, 1u}) {
      const double winding = std::isfinite(w.voltage_v[s]) ? voltage[s].after[k] * w.current_a[s] : 0;
      rest_w += std::hypot(torque[s].after[k] * motor_voltage(w, whole.robot, s), winding);
    }
    motors.add(read_w - metered_powers(model, w).motors_w, rest_w, read_w);
  }
  std::vector<ChannelGap> gaps;
  battery.report("battery_power", gaps);
  motors.report("motor_power", gaps);
  terminals.report("battery_voltage", gaps);
  turning.report("yaw_rate", gaps);
  return gaps;
}

}  // namespace joulecast::gap

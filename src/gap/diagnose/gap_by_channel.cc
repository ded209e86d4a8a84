#include "gap/diagnose/gap_by_channel.h"

#include <algorithm>
#include <cmath>

#include "gap/equations/channels.h"

namespace joulecast::gap {
namespace {

using posterior::ix;

// Mean sizes over the rows with a finite reading.
class MeanSizes {
 public:
  void add(double gap, double reading) {
    if (!std::isfinite(gap + reading)) return;
    gap_ += std::fabs(gap);
    size_ += std::fabs(reading);
    ++count_;
  }
  // `rest`: mean |residual| in the channel's unit.
  void report(std::string channel, double rest, std::vector<ChannelGap>& gaps) const {
    if (count_ < posterior::fewest_rows || !(size_ > 0)) return;
    gaps.push_back({std::move(channel), gap_ / size_, rest * static_cast<double>(count_) / size_});
  }

 private:
  double gap_ = 0, size_ = 0;
  std::size_t count_ = 0;
};

// Mean |residual| of a channel; NaN: the channel has no rows.
double rest_of(const posterior::Fit& fit, Channel channel) {
  for (std::size_t c = 0; c < fit.noise.size(); ++c)
    if (fit.equations.channels[c].channel == channel) return fit.noise[c].rest;
  return missing;
}

// The same of battery power, which has no rows of its own where motor channels have: a fit of all effects.
double rest_of_power(const posterior::Fit& fit) {
  if (!fit.data.motors) return rest_of(fit, Channel::power);
  const posterior::PowerRows& power = fit.data.rows;
  posterior::ChannelRows rows = posterior::channel_rows(power);
  for (std::size_t k = 0; k < fit.equations.effects; ++k) rows.columns.push_back(ix(k));
  rows.x = fit.equations.moved;
  rows.y = power.measured_w() - fit.equations.modelled_w + rows.x * fit.equations.point;
  return posterior::learn_noise(rows, fit.equations, fit.functions).rest;
}

}  // namespace

std::vector<ChannelGap> channel_gaps(const posterior::Fit& fit) {
  const posterior::Data& d = fit.data;
  std::vector<ChannelGap> gaps;
  MeanSizes battery, motors, terminals, turning;
  if (d.power) {
    for (std::size_t r = 0; r < d.rows.size(); ++r)
      battery.add(d.rows.power_w[r] - fit.unchanged_w[ix(r)], d.rows.power_w[r]);
    if (d.rows.meter.empty()) battery.report("battery_power", rest_of_power(fit), gaps);
  }
  const dynamics::DriveModel model(d.robot, d.in_file);
  const double torque = rest_of(fit, Channel::torque_right), voltage = rest_of(fit, Channel::voltage_right);
  const bool volts_read = voltages_read(d.windows);
  double rest_w = 0, count = 0;
  for (std::size_t k = 0; k < d.windows.size(); ++k) {
    const Window& w = d.windows[k];
    terminals.add(0, d.battery_voltage_v[k]);
    turning.add(residuals(model, w, false)[index_of(Channel::gyro)], w.yaw_rate_rad_s);
    const double read_w = motors_power(w, d.robot, volts_read);
    if (!std::isfinite(read_w)) continue;
    motors.add(read_w - metered_powers(model, w).motors_w, read_w);
    for (const std::size_t s : {0u, 1u}) {
      const double winding = std::isfinite(voltage) ? voltage * w.current_a[s] : 0;
      rest_w += std::hypot(torque * motor_voltage(w, d.robot, s), winding);
    }
    count += 1;
  }
  if (std::isfinite(rest_w)) motors.report("motor_power", rest_w / std::max(count, 1.0), gaps);
  if (const double rest = rest_of(fit, Channel::battery_voltage); std::isfinite(rest)) {
    terminals.report("battery_voltage", rest, gaps);
    if (!gaps.empty() && gaps.back().channel == "battery_voltage")
      gaps.back().absolute_relative = gaps.back().noise_floor;
  }
  if (const double rest = rest_of(fit, Channel::gyro); std::isfinite(rest))
    turning.report("yaw_rate", rest, gaps);
  return gaps;
}

}  // namespace joulecast::gap

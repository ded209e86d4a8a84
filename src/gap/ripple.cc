#include "gap/ripple.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <complex>
#include <numbers>
#include <vector>

#include "gap/power_gap.h"

namespace joulecast::gap {
namespace {

using telemetry::Sample;

constexpr double stretch_rad = 8 * std::numbers::pi;  // four turns: resolves half a cycle a turn
constexpr double fastest_per_turn = 12, per_turn_step = 0.25, slowest_per_turn = 0.75;
constexpr std::size_t frequencies =
    static_cast<std::size_t>((fastest_per_turn - slowest_per_turn) / per_turn_step) + 1;
constexpr double moving_rad_s = 0.2;
constexpr double longest_step_rad = 0.6;  // between samples; a cycle has to have five
constexpr std::size_t fewest_samples = 40, fewest_stretches = 8;
constexpr std::size_t most_samples = 60'000;
constexpr double least_contrast = 4.5;
constexpr double chance = 5.0;  // standard deviations of a mean periodogram

// The model's leftover between two samples.
struct Step {
  double angle_rad = 0, duration_s = 0, value = 0;
  double watts_per_value = 0;  // battery power that a unit of the leftover means
};

class Spectrum {
 public:
  // One stretch: its periodogram in units of its own noise.
  void add(std::span<const Step> steps) {
    const double from = steps.front().angle_rad, length = steps.back().angle_rad - from;
    double total = 0, mean = 0, centre = 0, watts = 0;
    std::vector<double> weight(steps.size());
    for (std::size_t k = 0; k < steps.size(); ++k) {
      const double u = 2 * std::numbers::pi * (steps[k].angle_rad - from) / length;
      weight[k] = steps[k].duration_s * (1 - std::cos(u));
      total += weight[k];
      mean += weight[k] * steps[k].value;
      centre += weight[k] * steps[k].angle_rad;
      watts += weight[k] * steps[k].watts_per_value;
    }
    mean /= total;
    centre /= total;
    watts /= total;
    double slope = 0, square = 0;
    for (std::size_t k = 0; k < steps.size(); ++k) {
      const double u = steps[k].angle_rad - centre;
      slope += weight[k] * u * (steps[k].value - mean);
      square += weight[k] * u * u;
    }
    slope /= square;
    std::array<std::complex<double>, frequencies> sum{};
    for (std::size_t k = 0; k < steps.size(); ++k) {
      const double angle = steps[k].angle_rad - from;
      const double left = weight[k] * (steps[k].value - mean - slope * (steps[k].angle_rad - centre));
      std::complex<double> wave = left * std::polar(1.0, -slowest_per_turn * angle);
      const std::complex<double> next = std::polar(1.0, -per_turn_step * angle);
      for (auto& total_at : sum) {
        total_at += wave;
        wave *= next;
      }
    }
    std::array<double, frequencies> power{};
    for (std::size_t n = 0; n < frequencies; ++n) power[n] = std::norm(2.0 * sum[n] / total);
    auto sorted = power;
    const auto middle = sorted.begin() + frequencies / 2;
    std::ranges::nth_element(sorted, middle);
    const double noise = *middle / std::numbers::ln2;  // the median of an exponential distribution
    if (!(noise > 0)) return;
    for (std::size_t n = 0; n < frequencies; ++n) {
      relative_[n] += power[n] / noise;
      power_[n] += power[n];
    }
    watts_ += watts;
    ++stretches_;
  }

  std::optional<Ripple> line(double mean_power_w, double turning_share) const {
    if (stretches_ < fewest_stretches) return std::nullopt;
    const auto count = static_cast<double>(stretches_);
    std::optional<Ripple> best;
    for (std::size_t n = 1; n + 1 < frequencies; ++n) {
      if (relative_[n] < relative_[n - 1] || relative_[n] < relative_[n + 1]) continue;
      // What neighbours beyond the line's own width have; those at the ends have them on one side.
      std::vector<double> near, near_power;
      for (std::size_t k = 0; k < frequencies; ++k) {
        const auto apart = k > n ? k - n : n - k;
        if (apart < 3 || apart > 8) continue;
        near.push_back(relative_[k]);
        near_power.push_back(power_[k]);
      }
      std::ranges::sort(near);
      std::ranges::sort(near_power);
      const double floor = near[near.size() / 2] / count, here = relative_[n] / count;
      const double contrast = here / floor;
      if (contrast < least_contrast || here < floor * (1 + chance / std::sqrt(count))) continue;
      const double square = (power_[n] - near_power[near_power.size() / 2]) / count;
      const double amplitude = std::sqrt(std::max(0.0, square));
      const double share =
          2 * std::numbers::inv_pi * amplitude * watts_ / count * turning_share / mean_power_w;
      if (best && best->power_share >= share) continue;
      best = Ripple{slowest_per_turn + per_turn_step * static_cast<double>(n), share, contrast};
    }
    return best;
  }

 private:
  std::array<double, frequencies> relative_{}, power_{};
  double watts_ = 0;
  std::size_t stretches_ = 0;
};

}  // namespace

std::optional<Ripple> find_ripple(const RecordingSet& set, const robot::RobotModel& robot,
                                  std::span<const dynamics::ActiveEffect> effects, bool motors,
                                  double delay_s) {
  const dynamics::DriveModel model = extended_model(robot, effects);
  const double kt = model.parameters().torque_constant_nm_a;
  const double ohm = robot.motor.resistance_ohm;
  std::array<Spectrum, 2> spectra;
  std::array<double, 2> turning_s{};
  double total_s = 0, energy_j = 0;
  const std::size_t keep_every = std::max<std::size_t>(1, set.samples / most_samples);
  std::size_t stretch_count = 0;
  std::vector<Step> stretch;
  for (const telemetry::Recording& mission : set.missions) {
    const double mean_step_s =
        1e-6 * static_cast<double>(mission.samples.back().utime_us - mission.samples.front().utime_us) /
        static_cast<double>(mission.samples.size() - 1);
    // Electrical readings of the same instant come so many samples later.
    const auto late = static_cast<std::size_t>(std::lround(std::max(0.0, delay_s) / mean_step_s));
    double payload = std::isfinite(mission.payload_kg) ? mission.payload_kg : 0.0;
    for (std::size_t s : {0u, 1u}) {
      stretch.clear();
      double angle = 0, began = 0;
      const auto end = [&] {
        stretch.clear();
        began = angle;
      };
      for (std::size_t k = 1; k + late < mission.samples.size(); ++k) {
        const Sample &a = mission.samples[k - 1], &b = mission.samples[k];
        const Sample &from = mission.samples[k - 1 + late], &to = mission.samples[k + late];
        const double step_s = 1e-6 * static_cast<double>(b.utime_us - a.utime_us);
        if (std::isfinite(b.payload_kg)) payload = b.payload_kg;
        dynamics::Instant at;
        at.payload_kg = payload;
        for (std::size_t q : {0u, 1u}) {
          at.wheel_speed_rad_s[q] = 0.5 * (a.wheel_velocity_rad_s[q] + b.wheel_velocity_rad_s[q]);
          at.wheel_acceleration_rad_s2[q] = (b.wheel_velocity_rad_s[q] - a.wheel_velocity_rad_s[q]) / step_s;
        }
        const double speed = at.wheel_speed_rad_s[s], turned = speed * step_s;
        const double power =
            0.5 * (a.battery_voltage_v * a.battery_current_a + b.battery_voltage_v * b.battery_current_a);
        if (s == 0 && std::isfinite(power)) {
          total_s += step_s;
          energy_j += std::fabs(power) * step_s;
        }
        if (!(step_s > 0) || std::fabs(speed) < moving_rad_s || std::fabs(turned) > longest_step_rad ||
            (!stretch.empty() && speed * stretch.back().watts_per_value < 0)) {
          end();
          continue;
        }
        turning_s[s] += step_s;
        angle += std::fabs(turned);
        if (stretch_count % keep_every != 0) {
          if (angle - began < stretch_rad) continue;
          ++stretch_count;
          end();
          continue;
        }
        at.x_m = 0.5 * (a.pose[0] + b.pose[0]);
        at.y_m = 0.5 * (a.pose[1] + b.pose[1]);
        at.heading_rad = b.pose[2];
        const double current = 0.5 * (from.motor_current_a[s] + to.motor_current_a[s]);
        Step step{angle, step_s, missing, 0};
        if (motors) {
          step.value = current - model.current_for(model.balance(at).total_nm[s]);
          step.watts_per_value = std::copysign(kt * std::fabs(speed) + 2 * ohm * std::fabs(current), speed);
        } else {
          step.value = power - model.flow(at).battery_power_w;
          step.watts_per_value = std::copysign(1.0, speed);
        }
        if (!std::isfinite(step.value)) {
          end();
          continue;
        }
        stretch.push_back(step);
        if (angle - began < stretch_rad) continue;
        ++stretch_count;
        if (stretch.size() >= fewest_samples) {
          for (Step& q : stretch) q.watts_per_value = std::fabs(q.watts_per_value);
          spectra[s].add(stretch);
        }
        end();
      }
    }
  }
  if (!(energy_j > 0)) return std::nullopt;
  std::optional<Ripple> best;
  double share = 0;
  for (std::size_t s : {0u, 1u}) {
    const auto line = spectra[s].line(energy_j / total_s, turning_s[s] / total_s);
    if (!line) continue;
    // Both wheels' add up, unless one reading sums them already.
    share = motors ? share + line->power_share : std::max(share, line->power_share);
    if (!best || line->power_share > best->power_share) best = line;
  }
  if (best) best->power_share = share;
  return best;
}

}  // namespace joulecast::gap

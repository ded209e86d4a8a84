#include "energy/power_calibration.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <iterator>
#include <limits>
#include <utility>

#include "base/try.h"
#include "energy/power_fit.h"
#include "energy/power_parameters.h"
#include "energy/power_windows.h"
#include "energy/untold_parameters.h"

namespace joulecast::energy {
namespace {

constexpr double least_effect_significance = 2;  // standard errors from zero; other effects are not adopted
// Resistance to turning that sets in immediately, as with sliding tyres, or with the rate of turning.
constexpr std::array scrub_rates_rad_s{0.02, 0.1, 0.3};

using Use = std::function<bool(std::size_t block)>;

double mean_left_w(const dynamics::DriveModel& model, const PowerWindows& data, const Use& use) {
  double left = 0, count = 0;
  for (std::size_t k = 0; k < data.windows.size(); ++k) {
    if (!data.whole[k] || !use(data.windows[k].block)) continue;
    left += std::fabs(data.windows[k].battery_power_w - metered_power_w(model, data.windows[k]));
    ++count;
  }
  return left / count;
}

std::vector<windows::Window> windows_of(const PowerWindows& data, const Use& use) {
  std::vector<windows::Window> own;
  std::ranges::copy_if(data.windows, std::back_inserter(own),
                       [&](const windows::Window& w) { return use(w.block); });
  return own;
}

struct Found {
  PowerParameters parameters;
  PowerFit fit;
  PowerFree free;
};

// Fits all free parameters from the robot file and, since the file may be far off, also from the friction of
// a plain regression.
Result<PowerFit> first_fit(const PowerParameters& parameters, const PowerWindows& data, const Use& use,
                           const robot::RobotModel& robot) {
  PowerFree free;
  free.set();
  const Eigen::VectorXd file = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(power_parameter_count));
  auto from_file = fit_power(parameters, data, use, free, file);
  if (!from_file) return from_file;
  Eigen::VectorXd plain = file;
  const Eigen::Index friction = index_of(PowerParameter::friction);
  plain[friction] = (PlainRegression(windows_of(data, use), robot).copperless_friction_nm() -
                     parameters.value(PowerParameter::friction, file)) /
                    parameters.expected(PowerParameter::friction);
  plain[index_of(PowerParameter::resistance)] = parameters.least(PowerParameter::resistance) / 2;
  auto from_plain = fit_power(parameters, data, use, free, plain);
  if (!from_plain) return from_file;
  const bool better = mean_left_w(parameters.model(from_plain->x), data, use) <
                      mean_left_w(parameters.model(from_file->x), data, use);
  return better ? from_plain : from_file;
}

// Drops insignificant effects, the least significant first, as each changes the others.
Result<void> drop_effects(const PowerWindows& data, const Use& use, Found& found) {
  for (;;) {
    std::optional<PowerParameter> weakest;
    double least = least_effect_significance;
    for (const PowerParameter p :
         {PowerParameter::turning_scrub, PowerParameter::driver_loss, PowerParameter::unreturned}) {
      const Eigen::Index at = index_of(p);
      if (!found.free[static_cast<std::size_t>(at)]) continue;
      const double significance = std::fabs(found.fit.x[at]) / found.fit.deviation[at];
      if (significance >= least) continue;
      least = significance;
      weakest = p;
    }
    if (!weakest) return {};
    found.free.reset(static_cast<std::size_t>(*weakest));
    Eigen::VectorXd start = found.fit.x;
    start[index_of(*weakest)] = 0;
    TRY_ASSIGN(auto fit, fit_power(found.parameters, data, use, found.free, start));
    found.fit = std::move(fit);
  }
}

Result<Found> find(const PowerParameters& given, const PowerWindows& data, const Use& use,
                   const robot::RobotModel& robot) {
  std::optional<Found> best;
  double least = std::numeric_limits<double>::infinity();
  for (const double rate_rad_s : scrub_rates_rad_s) {
    PowerParameters parameters = given;
    parameters.set_scrub_rate(rate_rad_s);
    TRY_ASSIGN(auto fit, best ? fit_power(parameters, data, use, best->free, best->fit.x)
                              : first_fit(parameters, data, use, robot));
    const double left = mean_left_w(parameters.model(fit.x), data, use);
    if (left < least) {
      least = left;
      PowerFree free;
      free.set();
      best = Found{parameters, std::move(fit), free};
    }
    if (!parameters.scrub_rate_is_free()) break;
  }
  TRY(drop_effects(data, use, *best));
  return std::move(*best);
}

// Fits each half of the recordings and predicts the other; of all windows, in which wheels start and stop
// too.
Result<MissedPower> predict_halves(const PowerParameters& parameters, const PowerWindows& data,
                                   const robot::RobotModel& robot) {
  const Eigen::VectorXd file = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(power_parameter_count));
  const dynamics::DriveModel by_file = parameters.model(file);
  MissedPowerMeter missed;
  for (const bool second : {false, true}) {
    const Use use = [&](std::size_t block) { return (2 * block >= data.blocks) == second; };
    TRY_ASSIGN(const auto found, find(parameters, data, use, robot));
    const dynamics::DriveModel model = found.parameters.model(found.fit.x);
    const PlainRegression plain(windows_of(data, use), robot);
    for (const windows::Window& w : data.windows) {
      if (!use(w.block)) missed.add(w, by_file, model, plain);
    }
  }
  return missed.value();
}

void tell_extent(const PowerWindows& data, const Found& found, PowerCalibration& out) {
  double power = 0, slowest = std::numeric_limits<double>::infinity(), fastest = 0;
  for (std::size_t k = 0; k < data.windows.size(); ++k) {
    const windows::Window& w = data.windows[k];
    if (!data.whole[k]) continue;
    ++out.windows;
    power += std::fabs(w.battery_power_w);
    for (const std::size_t side : {0u, 1u}) {
      if (!w.moving[side]) continue;
      slowest = std::min(slowest, std::fabs(w.speed_rad_s[side]));
      fastest = std::max(fastest, std::fabs(w.speed_rad_s[side]));
    }
  }
  out.blocks = data.blocks;
  out.effective_windows = static_cast<double>(out.windows) / found.fit.inflation;
  out.reading_s = data.readings.period_s;
  out.held = data.readings.battery_held;
  out.slowest_rad_s = std::isfinite(slowest) ? slowest : 0;
  out.fastest_rad_s = fastest;
  out.power_w = power / static_cast<double>(out.windows);
  out.left_w = mean_left_w(found.parameters.model(found.fit.x), data, [](std::size_t) { return true; });
}

}  // namespace

Result<PowerCalibration> calibrate_from_power(const robot::RobotModel& robot,
                                              std::span<const telemetry::Recording> missions,
                                              const PowerCalibrationOptions& options) {
  TRY_ASSIGN(const auto data, power_windows(missions, robot));
  TRY_ASSIGN(const auto parameters,
             PowerParameters::make(robot, scale_of(data.windows), options.resistance_known));
  const auto found = find(
      parameters, data, [](std::size_t) { return true; }, robot);
  if (!found) return tl::unexpected(found.error());
  if (options.progress) options.progress(0.4);
  TRY_ASSIGN(const auto halves, predict_halves(parameters, data, robot));
  PowerCalibration out;
  out.robot = found->parameters.robot(found->fit.x);
  out.halves = halves;
  out.estimates = power_estimates(found->parameters, found->fit, found->free);
  out.untold = untold_parameters(found->parameters, found->fit);
  tell_extent(data, *found, out);
  return out;
}

}  // namespace joulecast::energy

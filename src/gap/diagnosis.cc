#include "gap/diagnosis.h"

#include <algorithm>
#include <cmath>

#include "gap/fit.h"
#include "gap/held_out.h"
#include "gap/naming.h"
#include "gap/next_drive.h"
#include "gap/power_gap.h"
#include "gap/ripple.h"
#include "gap/verdict.h"
#include "gap/where.h"

namespace joulecast::gap {
namespace {

constexpr std::size_t fewest_windows = 40;
constexpr double settled_delay_s = 0.006;
constexpr double settled_bias = 0.1;  // of the friction's current
constexpr int most_rounds = 4;
constexpr double largest_gap_share = 0.12;  // to which the trust in formulas is scaled

// Where the battery is not measured: the motors' power and the idle power of the robot file.
std::vector<double> power_of_motors(std::span<const Window> windows, const robot::RobotModel& robot) {
  std::vector<double> power(windows.size());
  std::ranges::transform(windows, power.begin(), [&](const Window& w) {
    return robot.idle_power_w + w.motor_power_w[0] + w.motor_power_w[1];
  });
  return power;
}

// What the catalogue does not know, if it is probable enough to be told.
Outside outside_of(const Naming& naming, const Posterior& posterior, const std::optional<Ripple>& ripple,
                   const ColumnSet& columns, bool motor_channels, double report_probability) {
  if (ripple && ripple->power_share > naming.largest_unknown_share)
    return {1, std::string(name_of(motor_channels ? Channel::torque_right : Channel::power)), "wheel_angle"};
  Outside outside{ripple ? 1 : posterior.outside, "", ""};
  if (naming.unknown && outside.probability >= report_probability) {
    const Hypothesis& h = columns.hypotheses()[*naming.unknown];
    outside.channel = h.channel;
    outside.follows = h.variable;
  }
  return outside;
}

std::vector<robot::AdoptedEffect> adoptable_of(std::span<const DiagnosedEffect> named,
                                               std::span<const dynamics::ActiveEffect> effects) {
  std::vector<robot::AdoptedEffect> adoptable;
  for (const DiagnosedEffect& e : named) {
    for (const dynamics::ActiveEffect& effect : effects) {
      if (effect.effect->info().id == e.id) adoptable.push_back(dynamics::adopt(effect));
    }
  }
  return adoptable;
}

}  // namespace

std::string_view name_of(PowerSource source) {
  switch (source) {
    case PowerSource::battery:
      return "battery";
    case PowerSource::motors:
      return "motors";
    case PowerSource::none:
      return "none";
  }
  return "";
}

std::string_view name_of(Verdict verdict) {
  switch (verdict) {
    case Verdict::none:
      return "none";
    case Verdict::effects:
      return "effects";
    case Verdict::outside:
      return "outside";
    case Verdict::inconclusive:
      return "inconclusive";
  }
  return "";
}

Result<Diagnosis> diagnose(const RecordingSet& recordings, const robot::RobotModel& robot,
                           const DiagnosisSettings& settings) {
  Diagnosis d;
  d.robot_id = recordings.robot_id;
  d.missions = recordings.missions.size();
  d.samples = recordings.samples;
  if (const auto adopted = dynamics::active_effects(robot); !adopted) return tl::unexpected(adopted.error());
  const auto windows_with = [&](const WindowSettings& wanted) {
    std::vector<Window> made = make_windows(recordings, robot, wanted);
    mark_turning_power(made, extended_model(robot, {}));
    return made;
  };
  const std::vector<Window> windows = windows_with(settings.parts.windows);
  std::vector<double> measured = measured_power(windows);
  const auto known = [](double p) { return std::isfinite(p); };
  const auto with_battery = std::ranges::count_if(measured, known);
  if (with_battery == 0) measured = power_of_motors(windows, robot);
  const auto with_power = std::ranges::count_if(measured, known);
  d.power = with_battery > 0 ? PowerSource::battery
            : with_power > 0 ? PowerSource::motors
                             : PowerSource::none;
  d.motor_channels = !windows.empty() && !without_motor_channels(windows);
  if (windows.size() < fewest_windows || (with_battery == 0 && !d.motor_channels)) {
    // Too little motion, or neither battery power nor motor currents: nothing can be said.
    d.noise_floor = d.energy_relative = d.power_absolute_relative = missing;
    d.next_drive = first_drives(robot);
    return d;
  }
  const std::vector<double> modelled = modelled_power(robot, {}, windows);
  const GapSize size = gap_size(measured, modelled);
  d.energy_relative = with_power > 0 ? size.energy_relative : missing;
  d.power_absolute_relative = with_power > 0 ? size.absolute_relative : missing;
  d.noise_floor = with_power > 0 ? noise_floor(windows, measured, modelled) : missing;
  d.where = localise(windows, robot, modelled);

  const double gap_share =
      with_power > 0 ? std::clamp(d.power_absolute_relative - d.noise_floor, 0.0, largest_gap_share) : 0.0;

  // A delay is linear only while it is short beside the window, a bias only while it turns no current's sign:
  // what is found is taken out and fitted again.
  std::vector<Window> judged = windows;
  std::optional<FitResult> result;
  const double settled_bias_a = settled_bias * robot.motor.friction_torque_nm[0] /
                                (robot.motor.torque_constant_nm_a * robot.motor.gear_ratio);
  WindowSettings taken_out = settings.parts.windows;
  for (int round = 0;; ++round) {
    result = fit_windows(robot, judged, gap_share, settings.progress, settings.parts);
    if (!result) return fail(Fault::conflict, "", "diagnosis cancelled");
    const WindowSettings before = taken_out;
    taken_out.electrical_delay_s = taken_out.motor_current_bias_a = 0;
    for (const dynamics::ActiveEffect& effect : result->fit.columns->effects_of(result->chosen))
      take_out(effect, taken_out);
    const bool settled =
        std::fabs(taken_out.electrical_delay_s - before.electrical_delay_s) < settled_delay_s &&
        std::fabs(taken_out.motor_current_bias_a - before.motor_current_bias_a) < settled_bias_a;
    if (settled || round >= most_rounds) break;
    judged = windows_with(taken_out);
  }
  const std::vector<double> judged_power =
      d.power == PowerSource::motors ? power_of_motors(judged, robot) : measured_power(judged);
  const Fit& fit = result->fit;
  const MovedShares moved(fit, judged);
  const Posterior posterior = posterior_of(fit, moved, gap_share, d.power_absolute_relative);
  Naming naming = name_effects(fit, posterior, moved, robot, judged, judged_power, d.power_absolute_relative);
  std::optional<Ripple> ripple;
  if (settings.parts.open_set)
    ripple =
        find_ripple(recordings, robot, naming.effects, d.motor_channels, judged.front().electrical_shift_s);
  if (ripple && ripple->power_share < least_outside_of(gap_share, 0)) ripple.reset();
  if (ripple) naming.unknown_share += ripple->power_share;
  d.outside =
      outside_of(naming, posterior, ripple, *fit.columns, d.motor_channels, settings.report_probability);

  d.effects = naming.named;
  const std::vector<double> shares = effect_shares(robot, naming.effects, windows, measured);
  for (std::size_t k = 0; k < shares.size(); ++k) d.effects[k].share = shares[k];
  if (!d.effects.empty() && with_power > 0)
    d.shrinkage = held_out(fit, robot, naming.set, judged, judged_power, measured, modelled, d.noise_floor);
  judge(d, naming, posterior, *fit.columns, robot, settings.report_probability);
  if (d.verdict == Verdict::outside) {
    std::erase_if(d.effects,
                  [&](const DiagnosedEffect& e) { return e.probability < settings.report_probability; });
  }
  if (d.effects.empty()) d.shrinkage.reset();
  // What makes missions that it was not fitted to worse is no explanation.
  if (!d.shrinkage || d.shrinkage->interval[1] >= 0) d.adoptable = adoptable_of(d.effects, naming.effects);
  name_burning_slip(d.effects);
  std::ranges::stable_sort(d.effects, std::greater{}, &DiagnosedEffect::share);
  d.next_drive = next_drives(fit, robot, d);
  if (d.verdict == Verdict::outside) {
    const auto more = drives_for(d.outside);
    d.next_drive.insert(d.next_drive.begin(), more.begin(), more.end());
  }
  return d;
}

}  // namespace joulecast::gap

#include "gap/diagnose/recordings.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <iterator>
#include <tuple>

#include "base/try.h"
#include "gap/diagnose/ripple.h"
#include "gap/posterior/explain_recordings.h"
#include "gap/verdict/answer.h"
#include "gap/verdict/next_drive.h"
#include "gap/verdict/text.h"
#include "gap/verdict/where.h"
#include "gap/verdict/words.h"
#include "plausibility/readings.h"

namespace joulecast::gap {
namespace {

using posterior::Explained;
using posterior::ix;

constexpr std::size_t ripple_surrogates = 20;

// Progress of the stages, as parts of the whole.
constexpr double of_step = 0.1, after_walk = 0.6, after_answer = 0.9;

// A factor of the robot file's wheel radius in all missions.
bool of_radius(const Check& check) {
  return check.factor && check.few_missions.empty() && check.channel == plausibility::radius_of_file;
}

// States that the readings of a contradicted channel were corrected, where its error is known.
void state_correction(Check& check) {
  if (!check.factor && !check.swapped) return;
  check.contradicted = false;  // any more
  check.says += fmt::format(
      " The diagnosis uses {} {}{}.", of_radius(check) ? "the radius" : "readings that are",
      check.swapped ? "exchanged" : fmt::format("divided by this factor, {:.4g}", *check.factor),
      std::isfinite(check.probability) ? " (probability " + probability_text(check.probability) + ")" : "");
}

// (E_measured - E_model) / E_measured, and the integral of |P_measured - P_model| over that of |P_measured|.
using GapSize = std::pair<double, double>;

GapSize gap_size(const posterior::Data& data, const Eigen::VectorXd& modelled_w) {
  const Eigen::VectorXd measured_w = data.rows.measured_w(), apart_w = measured_w - modelled_w;
  return {apart_w.sum() / measured_w.sum(), apart_w.lpNorm<1>() / measured_w.lpNorm<1>()};
}

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

// Returns the gap of each kind of recorded reading, and its noise floor: the residual of a fit of all
// columns. A battery voltage is compared after its open-circuit level was fitted to each block.
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

class Diagnoser {
 public:
  Diagnoser(const telemetry::RecordingSet& recordings, const robot::RobotModel& robot,
            const Progress& progress, std::vector<Check> checks)
      : recordings_(recordings), robot_(robot), progress_(progress) {
    d_.checks = std::move(checks);
  }

  Result<Diagnosis> run() {
    d_.robot_id = recordings_.robot_id;
    d_.missions = recordings_.missions.size();
    d_.samples = recordings_.samples;
    TRY(dynamics::active_effects(robot_));
    const windows::Readings readings = windows::find_readings(recordings_.missions);
    d_.motor_channels = readings.motor_currents;
    d_.power = readings.battery_power    ? PowerSource::battery
               : readings.motor_currents ? PowerSource::motors
                                         : PowerSource::none;
    const auto cancelled = [] { return fail(Fault::conflict, "", "diagnosis cancelled"); };
    double part = 0;
    Result<std::unique_ptr<posterior::Fit>> fitted = posterior::fit_missions(
        recordings_.missions, robot_, [&] { return goes_on(part = std::min(part + of_step, after_walk)); });
    if (!fitted) return nothing_to_judge(false);
    fit_ = std::move(*fitted);
    if (!fit_ || !goes_on(after_walk)) return cancelled();
    if (fit_->equations.channels.empty() || (d_.power == PowerSource::none && !readings.motor_voltages))
      return nothing_to_judge(true);
    measure();
    answer_ = posterior::explain(*fit_);
    if (!goes_on(after_answer)) return cancelled();
    state_effects();
    state_outside();
    if (!readings.held()) find_ripple_of_wheels();
    compare();
    lower_noise_floor();
    state_offer(*fit_, answer_, true, d_);
    weigh_by_checks(d_);
    finish();
    return std::move(d_);
  }

 private:
  bool goes_on(double part) const { return !progress_ || progress_(part); }

  // `motion_known`: for long enough.
  Diagnosis nothing_to_judge(bool motion_known) {
    d_.noise_floor = d_.energy_relative = d_.power_absolute_relative = missing;
    // Without power another drive with the same channels is of no use.
    if (!motion_known || d_.power != PowerSource::none) d_.next_drive = first_drives(robot_);
    d_.refusal = "no change of the robot file was found";
    d_.reasons.push_back(missing_data(d_, motion_known));
    return std::move(d_);
  }

  void measure() {
    const posterior::Data& data = fit_->data;
    d_.power = power_source(data);
    if (d_.power == PowerSource::none) {
      d_.noise_floor = d_.energy_relative = d_.power_absolute_relative = missing;
      return;
    }
    if (d_.power == PowerSource::motors && !voltages_read(data.windows))
      d_.notes.emplace_back(
          "The motors' voltages were not recorded: power is that of their currents at the voltages that the "
          "robot file's windings need for them.");
    std::tie(d_.energy_relative, d_.power_absolute_relative) = gap_size(data, fit_->unchanged_w);
  }

  void state_effects() {
    gap::state_effects(answer_, fit_->data.mean_power_w, d_);
    if (d_.power != PowerSource::none) return;
    for (DiagnosedEffect& e : d_.effects) e.share = e.power_w = missing;
  }

  // Searches for a line in the spectrum over the wheels' angle: windows average it out and keep its mean,
  // which looks like friction. Readings that are repeated over rows would repeat with the wheel.
  void find_ripple_of_wheels() {
    std::vector<dynamics::ActiveEffect> effects = fit_->data.in_file;
    effects.insert(effects.end(), answer_.model.begin(), answer_.model.end());
    const std::optional<Ripple> ripple =
        find_ripple(recordings_, robot_, effects, d_.motor_channels, ripple_surrogates);
    if (!ripple || ripple->power_share < posterior::least_function) return;
    const bool other = d_.verdict == Verdict::outside && answer_.outside_share > ripple->power_share;
    const double chance = static_cast<double>(ripple->found_in + 1) / (ripple_surrogates + 1.0);
    if (chance > 0.1) return;
    d_.verdict = Verdict::outside;
    if (!other) {
      d_.outside = {};
      d_.outside.probability = 1 - chance;
      d_.outside.channel = d_.motor_channels ? "wheel_torque" : "battery_power_from_motion";
      d_.outside.follows = "wheel_angle";
    }
    d_.verdict_probability = d_.outside.probability;
    // The probability of an effect is scaled by its share of the power that it and the ripple move.
    for (DiagnosedEffect& e : d_.effects) {
      const double part = e.power_w / (e.power_w + ripple->power_share * fit_->data.mean_power_w);
      e.probability *= part;
      e.group *= part;
    }
  }

  void state_outside() {
    if (d_.outside.follows != "time" || !d_.outside.like.empty() ||
        !d_.outside.channel.starts_with("battery_power"))
      return;
    d_.outside.like = "accessory_load";
    d_.outside.power_w = load_by_time();
  }

  // Held-out errors of the file, the explanation and the regression.
  void compare() {
    if (!answer_.held_out.known || d_.power == PowerSource::none) return;
    state_held_out(answer_.held_out, d_);
    Baseline& b = *d_.baseline;
    b.terms.assign(answer_.terms.begin(), answer_.terms.end());
    d_.sums = answer_.sums;
    for (const TermSum& sum_of : d_.sums) {
      std::vector<std::string> names;
      for (const std::string& id : sum_of.effects) names.push_back(words_of(id));
      b.says.push_back(
          fmt::format("{}: {} {} in the data than in the model{}.", sum_of.terms,
                      with_deviation(std::fabs(sum_of.difference_w), sum_of.deviation_w, "W"),
                      sum_of.difference_w < 0 ? "less" : "more",
                      names.empty() ? "" : fmt::format(", as {} would cause", enumerate(names, "or"))));
    }
  }

  const char* power_channel() const {
    return d_.power == PowerSource::battery ? "battery_power" : "motor_power";
  }

  // Lowers the noise floor to the held-out error of a model that predicts held-out parts.
  void lower_noise_floor() {
    d_.channels = channel_gaps(*fit_);
    const auto gap = std::ranges::find(d_.channels, power_channel(), &ChannelGap::channel);
    if (d_.power == PowerSource::none || gap == d_.channels.end()) {
      d_.noise_floor = missing;
      return;
    }
    gap->absolute_relative = d_.power_absolute_relative;
    if (d_.baseline)
      gap->noise_floor =
          std::min({gap->noise_floor, d_.baseline->held_out, d_.baseline->explanation_held_out});
    d_.noise_floor = gap->noise_floor;
    if (d_.shrinkage) d_.shrinkage->remaining_over_noise_floor = d_.shrinkage->after / d_.noise_floor;
  }

  // The power of a load independent of motion, beyond the other causes, in the first and in the last third of
  // the time since a mission began.
  std::array<double, 2> load_by_time() const {
    const auto load =
        std::ranges::find(answer_.model, "accessory_load", [](const auto& e) { return e.effect->info().id; });
    const double load_w = load == answer_.model.end() ? 0 : load->values[0];
    const posterior::PowerRows& rows = fit_->data.rows;
    double end_s = 0;
    for (const Window& w : rows.instants) end_s = std::max(end_s, w.t_s);
    std::array<double, 2> sum{}, count{};
    for (std::size_t r = 0; r < rows.size(); ++r) {
      const double t_s = rows.window(r).t_s;
      if (t_s > end_s / 3 && t_s < 2 * end_s / 3) continue;
      const std::size_t at = t_s > end_s / 3 ? 1 : 0;
      sum[at] += rows.power_w[r] - answer_.explained_w[ix(r)] + load_w;
      count[at] += 1;
    }
    return {sum[0] / std::max(count[0], 1.0), sum[1] / std::max(count[1], 1.0)};
  }

  void finish() {
    d_.reasons = reasons_for(d_, d_.baseline && d_.baseline->wins());
    for (const std::string& reason : answer_.reasons) d_.reasons.push_back(sentence(reason));
    d_.next_drive = next_drives(*fit_, d_.effects);
    if (!d_.outside.channel.empty()) {
      const auto more = drives_for(d_.outside);
      d_.next_drive.insert(d_.next_drive.begin(), more.begin(), more.end());
    }
    if (d_.power == PowerSource::none) return;
    const posterior::PowerRows& rows = fit_->data.rows;
    std::vector<Window> windows;
    for (std::size_t r = 0; r < rows.size(); ++r) windows.push_back(rows.window(r));
    const auto all = [](const Eigen::VectorXd& v) { return std::span(v.data(), posterior::ux(v.size())); };
    const auto before = all(fit_->unchanged_w),
               after = d_.verdict == Verdict::none ? before : all(answer_.explained_w);
    if (d_.verdict != Verdict::none)
      d_.where = localise(windows, robot_, rows.power_w, before, d_.noise_floor, power_channel());
    d_.figures = figures_of(windows, rows.power_w, before, after, recordings_, robot_);
  }

  const telemetry::RecordingSet& recordings_;
  const robot::RobotModel& robot_;
  const Progress& progress_;
  std::unique_ptr<posterior::Fit> fit_;
  Explained answer_;
  Diagnosis d_;
};

// The gap of recordings before readings are moved.
GapSize gap_as_read(const telemetry::RecordingSet& recordings, const robot::RobotModel& robot) {
  const auto data = posterior::make_data(recordings.missions, robot, 0, true);
  return data && data->power ? gap_size(*data, posterior::predicted_power(*data, data->in_file))
                             : GapSize{missing, missing};
}

// Adds an effect that checks measured, and that was removed before the diagnosis, to the answer. A strength x
// that the diagnosis found beyond it becomes `added` + x * `times`.
void add_measured(Diagnosis& d, std::string_view id, const DiagnosedParameter& added, double times,
                  double probability) {
  auto own = std::ranges::find(d.effects, id, &DiagnosedEffect::id);
  if (own == d.effects.end()) {
    DiagnosedEffect e;
    e.id = id;
    e.parameters = {added};
    e.parameters.front().value = 0;
    e.share = e.power_w = missing;
    own = d.effects.insert(d.effects.end(), std::move(e));
  }
  double& value = own->parameters.front().value;
  value = added.value + value * times;
  own->probability = own->group = probability;
  std::erase_if(d.adoptable, [&](const robot::AdoptedEffect& e) { return e.id == id; });
  d.adoptable.push_back({std::string(id), {{added.name, value}}});
  if (d.verdict != Verdict::none) return;
  d.verdict = Verdict::effects;
  d.verdict_probability = probability;
  d.refusal.clear();
}

double deviation_of(const Check& check) {
  return (check.interval[1] - check.interval[0]) / (2 * 1.96);
}

// `as_read`: the gap with the delay.
void add_delay(Diagnosis& d, const Check& check, const GapSize& as_read) {
  add_measured(d, "sensor_delay", {"delay_s", "s", check.value, deviation_of(check)}, 1, 1);
  if (d.power != PowerSource::battery) return;
  if (!d.shrinkage) d.shrinkage.emplace().after = d.power_absolute_relative;
  Shrinkage& s = *d.shrinkage;
  std::tie(d.energy_relative, d.power_absolute_relative) = as_read;
  s.before = d.power_absolute_relative;
  s.fraction = 1 - s.after / s.before;
  s.interval = {missing, missing};
  s.remaining_over_noise_floor = s.after / d.noise_floor;
}

// A delay that the checks measured: of all electrical channels behind the wheels, or of the battery's behind
// the motors'.
struct MeasuredDelay {
  double electrical_s = 0, battery_s = 0;
};

MeasuredDelay measured_delay(std::span<const Check> checks, const telemetry::RecordingSet& recordings) {
  const auto check = [&](std::string_view id) { return std::ranges::find(checks, id, &Check::id); };
  if (const auto late = check("electrical_delay"); late != checks.end()) {
    const bool motors = std::ranges::any_of(recordings.missions, [](const telemetry::Recording& m) {
      return std::ranges::any_of(m.samples, [](const auto& s) {
        return std::isfinite(s.motor_current_a[0] + s.motor_current_a[1]);
      });
    });
    if (late->channel == "battery_current" && motors) return {0, late->value};
    return {late->value, 0};
  }
  // Where the gyro leads the wheels, the wheels are late and all other channels lead them.
  const auto gyro = check("yaw_rate_delay");
  return {gyro == checks.end() ? 0 : std::min(0.0, gyro->value), 0};
}

}  // namespace

std::vector<Check> check_and_correct(telemetry::RecordingSet& recordings, robot::RobotModel& robot) {
  std::vector<Check> checks = plausibility::drop_impossible(recordings, robot);
  std::ranges::move(plausibility::check_recordings(recordings, robot), std::back_inserter(checks));
  silence_contradicted(recordings, checks);
  for (Check& check : checks) {
    if (of_radius(check)) robot.kinematics.wheel_radius_m /= *check.factor;
    state_correction(check);
  }
  return checks;
}

void move_back(telemetry::Recording& mission, double delay_s, bool battery_alone) {
  namespace reading = plausibility::reading;
  constexpr std::size_t first = reading::motor_voltage, last = reading::battery_current;
  constexpr double rounding = 1e-6;
  struct Row {
    double t_s;
    std::array<double, last + 1 - first> readings;
  };
  std::vector<Row> rows;
  for (const signals::Sample& s : mission.samples) {
    Row& row = rows.emplace_back();
    row.t_s = 1e-6 * static_cast<double>(s.utime_us - mission.samples.front().utime_us);
    for (std::size_t c = first; c <= last; ++c) row.readings[c - first] = *signals::numbers_of(s)[c];
  }
  std::size_t next = 1;
  for (std::size_t k = 0; k < rows.size(); ++k) {
    const double at_s = rows[k].t_s + delay_s;
    while (next + 1 < rows.size() && rows[next].t_s < at_s) ++next;
    const Row &a = rows[next - 1], &b = rows[std::min(next, rows.size() - 1)];
    const double part = (at_s - a.t_s) / (b.t_s - a.t_s);
    const bool inside = part >= -rounding && part <= 1 + rounding;
    const auto moved = signals::numbers_of(mission.samples[k]);
    for (std::size_t c = battery_alone ? reading::battery_voltage : first; c <= last; ++c)
      *moved[c] =
          inside ? std::lerp(a.readings[c - first], b.readings[c - first], part) : signals::unmeasured;
  }
}

Result<Diagnosis> diagnose(const telemetry::RecordingSet& recordings, const robot::RobotModel& file,
                           const Progress& progress) {
  telemetry::RecordingSet trusted = recordings;
  robot::RobotModel robot = file;
  std::vector<Check> checks = check_and_correct(trusted, robot);
  const auto [electrical_s, battery_s] = measured_delay(checks, trusted);
  GapSize as_read;
  if (electrical_s != 0) as_read = gap_as_read(trusted, robot);
  for (telemetry::Recording& mission : trusted.missions)
    if (battery_s != 0 || electrical_s != 0)
      move_back(mission, battery_s != 0 ? battery_s : electrical_s, battery_s != 0);
  const auto late = std::ranges::find(checks, "electrical_delay", &Check::id);
  if (late != checks.end()) late->says += " The diagnosis uses readings that are moved back by this delay.";
  // Where a sensor or the robot changed between missions, each side is diagnosed separately: the later one is
  // current.
  const auto sides = split_at_step(trusted, checks);
  Result<Diagnosis> d = Diagnoser(sides ? (*sides)[1] : trusted, robot, progress, checks).run();
  if (!d) return d;
  if (electrical_s != 0 && late != checks.end()) add_delay(*d, *late, as_read);
  if (const auto radius = std::ranges::find_if(checks, of_radius); radius != checks.end())
    add_measured(
        *d, "wheel_radius_error",
        {"ratio", "1", 1 / *radius->factor - 1, deviation_of(*radius) / std::pow(*radius->factor, 2)},
        1 / *radius->factor, radius->probability);
  d->notes.insert(d->notes.begin(), recordings.notes.begin(), recordings.notes.end());
  if (sides) {
    TRY_ASSIGN(const Diagnosis earlier, Diagnoser((*sides)[0], robot, progress, {}).run());
    d->notes.push_back(earlier_words(earlier, (*sides)[1].missions.front().mission_id));
  }
  return d;
}

}  // namespace joulecast::gap

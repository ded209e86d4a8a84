#include "gap/diagnose/recordings.h"

#include <algorithm>
#include <cmath>
#include <map>

#include "gap/diagnose/account.h"
#include "gap/diagnose/channel_gaps.h"
#include "gap/diagnose/controls.h"
#include "gap/diagnose/fewer_causes.h"
#include "gap/diagnose/held_out.h"
#include "gap/diagnose/late_battery.h"
#include "gap/diagnose/naming.h"
#include "gap/diagnose/referee.h"
#include "gap/diagnose/refit.h"
#include "gap/diagnose/ripple.h"
#include "gap/diagnose/wheel_scale.h"
#include "gap/equations/power.h"
#include "gap/traits.h"
#include "gap/verdict/figures.h"
#include "gap/verdict/judge.h"
#include "gap/verdict/next_drive.h"
#include "gap/verdict/text.h"
#include "gap/verdict/where.h"
#include "gap/verdict/words.h"
#include "statistics/bootstrap.h"
#include "statistics/robust.h"

namespace joulecast::gap {
namespace {

constexpr std::size_t fewest_windows = 40;
constexpr double large_gap = 0.15,
                 huge_gap = 0.25;  // of the power: where more may be there, and another start
constexpr double usual_share = 0.07,
                 large_share = 0.3;  // of the mean power, that an effect which is there may move
constexpr std::size_t more_members = 6;
constexpr double clearly_better = 0.9;  // of what the file's point leaves, that another may
constexpr double most_parts_name = 0.5;
constexpr double contested = 0.7;  // most of the probability of one of many that are estimated together
constexpr double settled_delay_s = 0.006, settled_bias = 0.1;
constexpr int most_delay_rounds = 3;
constexpr std::size_t ripple_surrogates = 20;

// Progress of the stages, as parts of the whole.
constexpr double after_fit = 0.35, after_parts = 0.6;

// What these effects do to when and how electrical readings are taken is taken out of the windows.
void take_out(std::span<const Cause> causes, windows::WindowSettings& settings) {
  settings.electrical_delay_s = settings.motor_current_bias_a = 0;
  for (const Cause& cause : causes) {
    const std::string_view id = cause.effect.effect->info().id;
    const auto& values = cause.effect.values;
    if (id == "sensor_delay") settings.electrical_delay_s = values[0];
    if (id == "current_sensor_bias") settings.motor_current_bias_a = values[0] * values[1];
  }
}

// Whether a strength stands where the catalogue ends.
bool at_its_bound(const Cause& cause) {
  constexpr double close = 0.02;  // of the range
  const dynamics::EffectParameter& strength = cause.effect.effect->info().parameters.front();
  const double value = cause.effect.values[0], room = close * (strength.maximum - strength.minimum);
  return std::fabs(value) > room && (value < strength.minimum + room || value > strength.maximum - room);
}

class Diagnoser {
 public:
  // `delay_s`: of the electrical channels behind the wheels, as checks measured it.
  Diagnoser(const telemetry::RecordingSet& recordings, const robot::RobotModel& robot,
            const DiagnosisSettings& settings, double delay_s)
      : recordings_(recordings), robot_(robot), settings_(settings), measured_delay_s_(delay_s) {}

  Result<Diagnosis> run();

 private:
  // The recordings as equations, with what sensor effects do to readings taken out.
  struct View {
    std::vector<Window> windows;
    std::vector<double> power_w;
  };

  bool goes_on(double part) const { return !settings_.progress || settings_.progress(part); }
  Material material() const {
    return {robot_,       adopted_,        view_.windows, blocks_,
            from_motion_, readings_.row_s, covariates_,   settings_.prior_factor};
  }
  std::vector<double> modelled(std::span<const Cause> causes) const {
    return modelled_power(robot_, adopted_, causes, view_.windows);
  }

  Equations equations() const { return {*fit_->linear.columns, fit_->linear.rows, fit_->linear.noise}; }

  // What is said of the channel whose power is judged; the end where it is none.
  std::vector<ChannelGap>::iterator power_gap() {
    return std::ranges::find(d_.channels, d_.power == PowerSource::battery ? "battery_power" : "motor_power",
                             &ChannelGap::channel);
  }

  View view_of(const windows::WindowSettings& settings) const;
  bool prepare();
  Diagnosis nothing_to_judge();
  void measure();
  bool fit();
  bool leave_out();
  bool judge_all();
  void keep_found_again(const Problem& problem, const Explanation& explanation, Named& named);
  void name_base(const Problem& problem, Explanation& explanation, std::vector<Controls>& controls,
                 Named& named);
  std::vector<dynamics::ActiveEffect> instead_of(const Problem& problem, const Member& member) const;
  void add_wander(const Mixture& mixture, const Explanation& explanation, Findings& findings) const;
  std::array<double, 2> load_by_time() const;
  void add_baseline();
  void lower_noise_floor(double left);

  const telemetry::RecordingSet& recordings_;
  const robot::RobotModel& robot_;
  const DiagnosisSettings& settings_;
  double measured_delay_s_;
  std::vector<dynamics::ActiveEffect> adopted_;
  std::vector<std::string> covariates_;
  windows::Readings readings_;
  windows::WindowSettings taken_out_;
  View view_, plain_;
  std::vector<double> plain_model_w_;  // by the robot file, of the plain windows
  std::size_t blocks_ = 0;
  FromMotion from_motion_;
  FitSettings fit_settings_;
  std::optional<FitResult> fit_;
  std::optional<FitResult> moved_;       // where the first is of the file's point: of what was found
  std::optional<FitResult> calibrated_;  // beside what every robot has, where the file is far off
  std::optional<HeldOut> held_out_;
  std::optional<HeldOut> by_base_;          // by what every robot has, estimated anew, alone
  std::map<std::size_t, double> reopened_;  // of the gap, without a hypothesis that the base has
  HypothesisSet named_;
  std::vector<Cause> causes_;  // with their own strengths; beside the named, FitResult::base
  Diagnosis d_;
};

Diagnoser::View Diagnoser::view_of(const windows::WindowSettings& settings) const {
  View view;
  view.windows = windows::make_windows(recordings_.missions, robot_, readings_, settings);
  keep_known_motion(view.windows);
  windows::assign_blocks(view.windows, recordings_.missions);
  view.power_w = measured_power(view.windows, robot_, d_.power == PowerSource::motors);
  return view;
}

// Whether there is anything to judge by.
bool Diagnoser::prepare() {
  covariates_ = windows::covariate_names(recordings_.missions);
  readings_ = windows::find_readings(recordings_.missions);
  plain_ = view_of({});
  const auto known = [](double p) { return std::isfinite(p); };
  std::size_t turns = 0, moved = 0;
  for (const Window& w : plain_.windows) {
    turns += std::isfinite(w.yaw_rate_rad_s) || std::isfinite(w.turn_rad) ? 1 : 0;
    blocks_ = std::max(blocks_, w.block + 1);
    const auto settled = [&](std::size_t side) { return w.moving[side] || w.resting[side]; };
    moved += w.reading || (settled(0) && settled(1)) ? 1 : 0;
  }
  d_.motion_known = moved >= fewest_windows;
  const std::size_t few = plain_.windows.size() / 5;
  d_.motor_channels = readings_.motor_currents;
  from_motion_ = from_motion_of(readings_);
  d_.power = PowerSource::battery;
  if (std::ranges::none_of(plain_.power_w, known)) {
    d_.power = PowerSource::motors;
    plain_.power_w = measured_power(plain_.windows, robot_, true);
    if (std::ranges::none_of(plain_.power_w, known)) d_.power = PowerSource::none;
  }
  if (d_.power == PowerSource::motors && !voltages_read(plain_.windows))
    d_.notes.emplace_back(
        "The motors' voltages were not recorded: power is that of their currents at the voltages that the "
        "robot file's windings need for them.");
  view_ = plain_;
  return d_.motion_known &&
         (d_.power == PowerSource::battery || d_.motor_channels || from_motion_.voltage || turns > few);
}

void Diagnoser::measure() {
  plain_model_w_ = modelled_power(robot_, adopted_, {}, plain_.windows);
  d_.channels = channel_gaps(material());
  if (d_.power == PowerSource::none) {
    d_.noise_floor = d_.energy_relative = d_.power_absolute_relative = missing;
    return;
  }
  const GapSize size = gap_size(plain_.power_w, plain_model_w_);
  d_.energy_relative = size.energy_relative;
  d_.power_absolute_relative = size.absolute_relative;
  const auto gap = power_gap();
  d_.noise_floor = gap == d_.channels.end() ? missing : gap->noise_floor;
  d_.where = localise(plain_.windows, robot_, adopted_, plain_.power_w, plain_model_w_, d_.noise_floor);
}

bool Diagnoser::fit() {
  const bool far = d_.power_absolute_relative - d_.noise_floor > far_off;
  fit_settings_.shares = {usual_share};
  fit_settings_.explain.candidate = true;
  // Power alone is nearly linear in every strength, and what evidence finds of it is not always sure enough
  // to see all other causes from there.
  fit_settings_.again = !from_motion_.alone();
  if (d_.power_absolute_relative > large_gap) fit_settings_.shares.push_back(large_share);
  // Of a file that is far off what every robot has is calibrated; the search is not for that.
  if (d_.power_absolute_relative > large_gap && !far) fit_settings_.explain.most_members = more_members;
  const double settled_bias_a = settled_bias * robot_.motor.friction_torque_nm[0] /
                                (robot_.motor.torque_constant_nm_a * robot_.motor.gear_ratio);
  const auto still = [&] { return goes_on(after_fit * 0.5); };
  // A delay is linear only while it is short beside the window, a bias only while it turns no current's sign:
  // what is found is taken out of the windows and fitted again, from what checks measured on.
  if (measured_delay_s_ != 0) {
    taken_out_.electrical_delay_s = measured_delay_s_;
    view_ = view_of(taken_out_);
  }
  for (int round = 0;; ++round) {
    fit_ = fit_windows(material(), {}, fit_settings_, still);
    if (fit_ && d_.power_absolute_relative > huge_gap && round == 0 && !from_motion_.alone()) {
      auto other = fit_windows(material(), base_fit(material(), view_.power_w, Starts::regression),
                               fit_settings_, still);
      if (!other) return false;
      if (other->log_joint > fit_->log_joint) fit_ = std::move(other);
    }
    if (!fit_) return false;
    if (!fit_settings_.again) break;
    const windows::WindowSettings before = taken_out_;
    take_out(fit_->causes, taken_out_);
    const bool settled =
        std::fabs(taken_out_.electrical_delay_s - before.electrical_delay_s) < settled_delay_s &&
        std::fabs(taken_out_.motor_current_bias_a - before.motor_current_bias_a) < settled_bias_a;
    if (settled || round >= most_delay_rounds) break;
    view_ = view_of(taken_out_);
  }
  if (!fit_settings_.again) {
    FitSettings settings = fit_settings_;
    settings.again = true;
    moved_ = fit_windows(material(), {}, settings, still);
    if (!moved_) return false;
  }
  if (far) {
    FitResult from;
    from.base = base_fit(material(), view_.power_w, Starts::both);
    from.in_force = adopted_;
    for (const Cause& cause : from.base) from.in_force.push_back(cause.effect);
    calibrated_ = fit_windows(based(material(), from), {}, fit_settings_, still);
    if (!calibrated_) return false;
    calibrated_->base = std::move(from.base);
    calibrated_->in_force = std::move(from.in_force);
  }
  return goes_on(after_fit);
}

// What predicts parts left out best is judged: effects alone, seen from the robot file or from what was
// found, what every robot has, or both.
bool Diagnoser::leave_out() {
  const auto hold = [&](const FitResult& fit) {
    return hold_out(material(), fit, view_.power_w, fit_settings_,
                    [&](double part) { return goes_on(std::lerp(after_fit, after_parts, part)); });
  };
  held_out_ = hold(*fit_);
  if (!held_out_) return false;
  if (moved_) {
    auto moved = hold(*moved_);
    if (!moved) return false;
    if (moved->explained() < clearly_better * held_out_->explained()) {
      held_out_ = std::move(moved);
      fit_ = std::move(moved_);
    }
  }
  if (!calibrated_) return true;
  auto calibrated = hold(*calibrated_);
  if (!calibrated) return false;
  calibrated_->alone = true;
  auto alone = hold(*calibrated_);
  if (!alone) return false;
  if (alone->explained() > calibrated->explained()) {
    calibrated_->alone = false;
    by_base_ = std::move(alone);
    alone = std::move(calibrated);
  }
  if (alone->explained() < held_out_->explained()) {
    held_out_ = std::move(alone);
    fit_ = std::move(calibrated_);
  }
  return true;
}

// Beside what every robot has stands what most fits without a part name, too; without any the base stands
// alone.
void Diagnoser::keep_found_again(const Problem& problem, const Explanation& explanation, Named& named) {
  for (std::size_t k = named.set.size(); k-- > 0;) {
    const Member& m = *std::ranges::find(explanation.members, named.set[k], &Member::hypothesis);
    if (held_out_->found_again(stated_ids(problem, m)) >= most_parts_name) continue;
    named.set.erase(named.set.begin() + static_cast<std::ptrdiff_t>(k));
    named.causes.erase(named.causes.begin() + static_cast<std::ptrdiff_t>(k));
  }
  if (!named.set.empty() || !by_base_) return;
  fit_->alone = true;
  held_out_ = std::move(by_base_);
}

// Of what every robot has, estimated anew, what parts left out need is named as well; its standard deviation
// is the jackknife's.
void Diagnoser::name_base(const Problem& problem, Explanation& explanation, std::vector<Controls>& controls,
                          Named& named) {
  const std::vector<Cause> all = refit(material(), joined(fit_->base, named.causes));
  const std::vector<Need> needed = base_needed(material(), *fit_, *held_out_, view_.power_w);
  // Where one would have to go beyond what any robot has, the others make up for what it is not.
  const double surest =
      std::ranges::any_of(std::span(all).first(fit_->base.size()), at_its_bound) ? least_named : contested;
  for (std::size_t b = 0; b < fit_->base.size(); ++b) {
    const Cause& cause = all[b];
    const auto same = [&](const Hypothesis& h) { return h.is_effect() && h.cause().same_kind(cause); };
    const auto at = std::ranges::find_if(problem.hypotheses, same);
    if (at == problem.hypotheses.end() || needed[b].probability < least_named ||
        needed[b].share < ExplainSettings{}.least_share_for_certain)
      continue;
    const auto h = static_cast<std::size_t>(at - problem.hypotheses.begin());
    const double value = cause.effect.values[at->parameter];
    double squares = 0;
    for (const std::vector<Cause>& part : held_out_->causes)
      squares += std::pow(part[b].effect.values[at->parameter] - value, 2);
    const double parts = static_cast<double>(held_out_->causes.size());
    Member m;
    m.hypothesis = h;
    m.coefficients = {value};
    m.sd = {std::sqrt((parts - 1) / parts * squares)};
    m.by_evidence = m.by_prediction = std::min(needed[b].probability, surest);
    m.group_by_evidence = m.group_by_prediction = m.any_by_evidence = m.any_by_prediction = m.by_evidence;
    m.share = problem.moved(*at, Eigen::VectorXd::Constant(1, value));
    // What was found beside it of the same kind is part of it.
    for (std::size_t k = named.set.size(); k-- > 0;) {
      if (!problem.hypotheses[named.set[k]].excludes(*at) && named.set[k] != h) continue;
      named.set.erase(named.set.begin() + static_cast<std::ptrdiff_t>(k));
      named.causes.erase(named.causes.begin() + static_cast<std::ptrdiff_t>(k));
    }
    const auto own = std::ranges::find(explanation.members, h, &Member::hypothesis);
    if (own != explanation.members.end()) {
      controls.erase(controls.begin() + (own - explanation.members.begin()));
      explanation.members.erase(own);
    }
    explanation.members.push_back(m);
    controls.emplace_back();  // no surrogate is without what every robot has
    const auto place = std::ranges::lower_bound(named.set, h);
    named.causes.insert(named.causes.begin() + (place - named.set.begin()), cause);
    named.set.insert(place, h);
    reopened_[h] = needed[b].share / held_out_->unchanged();
  }
}

// What each alternative of a named member would be in its place.
std::vector<dynamics::ActiveEffect> Diagnoser::instead_of(const Problem& problem,
                                                          const Member& member) const {
  std::vector<dynamics::ActiveEffect> effects;
  for (const Alternative& a : member.stated()) {
    if (!problem.hypotheses[a.hypothesis].is_effect()) continue;
    HypothesisSet set = named_;
    std::ranges::replace(set, member.hypothesis, a.hypothesis);
    std::ranges::sort(set);
    const auto place = std::ranges::find(set, a.hypothesis) - set.begin();
    const std::vector<Cause> causes = strengths_of(equations(), problem, set);
    const Cause own = causes[static_cast<std::size_t>(place)];
    for (const Cause& cause : refit(material(), joined(fit_->base, causes))) {
      if (cause.same_kind(own)) effects.push_back(cause.effect);
    }
  }
  return effects;
}

void Diagnoser::add_wander(const Mixture& mixture, const Explanation& explanation, Findings& f) const {
  const Problem& problem = mixture.problem();
  double most = 0;
  for (std::size_t k = 0; k < explanation.members.size(); ++k) {
    const Member& m = explanation.members[k];
    if (problem.hypotheses[m.hypothesis].outside() || m.group_probability() < least_named ||
        m.wander < most_wander || m.share <= most)
      continue;
    most = m.share;
    f.wandering = k;
  }
  if (!f.wandering) return;
  const Member& m = explanation.members[*f.wandering];
  const auto place = static_cast<std::size_t>(std::ranges::find(explanation.whole, m.hypothesis) -
                                              explanation.whole.begin());
  const std::vector<double> by_block = mixture.by_block(explanation.whole, place);
  const double mean_w =
      m.share * fit_->linear.columns->mean_power_w() / std::max(std::fabs(m.coefficients[0]), 1e-12);
  const std::size_t third = std::max<std::size_t>(1, by_block.size() / 3);
  for (std::size_t b = 0; b < third; ++b) {
    f.wandering_power_w[0] += by_block[b] * mean_w / static_cast<double>(third);
    f.wandering_power_w[1] += by_block[by_block.size() - 1 - b] * mean_w / static_cast<double>(third);
  }
}

std::array<double, 2> Diagnoser::load_by_time() const {
  std::vector<Cause> others = causes_;
  std::erase_if(others,
                [](const Cause& c) { return !c.by && c.effect.effect->info().id == "accessory_load"; });
  const std::vector<double> model = modelled(others);
  double end_s = 0;
  for (const Window& w : view_.windows) end_s = std::max(end_s, w.t_s);
  std::array<double, 2> sum{}, count{};
  for (std::size_t k = 0; k < model.size(); ++k) {
    const double t_s = view_.windows[k].t_s;
    if (!std::isfinite(view_.power_w[k]) || (t_s > end_s / 3 && t_s < 2 * end_s / 3)) continue;
    const std::size_t at = t_s > end_s / 3 ? 1 : 0;
    sum[at] += view_.power_w[k] - model[k];
    count[at] += 1;
  }
  return {sum[0] / std::max(count[0], 1.0), sum[1] / std::max(count[1], 1.0)};
}

void Diagnoser::add_baseline() {
  if (!held_out_ || d_.power == PowerSource::none) return;
  d_.baseline = baseline_of(*held_out_);
  const Referee referee(material(), view_.power_w), model(material(), modelled({}));
  for (std::size_t k = 0; k < referee.terms().size(); ++k) {
    const auto at = static_cast<Eigen::Index>(k);
    add_term(*d_.baseline, referee.terms()[k], referee.fit().coefficients[at], referee.fit().sd[at],
             model.fit().coefficients[at]);
  }
}

// What predicts parts that had no part in it shows that noise makes no more than it leaves.
void Diagnoser::lower_noise_floor(double left) {
  if (!(left < d_.noise_floor)) return;
  d_.noise_floor = power_gap()->noise_floor = left;
  if (d_.shrinkage) d_.shrinkage->remaining_over_noise_floor = d_.shrinkage->after / left;
}

bool Diagnoser::judge_all() {
  if (!leave_out()) return false;
  const Problem problem = make_problem(*fit_->linear.columns, fit_->linear.rows, fit_->linear.noise, blocks_);
  const Mixture mixture(problem);
  const std::vector<bool> all_blocks;
  Explanation explanation = explain(mixture, all_blocks, fit_settings_.explain);
  prefer_fewer_causes(equations(), mixture, explanation);
  d_.detectable_share = seen_share(mixture);
  Named named;
  if (!fit_->alone)
    named = name_causes(based(material(), *fit_), equations(), problem, explanation, view_.power_w);
  if (!fit_->alone && !fit_->base.empty()) keep_found_again(problem, explanation, named);
  const ControlSettings controls{fit_settings_.explain, settings_.controls, settings_.threads};
  auto made = control(material(), fit_->linear, problem, explanation, controls,
                      [&](double part) { return goes_on(std::lerp(after_parts, 1.0, part)); });
  if (!made) return false;
  const HypothesisSet sought = named.set;
  if (!fit_->base.empty()) name_base(problem, explanation, *made, named);
  named_ = named.set;
  causes_ = refit(material(), joined(fit_->base, named.causes));
  std::vector<dynamics::ActiveEffect> all = adopted_;
  for (const Cause& cause : causes_) {
    if (!cause.by) all.push_back(cause.effect);
  }
  std::optional<Ripple> ripple;
  // Where readings are repeated over rows, what repeats with the wheel is the rows.
  if (!readings_.held())
    ripple = find_ripple(recordings_, robot_, all, d_.motor_channels, taken_out_.electrical_delay_s,
                         ripple_surrogates);

  Findings f{.problem = problem,
             .explanation = explanation,
             .controls = settings_.controls > 0 ? std::move(*made) : std::vector<Controls>{},
             .named = named_,
             .calibrated = !fit_->base.empty(),
             .held_out = held_out_,
             .ripple = ripple};
  const std::vector<double> after = modelled(causes_);
  f.shares = held_out_shares(material(), *fit_, problem, named_, view_.power_w);
  // Together these move far more than one by one: of each, what comes back without it.
  for (std::size_t k = 0; k < named_.size(); ++k) {
    if (const auto own = reopened_.find(named_[k]); own != reopened_.end()) f.shares[k] = own->second;
  }
  f.base = causes_;
  for (const Cause& name : named.causes) {
    const auto own = std::ranges::find_if(f.base, [&](const Cause& c) { return c.same_kind(name); });
    f.causes.push_back(*own);
    f.base.erase(own);
    std::vector<Cause> others = causes_;
    std::erase_if(others, [&](const Cause& c) { return c.same_kind(name); });
    const std::vector<double> without = modelled(others);
    double change = 0;
    for (std::size_t n = 0; n < after.size(); ++n) change += std::fabs(after[n] - without[n]);
    f.power_w.push_back(change / static_cast<double>(after.size()));
  }
  for (const std::size_t h : named_)
    f.instead.push_back(instead_of(problem, *std::ranges::find(explanation.members, h, &Member::hypothesis)));
  add_wander(mixture, explanation, f);
  f.load_by_time_w = load_by_time();
  add_baseline();
  if (!named_.empty() && d_.power != PowerSource::none)
    d_.shrinkage = shrinkage_of(*held_out_, problem.hypotheses, sought, d_.noise_floor);
  lower_noise_floor(std::min(held_out_->explained(), held_out_->referee()));
  judge(d_, f, robot_);
  if (d_.verdict == Verdict::none) d_.where.clear();
  if (d_.power == PowerSource::none) {  // nothing says what a name closes, or moves at the battery
    for (DiagnosedEffect& e : d_.effects) e.share = e.power_w = missing;
  }
  if (d_.effects.empty()) d_.shrinkage.reset();
  d_.next_drive = next_drives(fit_->linear, problem, robot_, d_.effects);
  if (!d_.outside.channel.empty()) {
    const auto more = drives_for(d_.outside);
    d_.next_drive.insert(d_.next_drive.begin(), more.begin(), more.end());
  }
  if (d_.power != PowerSource::none)
    d_.figures = figures_of(view_.windows, view_.power_w, modelled({}), after, recordings_, robot_);
  return true;
}

Result<Diagnosis> Diagnoser::run() {
  d_.robot_id = recordings_.robot_id;
  d_.missions = recordings_.missions.size();
  d_.samples = recordings_.samples;
  auto adopted = dynamics::active_effects(robot_);
  if (!adopted) return tl::unexpected(adopted.error());
  adopted_ = std::move(*adopted);
  if (!prepare()) return nothing_to_judge();
  measure();
  if (d_.power == PowerSource::battery && from_motion_.power) {
    if (auto check = wheel_scale_by_power(material(), plain_.power_w, d_.power_absolute_relative)) {
      d_.checks.push_back(std::move(*check));
      d_.motion_known = false;
      d_.channels.clear();
      d_.where.clear();
      return nothing_to_judge();
    }
  }
  if (!fit() || !judge_all()) return fail(Fault::conflict, "", "diagnosis cancelled");
  return std::move(d_);
}

Diagnosis Diagnoser::nothing_to_judge() {
  d_.noise_floor = d_.energy_relative = d_.power_absolute_relative = missing;
  d_.next_drive = first_drives(robot_);
  d_.refusal = "nothing was found that a robot file could take";
  d_.reasons = reasons_for(d_, false, false);
  return std::move(d_);
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
  // Where the gyro is ahead of the wheels, these are late, and all else is ahead of them.
  const auto gyro = check("yaw_rate_delay");
  return {gyro == checks.end() ? 0 : std::min(0.0, gyro->value), 0};
}

}  // namespace

Result<Diagnosis> diagnose(const telemetry::RecordingSet& recordings, const robot::RobotModel& robot,
                           const DiagnosisSettings& settings) {
  std::vector<Check> checks = check_recordings(recordings, robot);
  std::optional<telemetry::RecordingSet> cleared;
  if (std::ranges::any_of(checks, &Check::contradicted))
    silence_contradicted(cleared.emplace(recordings), checks);
  const auto [electrical_s, battery_s] = measured_delay(checks, cleared ? *cleared : recordings);
  if (battery_s != 0) {
    if (!cleared) cleared = recordings;
    for (telemetry::Recording& mission : cleared->missions) move_battery_back(mission, battery_s);
    std::ranges::find(checks, "electrical_delay", &Check::id)->says +=
        " What follows goes by readings that are moved back by that.";
  }
  const telemetry::RecordingSet& trusted = cleared ? *cleared : recordings;
  // Where a sensor or the robot changed between missions each side is judged alone: the later one is today's.
  const auto sides = split_at_step(trusted, checks);
  Result<Diagnosis> d = Diagnoser(sides ? (*sides)[1] : trusted, robot, settings, electrical_s).run();
  if (!d) return d;
  d->checks.insert(d->checks.begin(), checks.begin(), checks.end());
  d->notes.insert(d->notes.begin(), recordings.notes.begin(), recordings.notes.end());
  if (sides) {
    DiagnosisSettings quick = settings;
    quick.controls = 0;
    const Result<Diagnosis> earlier = Diagnoser((*sides)[0], robot, quick, electrical_s).run();
    if (!earlier) return earlier;
    d->notes.push_back(earlier_words(*earlier, (*sides)[1].missions.front().mission_id));
  }
  return d;
}

}  // namespace joulecast::gap

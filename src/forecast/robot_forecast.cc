#include "forecast/robot_forecast.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <utility>

namespace joulecast::forecast {
namespace {

constexpr double evidence_keep = 0.985;  // of old evidence, at each mission
constexpr double scatter_keep = 0.98;
constexpr double change_keep = 0.05;  // of old evidence and scores, at the robot's last change
constexpr double adapt_step = 0.03;   // of the logarithm of the width, at a miss of the interval
constexpr double widest = 4, narrowest = 0.5;
// Of two recorded robots 160 legs left 3.5 % of way over energy open, 400 left 1.4 %; a request takes 1 ms.
constexpr std::size_t max_typical_legs = 400;
constexpr std::size_t habit_missions = 40;
constexpr double least_amount = 1;   // J, s
constexpr double floor_share = 0.3;  // of the median leg: scatter of short legs does not shrink with them

// Scatter that is assumed before any is observed, and the number of legs or missions that the assumption
// counts for: a scaled inverse chi-squared distribution of variances, fitted by maximum likelihood to what 24
// robots of an independent plant and 24 virtual ones of six habits have learned after 30 missions (harmonic
// means of variances; degrees of freedom are 1 to 5 for legs of stated energies, 2 to 4 for missions). Stated
// durations are root mean squares of 100 robots that follow plans inexactly.
constexpr std::array<Scatter, subject_count> assumed{{{{0.031, 0.014, 0.029}, 0.0094},
                                                      {{0.039, 0.032, 0.047}, 0.0113},
                                                      {{0.051, 0.054, 0.102}, 0.016},
                                                      {{0.05, 0.02, 0.025}, 0.01},
                                                      {{0.05, 0.037, 0.04}, 0.0087},
                                                      {{0.05, 0.08, 0.122}, 0.0174}}};
constexpr double assumed_legs = 3, assumed_common_missions = 3;

// Estimates from fewer kept missions are repeated, up to so many missions in all.
constexpr std::int64_t few_missions = 6;

constexpr double keep_of(bool changed) {
  return changed ? change_keep : evidence_keep;
}

// The newest missions but one, which a habit is read from.
std::vector<PastMission> recent(const std::deque<PastMission>& missions, std::size_t without) {
  std::vector<PastMission> kept;
  for (std::size_t k = missions.size() - std::min(missions.size(), habit_missions); k < missions.size(); ++k)
    if (k != without) kept.push_back(missions[k]);
  return kept;
}

// The cruise that a past leg's plan stated. A leg too short for its cruise shows none: it has the usual one.
StatedPace pace_of(const Leg& leg, const Habit& habit) {
  const bool known = leg.planned_way > 0, turns = leg.motion == Motion::turn;
  double speed = known ? leg.planned_speed : leg.speed;
  if (all_ramp(speed, known ? leg.planned_s : leg.duration_s, known ? leg.planned_way : leg.way))
    speed = std::max(speed, turns ? habit.middle.yaw_rate_rad_s : habit.middle.speed_m_s);
  StatedPace pace;
  (turns ? pace.yaw_rate_rad_s : pace.speed_m_s) = speed;
  return pace;
}

// The scores of a robot with few missions show the model's error, mostly to one side, rather than the scatter
// about a corrected model: they count as the scatter's share of the variance.
double scatter_share(const Prediction& p) {
  return p.spread > 0 ? p.scatter * p.scatter / (p.spread * p.spread) : 0;
}

std::vector<Leg> measured(std::vector<Leg> legs) {
  std::erase_if(legs, [](const Leg& leg) { return !std::isfinite(leg.battery_j); });
  return legs;
}

}  // namespace

void PlanSum::repeat(double copies) {
  for (Features& x : features)
    for (double& value : x) value *= copies;
  for (auto& motions : squares)
    for (double& value : motions) value *= copies;
  for (double& count : stops) count *= copies;
  stated_s *= copies;
  way_m *= copies;
}

double Forecaster::amount(const Features& features, Subject subject) const {
  return track(subject).correction.energy_j(features);
}

void Forecaster::count(PlanSum& sum, Subject subject, Motion motion, const Features& x, double copies) const {
  const auto s = static_cast<std::size_t>(subject);
  const double one = amount(x, subject);
  for (std::size_t k = 0; k < feature_count; ++k) sum.features[s][k] += copies * x[k];
  sum.squares[s][static_cast<std::size_t>(motion)] += copies * one * one;
}

void Forecaster::extend(PlanSum& sum, const PricedLeg& leg, double copies) const {
  const double loaded = payload_limit_kg > 0 ? leg.payload_kg / payload_limit_kg : 0;
  const bool stands = leg.motion == Motion::stand;
  const Subject energy = energy_of(stands ? Driving::stated : leg.driving), time = duration_of(leg.driving);
  count(sum, energy, leg.motion, features_of(leg.motion, loaded, leg.cost, track(energy).correction), copies);
  if (stands)
    sum.stated_s += copies * leg.cost.duration_s;
  else
    count(sum, time, leg.motion, duration_features_of(leg.motion, loaded, leg.cost, track(time).correction),
          copies);
  if (leg.may_halt) sum.stops[leg.motion == Motion::turn ? 1 : 0] += copies;
  sum.way_m += copies * leg.way_m;
  sum.slower = sum.slower || leg.cost.slower;
  sum.impossible = sum.impossible || leg.cost.impossible;
}

// The scatter of legs and the uncertainty of corrections are independent; the common deviation of a mission's
// legs is common to both ways of driving too.
Prediction Forecaster::joined(const PlanSum& sum, std::span<const Subject> subjects, double halt_unit) const {
  Prediction p;
  double estimate = 0, variance = 0, common = 0;
  for (const Subject subject : subjects) {
    const auto s = static_cast<std::size_t>(subject);
    const Track& t = tracks[s];
    const double part = std::max(0.0, amount(sum.features[s], subject));
    if (p.scores == nullptr || part > 0) {
      p.scores = &t.scores;
      p.inflation = t.inflation;
    }
    if (!(part > 0)) continue;
    p.legs += part;
    // Scores show the scatter about a learned correction: they do not narrow the uncertainty of this one.
    const double narrowed = std::min(1.0, t.inflation * t.scores.deviation());
    estimate += t.correction.variance_j2(sum.features[s]) / (narrowed * narrowed);
    for (std::size_t k = 0; k < motion_count; ++k)
      variance += t.scatter[k] * t.scatter[k] * sum.squares[s][k];
    common += t.common * part;
  }
  if (p.legs > 0) {
    p.scatter = std::sqrt(variance + common * common) / p.legs;
    p.spread = std::hypot(p.scatter, std::sqrt(estimate) / p.legs);
  }
  p.halts = habit.standing(sum.stops, halt_unit);
  return p;
}

Prediction Forecaster::energy(const PlanSum& sum) const {
  constexpr std::array subjects{Subject::stated_energy, Subject::paced_energy, Subject::usual_energy};
  return joined(sum, subjects, standing_w * track(Subject::usual_energy).correction.mean[0]);
}

Prediction Forecaster::duration(const PlanSum& sum) const {
  constexpr std::array subjects{Subject::stated_duration, Subject::paced_duration, Subject::usual_duration};
  Prediction p = joined(sum, subjects, 1);
  p.fixed = sum.stated_s;
  return p;
}

RobotForecast::RobotForecast(robot::RobotModel robot, dynamics::DriveModel drive)
    : robot_(std::move(robot)),
      drive_(std::move(drive)),
      habit_(habit_of(robot_, {})),
      standing_w_(drive_.battery_power_for({0, 0})) {
  for (std::size_t k = 0; k < subject_count; ++k) siblings_[k] = pool(static_cast<Subject>(k), {});
}

void RobotForecast::set_model(robot::RobotModel robot, dynamics::DriveModel drive) {
  robot_ = std::move(robot);
  drive_ = std::move(drive);
  standing_w_ = drive_.battery_power_for({0, 0});
  learn_anew();
}

void RobotForecast::set_change(std::optional<drift::Mark> change) {
  const auto since = [](const std::optional<drift::Mark>& mark) { return mark ? mark->utime_us : 0; };
  const bool other = since(change) != since(change_);
  change_ = change;
  if (other) learn_anew();
}

// Whether the robot changed between two missions.
bool RobotForecast::changed(const PastMission& before, const PastMission& now) const {
  return change_ && before.start_utime_us < change_->utime_us && now.start_utime_us >= change_->utime_us;
}

void RobotForecast::set_siblings(std::array<Siblings, subject_count> siblings) {
  siblings_ = std::move(siblings);
  habit_ = habit_of(robot_, recent(missions_, missions_.size()), kind_habit());
}

void RobotForecast::learn_anew() {
  std::deque<PastMission> missions = std::exchange(missions_, {});
  learning_ = {};
  learnt_ = 0;
  settles_at_ = 1;
  habit_ = habit_of(robot_, {}, kind_habit());
  for (PastMission& mission : missions) learn(std::move(mission));
}

std::array<OwnFinding, subject_count> RobotForecast::findings() const {
  std::array<OwnFinding, subject_count> found;
  for (std::size_t k = 0; k < subject_count; ++k) {
    found[k].correction = learning_[k].fit.posterior(untried(static_cast<Subject>(k)));
    found[k].scatter = scatter(static_cast<Subject>(k), assumed[k]);
    found[k].habit = habit_;
    found[k].scores = learning_[k].scores.entries();
    found[k].missions = learnt_;
  }
  return found;
}

// As observed, and as assumed from the start.
Scatter RobotForecast::scatter(Subject subject, const Scatter& start) const {
  const Learning& learning = learning_[static_cast<std::size_t>(subject)];
  const auto deviation = [](const Sum& seen, double assumed_deviation, double assumed_weight) {
    return std::sqrt(std::max(0.0, assumed_weight * assumed_deviation * assumed_deviation + seen.squares) /
                     (assumed_weight + seen.weight));
  };
  Scatter found;
  for (std::size_t k = 0; k < motion_count; ++k)
    found.legs[k] = deviation(learning.scatter[k], start.legs[k], assumed_legs);
  constexpr double least_common = 0.005;
  found.common = std::max(least_common, deviation(learning.common, start.common, assumed_common_missions));
  return found;
}

Forecaster::Track RobotForecast::track(Subject subject) const {
  const auto s = static_cast<std::size_t>(subject);
  const Learning& learning = learning_[s];
  const Siblings& siblings = siblings_[s];
  const Scatter scattered = scatter(subject, siblings.scatter.value_or(assumed[s]));
  Forecaster::Track t;
  t.correction = learning.fit.posterior(siblings.prior);
  t.scatter = scattered.legs;
  t.common = scattered.common;
  // Samples show the end of a command to a period: the scores of legs do not narrow the durations of plans.
  if (subject == Subject::stated_duration) return t;
  t.scores = pooled_scores(learning.scores, siblings.scores);
  t.inflation = std::exp(learning.log_inflation);
  return t;
}

Forecaster RobotForecast::with_track(Subject subject) const {
  Forecaster now;
  now.tracks[static_cast<std::size_t>(subject)] = track(subject);
  now.habit = habit_;
  now.standing_w = standing_w_;
  now.payload_limit_kg = robot_.limits.payload_kg;
  return now;
}

Prediction RobotForecast::Seen::predicted(Subject subject, const Forecaster& by) const {
  return is_duration(subject) ? by.duration(sum) : by.energy(sum);
}

double RobotForecast::Seen::score(const Prediction& p) const {
  return p.score_of(std::max(least_amount, measured + halted));
}

RobotForecast::Seen RobotForecast::seen(Subject subject, const PastMission& mission,
                                        const Forecaster& now) const {
  const LegPricer pricer(robot_, drive_);
  const Driving driving = driving_of(subject);
  const bool usual = driving == Driving::usual, time = is_duration(subject);
  const auto s = static_cast<std::size_t>(subject);
  Seen seen;
  const auto lasting = static_cast<std::size_t>(duration_of(driving));
  const double late_s =
      usual || time ? 0 : learning_[lasting].fit.posterior(siblings_[lasting].prior).mean[0];
  const auto add = [&](const Leg& leg, bool before_halt) {
    PricedLeg priced{leg.motion,
                     leg.payload_kg,
                     0,
                     driving == Driving::stated  ? pricer.driven(leg, true)
                     : driving == Driving::paced ? pricer.usual(leg, now.habit.with(pace_of(leg, now.habit)))
                                                 : pricer.usual(leg, now.habit),
                     driving,
                     usual && leg.motion != Motion::stand};
    // Commands and plans state halts from the end of the command.
    if (before_halt && !usual && leg.planned_way > 0) {
      priced.cost.runs_on = 1;
      priced.cost.standing_j += late_s * standing_w_;
    }
    const double loaded = now.payload_limit_kg > 0 ? leg.payload_kg / now.payload_limit_kg : 0;
    const Correction& by = now.tracks[s].correction;
    seen.legs.push_back({time ? duration_features_of(leg.motion, loaded, priced.cost, by)
                              : features_of(leg.motion, loaded, priced.cost, by),
                         time ? leg.duration_s : leg.battery_j, 0});
    seen.motions.push_back(leg.motion);
    return priced;
  };
  double sum = 0;
  for (std::size_t k = 0; k < mission.legs.size(); ++k) {
    const Leg& leg = mission.legs[k];
    const bool stands = leg.motion == Motion::stand;
    if (stands && usual) seen.halted += time ? leg.duration_s : leg.battery_j;
    // How exactly a plan is followed shows where it is known.
    const bool unplanned = subject == Subject::stated_duration && !(leg.planned_way > 0);
    if ((stands && (driving != Driving::stated || time)) || unplanned) continue;
    const bool before_halt = k + 1 < mission.legs.size() && mission.legs[k + 1].motion == Motion::stand;
    now.extend(seen.sum, add(leg, before_halt));
    seen.measured += seen.legs.back().battery_j;
    sum += std::max(0.0, now.amount(seen.legs.back().features, subject));
  }
  seen.foreseen = seen.legs.size();
  if (driving != Driving::stated && !time) {
    for (const Leg& leg : mission.legs)
      if (leg.motion == Motion::stand) add(leg, false);
  }
  const double floor =
      std::max(least_amount, floor_share * sum / std::max(1.0, static_cast<double>(seen.foreseen)));
  for (std::size_t k = 0; k < seen.legs.size(); ++k) {
    const double amount = std::max(floor, now.amount(seen.legs[k].features, subject));
    seen.legs[k].deviation_j = amount * now.tracks[s].scatter[static_cast<std::size_t>(seen.motions[k])];
  }
  return seen;
}

void RobotForecast::score(Subject subject, const PastMission& mission) {
  Learning& learning = learning_[static_cast<std::size_t>(subject)];
  const Forecaster with = with_track(subject);
  const Forecaster::Track& now = with.track(subject);
  const Seen legs = seen(subject, mission, with);
  if (legs.foreseen == 0) return;
  const Prediction p = legs.predicted(subject, with);
  const double z = legs.score(p), beyond = 0.5 * (1 - interval);
  if (learnt_ > 0) {
    const double width = now.inflation;
    const bool hit = z >= width * now.scores.quantile(beyond) && z <= width * now.scores.quantile(1 - beyond);
    learning.log_inflation =
        std::clamp(learning.log_inflation + adapt_step * ((hit ? 0.0 : 1.0) - (1 - interval)),
                   std::log(narrowest), std::log(widest));
  }
  learning.scores.add(z, scatter_share(p));
  learning.fit.forget(evidence_keep);
  learning.fit.add(legs.legs, now.common, now.correction);
}

// Adds a mission to the scatter between legs, about the correction by all missions after the mission's common
// ratio (expectation maximisation: the correction's variance counts as well).
void RobotForecast::learn_scatter(Subject subject, const Seen& seen, const Correction& fitted) {
  Learning& learning = learning_[static_cast<std::size_t>(subject)];
  for (Sum& part : learning.scatter) part.squares *= scatter_keep, part.weight *= scatter_keep;
  double expected = 0;
  for (std::size_t k = 0; k < seen.foreseen; ++k)
    expected += std::max(0.0, fitted.energy_j(seen.legs[k].features));
  expected = std::max(least_amount, expected);
  const double ratio = std::max(least_amount, seen.measured) / expected;
  const double mean = expected / static_cast<double>(seen.foreseen);
  for (std::size_t k = 0; k < seen.legs.size(); ++k) {
    const Evidence& leg = seen.legs[k];
    Sum& part = learning.scatter[static_cast<std::size_t>(seen.motions[k])];
    const double amount = fitted.energy_j(leg.features), scale = amount / mean;
    const double off = (leg.battery_j / ratio - amount) / mean;
    // A robot pushed by a person is no scatter: at most the leg's amount.
    part.squares += std::min(off * off + fitted.variance_j2(leg.features) / (mean * mean), scale * scale);
    part.weight += scale * scale;
  }
}

// Adds a mission's common deviation, by the missions without it.
void RobotForecast::learn_common(Subject subject, const Seen& seen, const Forecaster& without) {
  const Prediction p = seen.predicted(subject, without);
  const double log_ratio = std::log(std::max(least_amount, seen.measured) / std::max(least_amount, p.legs));
  const double shared = without.track(subject).common * without.track(subject).common;
  const double scatter = p.scatter * p.scatter, estimate = p.spread * p.spread - scatter;
  // A mission that the estimate's own error dominates contains little information on the common deviation.
  const double weight = shared / (shared + estimate);
  constexpr double outlier = 9;
  Sum& common = learning_[static_cast<std::size_t>(subject)].common;
  common.squares =
      scatter_keep * common.squares +
      weight * std::clamp(log_ratio * log_ratio - scatter - estimate + shared, -shared, outlier * scatter);
  common.weight = scatter_keep * common.weight + weight;
}

// Estimates everything from the kept missions again: the correction by all, scatter about it, and common
// deviation and score of each mission by the others.
void RobotForecast::settle(Subject subject) {
  const auto s = static_cast<std::size_t>(subject);
  Learning& learning = learning_[s];
  Forecaster without = with_track(subject);
  Forecaster::Track& now = without.tracks[s];
  CorrectionFit all;
  std::vector<CorrectionFit> own(missions_.size());
  for (std::size_t k = 0; k < missions_.size(); ++k) {
    const Seen legs = seen(subject, missions_[k], without);
    own[k].add(legs.legs, now.common, now.correction);
    all.forget(keep_of(changed_at(k)));
    all.add(legs.legs, now.common, now.correction);
  }
  learning = {all, {}, {}, {}, 0};
  const Correction fitted = all.posterior(siblings_[s].prior);
  std::vector<double> kept(missions_.size(), 1);  // of each mission's evidence
  for (std::size_t k = missions_.size(); k-- > 1;) kept[k - 1] = kept[k] * keep_of(changed_at(k));
  std::vector<std::pair<Seen, Forecaster>> past;
  for (std::size_t k = 0; k < missions_.size(); ++k) {
    CorrectionFit others = all;
    others.remove(own[k], kept[k]);
    now.correction = others.posterior(siblings_[s].prior);
    if (driving_of(subject) != Driving::stated)
      without.habit = habit_of(robot_, recent(missions_, k), kind_habit());
    const auto& [legs, by] = past.emplace_back(seen(subject, missions_[k], without), without);
    if (legs.foreseen == 0) continue;
    learn_scatter(subject, legs, fitted);
    learn_common(subject, legs, by);
  }
  const Forecaster::Track settled = track(subject);
  for (std::size_t k = 0; k < missions_.size(); ++k) {
    auto& [legs, by] = past[k];
    by.tracks[s].scatter = settled.scatter;
    by.tracks[s].common = settled.common;
    if (changed_at(k)) learning.scores.discount(change_keep);
    if (legs.foreseen == 0) continue;
    const Prediction p = legs.predicted(subject, by);
    learning.scores.add(legs.score(p), scatter_share(p));
  }
}

void RobotForecast::learn(PastMission mission) {
  mission.legs = measured(std::move(mission.legs));
  double spent_j = 0;
  for (const Leg& leg : mission.legs) spent_j += leg.battery_j;
  if (mission.legs.empty() || spent_j < least_amount) return;

  if (!missions_.empty() && changed(missions_.back(), mission))
    for (Learning& learning : learning_) {
      learning.fit.forget(change_keep);
      learning.scores.discount(change_keep);
    }
  for (std::size_t k = 0; k < subject_count; ++k) score(static_cast<Subject>(k), mission);
  missions_.push_back(std::move(mission));
  if (missions_.size() > most_missions) missions_.pop_front();
  ++learnt_;

  habit_ = habit_of(robot_, recent(missions_, missions_.size()), kind_habit());
  if (learnt_ == settles_at_) {
    // Deviations and payloads are relative to the estimate, which one mission may change much.
    for (std::int64_t seen = 0; seen < few_missions; seen += std::ssize(missions_))
      for (std::size_t k = 0; k < subject_count; ++k) settle(static_cast<Subject>(k));
    settles_at_ += std::max<std::int64_t>(1, std::ssize(missions_) / 4);
  }
}

std::shared_ptr<const Forecaster> RobotForecast::forecaster() const {
  auto made = std::make_shared<Forecaster>();
  for (std::size_t k = 0; k < subject_count; ++k) made->tracks[k] = track(static_cast<Subject>(k));
  made->habit = habit_;
  made->standing_w = standing_w_;
  made->payload_limit_kg = robot_.limits.payload_kg;
  made->missions = learnt_;
  made->siblings = siblings_[0].robots;
  made->change = change_;
  for (auto m = missions_.rbegin(); m != missions_.rend() && made->typical.size() < max_typical_legs; ++m)
    std::ranges::copy_if(m->legs, std::back_inserter(made->typical),
                         [](const Leg& leg) { return leg.motion != Motion::stand; });
  return made;
}

}  // namespace joulecast::forecast

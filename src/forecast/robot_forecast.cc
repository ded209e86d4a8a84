#include "forecast/robot_forecast.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace joulecast::forecast {
namespace {

constexpr double evidence_keep = 0.985;  // of old evidence, at each mission
constexpr double scatter_keep = 0.98;
constexpr double change_keep = 0.05;  // of old evidence and scores, at the robot's last change
constexpr double adapt_step = 0.03;   // of the logarithm of the width, at a miss of the interval
constexpr double widest = 4, narrowest = 0.5;
constexpr std::size_t max_typical_legs = 40;
constexpr std::size_t habit_missions = 40;
constexpr double least_amount = 1;   // J, s
constexpr double floor_share = 0.3;  // of the median leg: scatter of short legs does not shrink with them

// Scatter that is assumed before any is observed, and the number of legs or missions that the assumption
// counts for. That of legs with a stated cruise is what 24 virtual robots of six habits have learned after 30
// missions (root mean squares; robots of an independent plant and recorded ones have less). That of usual
// legs is wider than theirs (0.11, 0.2, 0.03), as one mission shows little of a habit.
constexpr std::array<Scatter, subject_count> assumed{{{{0.05, 0.06, 0.1}, 0.02},
                                                      {{0.05, 0.065, 0.1}, 0.017},
                                                      {{0.05, 0.25, 0.25}, 0.04},
                                                      {{0.05, 0.03, 0.05}, 0.01},
                                                      {{0.05, 0.065, 0.085}, 0.013},
                                                      {{0.05, 0.25, 0.25}, 0.04}}};
constexpr double assumed_legs = 10, assumed_common_missions = 2;

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

constexpr std::array by_habit{Subject::paced_energy, Subject::usual_energy, Subject::paced_duration,
                              Subject::usual_duration};

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

// Of a forecast, relative: of the correction, of the legs' scatter and of their common deviation.
struct VarianceParts {
  double estimate = 0, legs = 0, common = 0;

  // The scores of a robot with few missions show the model's error, mostly to one side, rather than the
  // scatter about a corrected model: they count as the scatter's share.
  double scatter_share() const { return 1 - estimate / (estimate + legs + common); }
};

VarianceParts variance_of(const PlanSum& sum, Subject subject, const Forecaster& by) {
  const auto s = static_cast<std::size_t>(subject);
  const Forecaster::Track& track = by.tracks[s];
  const double expected = std::max(least_amount, by.amount(sum.features[s], subject));
  const double relative = 1 / (expected * expected);
  VarianceParts found{relative * track.correction.variance_j2(sum.features[s]), 0,
                      track.common * track.common};
  for (std::size_t k = 0; k < motion_count; ++k)
    found.legs += relative * track.scatter[k] * track.scatter[k] * sum.squares[s][k];
  return found;
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
  duration_s *= copies;
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
  const Features x = features_of(leg.motion, loaded, leg.cost);
  const bool stands = leg.motion == Motion::stand;
  count(sum, energy_of(stands ? Driving::stated : leg.driving), leg.motion, x, copies);
  if (stands)
    sum.stated_s += copies * leg.cost.duration_s;
  else
    count(sum, duration_of(leg.driving), leg.motion, duration_features_of(leg.motion, loaded, leg.cost),
          copies);
  if (leg.may_halt) sum.stops[leg.motion == Motion::turn ? 1 : 0] += copies;
  sum.duration_s += copies * leg.cost.duration_s;
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
    estimate += t.correction.variance_j2(sum.features[s]);
    // Scores of missions without payload do not narrow the uncertainty that payload adds.
    const double narrowed = std::min(1.0, t.inflation * t.scores.deviation());
    estimate += (1 / (narrowed * narrowed) - 1) * t.correction.covariance[payload_feature][payload_feature] *
                sum.features[s][payload_feature] * sum.features[s][payload_feature];
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
  const double least_common = subject == Subject::stated_duration ? 0.01 : 0.005;
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
  // Commands do not show whether a halt begins with their end or with that of the motion: the scores of legs
  // do not narrow the durations of plans.
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

double RobotForecast::Seen::score(Subject subject, const Forecaster& by) const {
  return predicted(subject, by).score_of(std::max(least_amount, measured + halted));
}

RobotForecast::Seen RobotForecast::seen(Subject subject, const PastMission& mission,
                                        const Forecaster& now) const {
  const LegPricer pricer(robot_, drive_);
  const Driving driving = driving_of(subject);
  const bool usual = driving == Driving::usual, time = is_duration(subject);
  const auto s = static_cast<std::size_t>(subject);
  Seen seen;
  const auto add = [&](const Leg& leg) {
    PricedLeg priced{leg.motion,
                     leg.payload_kg,
                     0,
                     driving == Driving::stated  ? pricer.driven(leg, true)
                     : driving == Driving::paced ? pricer.usual(leg, now.habit.with(pace_of(leg, now.habit)))
                                                 : pricer.usual(leg, now.habit),
                     driving,
                     usual && leg.motion != Motion::stand};
    const double loaded = now.payload_limit_kg > 0 ? leg.payload_kg / now.payload_limit_kg : 0;
    seen.legs.push_back({time ? duration_features_of(leg.motion, loaded, priced.cost)
                              : features_of(leg.motion, loaded, priced.cost),
                         time ? leg.duration_s : leg.battery_j, 0});
    seen.motions.push_back(leg.motion);
    return priced;
  };
  double sum = 0;
  for (const Leg& leg : mission.legs) {
    const bool stands = leg.motion == Motion::stand;
    if (stands && usual) seen.halted += time ? leg.duration_s : leg.battery_j;
    // How exactly a plan is followed shows where it is known.
    const bool unplanned = subject == Subject::stated_duration && !(leg.planned_way > 0);
    if ((stands && (driving != Driving::stated || time)) || unplanned) continue;
    now.extend(seen.sum, add(leg));
    seen.measured += seen.legs.back().battery_j;
    sum += std::max(0.0, now.amount(seen.legs.back().features, subject));
  }
  seen.foreseen = seen.legs.size();
  if (driving != Driving::stated && !time) {
    for (const Leg& leg : mission.legs)
      if (leg.motion == Motion::stand) add(leg);
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
  const auto s = static_cast<std::size_t>(subject);
  Learning& learning = learning_[s];
  const Forecaster with = with_track(subject);
  const Forecaster::Track& now = with.tracks[s];
  const Seen legs = seen(subject, mission, with);
  if (legs.foreseen == 0) return;
  const double z = legs.score(subject, with);

  const double expected = std::max(least_amount, with.amount(legs.sum.features[s], subject));
  const double measured = std::max(least_amount, legs.measured);
  const double log_ratio = std::log(measured / expected);
  const VarianceParts part = variance_of(legs.sum, subject, with);

  const double beyond = 0.5 * (1 - interval);
  if (learnt_ > 0) {
    const double width = now.inflation;
    const bool hit = z >= width * now.scores.quantile(beyond) && z <= width * now.scores.quantile(1 - beyond);
    learning.log_inflation =
        std::clamp(learning.log_inflation + adapt_step * ((hit ? 0.0 : 1.0) - (1 - interval)),
                   std::log(narrowest), std::log(widest));
  }
  learning.scores.add(z, part.scatter_share());

  learn_scatter(subject, legs, now, measured / expected);
  // A mission that the estimate's own error dominates contains little information on the common deviation.
  const double weight = part.common / (part.common + part.estimate);
  const double beyond_legs = log_ratio * log_ratio - part.legs - part.estimate;
  constexpr double outlier = 9;
  learning.common.squares =
      scatter_keep * learning.common.squares +
      weight * std::clamp(beyond_legs, -part.common, outlier * (part.common + part.legs));
  learning.common.weight = scatter_keep * learning.common.weight + weight;

  learning.fit.forget(evidence_keep);
  learning.fit.add(legs.legs, now.common, now.correction);
}

// Updates the scatter between legs, after removing the mission's common ratio.
void RobotForecast::learn_scatter(Subject subject, const Seen& seen, const Forecaster::Track& now,
                                  double ratio) {
  const auto s = static_cast<std::size_t>(subject);
  Learning& learning = learning_[s];
  for (Sum& part : learning.scatter) part.squares *= scatter_keep, part.weight *= scatter_keep;
  const double mean = seen.measured / ratio / static_cast<double>(seen.foreseen);
  for (std::size_t k = 0; k < seen.legs.size(); ++k) {
    const double amount = ratio * now.correction.energy_j(seen.legs[k].features);
    const auto motion = static_cast<std::size_t>(seen.motions[k]);
    Sum& part = learning.scatter[motion];
    constexpr double clipped = 9;  // a robot pushed by a person is no scatter
    const double assumed_square = assumed[s].legs[motion];
    const double off = (seen.legs[k].battery_j - amount) / mean, scale = amount / mean;
    part.squares += std::min(off * off, clipped * assumed_square * scale * scale);
    part.weight += scale * scale;
  }
}

void RobotForecast::refit(Subject subject) {
  Learning& learning = learning_[static_cast<std::size_t>(subject)];
  for (std::size_t k = 0; k < missions_.size(); ++k) {
    const Forecaster now = with_track(subject);
    const Seen legs = seen(subject, missions_[k], now);
    learning.fit.forget(keep_of(changed_at(k)));
    learning.fit.add(legs.legs, now.track(subject).common, now.track(subject).correction);
  }
}

// While the habit still changes, refits the corrections that depend on it.
void RobotForecast::settle() {
  if (learnt_ > static_cast<std::int64_t>(most_missions)) return;
  for (const Subject usual : by_habit) {
    learning_[static_cast<std::size_t>(usual)].fit = {};
    refit(usual);
  }
  for (std::size_t k = 0; k < subject_count; ++k) score_anew(static_cast<Subject>(k));
}

void RobotForecast::score_anew(Subject subject) {
  const auto s = static_cast<std::size_t>(subject);
  Learning& learning = learning_[s];
  Forecaster without = with_track(subject);
  const Forecaster::Track now = without.tracks[s];
  CorrectionFit all;
  std::vector<CorrectionFit> own(missions_.size());
  for (std::size_t k = 0; k < missions_.size(); ++k) {
    const Seen legs = seen(subject, missions_[k], without);
    own[k].add(legs.legs, now.common, now.correction);
    all.forget(keep_of(changed_at(k)));
    all.add(legs.legs, now.common, now.correction);
  }
  std::vector<double> kept(missions_.size(), 1);  // of each mission's evidence
  for (std::size_t k = missions_.size(); k-- > 1;) kept[k - 1] = kept[k] * keep_of(changed_at(k));
  learning.scores = {};
  learning.log_inflation = 0;
  for (std::size_t k = 0; k < missions_.size(); ++k) {
    CorrectionFit others = all;
    others.remove(own[k], kept[k]);
    without.tracks[s].correction = others.posterior(siblings_[s].prior);
    if (driving_of(subject) != Driving::stated)
      without.habit = habit_of(robot_, recent(missions_, k), kind_habit());
    const Seen legs = seen(subject, missions_[k], without);
    if (changed_at(k)) learning.scores.discount(change_keep);
    if (legs.foreseen > 0)
      learning.scores.add(legs.score(subject, without),
                          variance_of(legs.sum, subject, without).scatter_share());
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
    settle();
    settles_at_ += std::max<std::int64_t>(1, learnt_ / 4);
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
    made->typical.insert(made->typical.end(), m->legs.begin(), m->legs.end());
  return made;
}

}  // namespace joulecast::forecast

#include "forecast/robot_forecast.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <utility>

namespace joulecast::forecast {
namespace {

constexpr double evidence_keep = 0.985;  // of old evidence, at each mission
constexpr double scatter_keep = 0.98;
constexpr double adapt_step = 0.03;  // of the logarithm of the width, at a miss of the interval
constexpr double widest = 4, narrowest = 0.5;
constexpr std::int64_t watch_after = 5;   // missions: earlier scores are of a model hardly corrected
constexpr std::int64_t drift_shown = 20;  // missions
constexpr double drift_forgets = 0.05;    // share of old evidence and scores that survives a drift
constexpr std::size_t typical_legs = 40;
constexpr double least_energy_j = 1;
constexpr double floor_share = 0.3;  // of the median leg: scatter of short legs does not shrink with them

// What scatter is assumed before any is seen, and how many legs or missions the assumption counts for.
struct Assumed {
  std::array<double, motion_count> leg;
  double common;
};
constexpr std::array<Assumed, driving_count> assumed{
    {{{0.05, 0.08, 0.15}, 0.03}, {{0.05, 0.25, 0.25}, 0.04}}};
constexpr double assumed_legs = 10, assumed_missions = 4;

std::vector<Leg> measured(std::vector<Leg> legs) {
  std::erase_if(legs, [](const Leg& leg) { return !std::isfinite(leg.battery_j); });
  return legs;
}

}  // namespace

double Prediction::quantile_j(double probability) const {
  return corrected_j * std::exp(spread * scores->quantile(probability));
}

double Prediction::mean_j() const {
  return corrected_j * scores->mean_factor(spread);
}

double Prediction::probability_below(double energy_j, double deviation_j) const {
  const auto budget_covers = [&](double spent_j) {
    if (!(deviation_j > 0)) return spent_j <= energy_j ? 1.0 : 0.0;
    return 0.5 * std::erfc((spent_j - energy_j) / (deviation_j * std::numbers::sqrt2));
  };
  if (!(corrected_j > 0)) return budget_covers(0);
  constexpr double narrow = 0.5;  // deviation of the budget over that of the energy
  if (deviation_j <= narrow * corrected_j * spread) {
    // It widens the ratio as independent parts do, and leaves its shape.
    const double share = deviation_j / corrected_j;
    return scores->probability(std::log(std::max(energy_j / corrected_j, 1e-9)) / std::hypot(spread, share));
  }
  // Atoms four at a time: the budget's deviation blurs what lies between them.
  constexpr std::size_t together = 4;
  const auto atoms = scores->atoms();
  double sum = 0;
  for (std::size_t k = 0; k < atoms.size(); k += together) {
    sum += budget_covers(corrected_j * std::exp(spread * 0.5 * (atoms[k + 1] + atoms[k + 2])));
  }
  return sum * together / static_cast<double>(atoms.size());
}

void Forecaster::extend(PlanSum& sum, Driving driving, Motion motion, double payload_kg, const LegCost& cost,
                        double way_m, double copies) const {
  const Features x = features_of(motion, payload_limit_kg > 0 ? payload_kg / payload_limit_kg : 0, cost);
  const double energy = track(driving).correction.energy_j(x);
  for (std::size_t k = 0; k < feature_count; ++k) sum.features[k] += copies * x[k];
  sum.square_j2[static_cast<std::size_t>(motion)] += copies * energy * energy;
  sum.duration_s += copies * cost.duration_s;
  sum.way_m += copies * way_m;
}

Prediction Forecaster::predict(const PlanSum& sum, Driving driving) const {
  const Track& t = track(driving);
  Prediction p;
  p.scores = &t.scores;
  p.corrected_j = t.correction.energy_j(sum.features);
  if (!(p.corrected_j > 0)) {
    p.corrected_j = 0;
    return p;
  }
  double variance = t.correction.variance_j2(sum.features);
  for (std::size_t k = 0; k < motion_count; ++k) variance += t.scatter[k] * t.scatter[k] * sum.square_j2[k];
  p.spread = t.inflation * std::sqrt(variance / (p.corrected_j * p.corrected_j) + t.common * t.common);
  return p;
}

RobotForecast::RobotForecast(robot::RobotModel robot, dynamics::DriveModel drive)
    : robot_(std::move(robot)), drive_(std::move(drive)), pace_(default_pace(robot_)) {}

void RobotForecast::set_model(robot::RobotModel robot, dynamics::DriveModel drive) {
  robot_ = std::move(robot);
  drive_ = std::move(drive);
  learn_anew();
}

void RobotForecast::set_siblings(std::array<Siblings, driving_count> siblings) {
  siblings_ = std::move(siblings);
}

void RobotForecast::learn_anew() {
  std::deque<PastMission> missions = std::exchange(missions_, {});
  log_ratios_.clear();
  learning_ = {};
  drift_watch_ = {};
  drift_.reset();
  learnt_ = learnt_at_drift_ = 0;
  pace_ = default_pace(robot_);
  for (PastMission& mission : missions) learn(std::move(mission));
}

std::array<OwnFinding, driving_count> RobotForecast::findings() const {
  std::array<OwnFinding, driving_count> found;
  for (std::size_t k = 0; k < driving_count; ++k) {
    found[k].correction = learning_[k].fit.posterior(untried());
    found[k].scores = learning_[k].scores.entries();
    found[k].missions = learnt_;
  }
  return found;
}

Forecaster::Track RobotForecast::track(const Learning& learning, const Siblings& siblings) const {
  const Assumed& start = assumed[static_cast<std::size_t>(&learning - learning_.data())];
  Forecaster::Track t;
  t.correction = learning.fit.posterior(siblings.prior);
  for (std::size_t k = 0; k < motion_count; ++k) {
    const Sum& sum = learning.scatter[k];
    t.scatter[k] =
        std::sqrt((assumed_legs * start.leg[k] * start.leg[k] + sum.squares) / (assumed_legs + sum.weight));
  }
  constexpr double least_common = 0.005;
  t.common = std::sqrt(std::max(least_common * least_common,
                                (assumed_missions * start.common * start.common + learning.common.squares) /
                                    (assumed_missions + learning.common.weight)));
  t.scores = pooled_scores(learning.scores, siblings.scores);
  t.inflation = std::exp(learning.log_inflation);
  return t;
}

LegCost RobotForecast::cost(Driving driving, const Leg& leg) const {
  const LegPricer pricer(robot_, drive_);
  return driving == Driving::stated ? pricer.driven(leg) : pricer.paced(leg, pace_);
}

std::vector<Evidence> RobotForecast::evidence(Driving driving, const PastMission& mission,
                                              const Forecaster::Track& now) const {
  std::vector<Evidence> legs;
  legs.reserve(mission.legs.size());
  const double limit = robot_.limits.payload_kg;
  double sum = 0;
  for (const Leg& leg : mission.legs) {
    legs.push_back({features_of(leg.motion, limit > 0 ? leg.payload_kg / limit : 0, cost(driving, leg)),
                    leg.battery_j, 0});
    sum += std::max(0.0, now.correction.energy_j(legs.back().features));
  }
  const double floor = std::max(least_energy_j, floor_share * sum / static_cast<double>(legs.size()));
  for (std::size_t k = 0; k < legs.size(); ++k) {
    const double energy = std::max(floor, now.correction.energy_j(legs[k].features));
    legs[k].deviation_j = energy * now.scatter[static_cast<std::size_t>(mission.legs[k].motion)];
  }
  return legs;
}

double RobotForecast::score(Driving driving, const PastMission& mission, double& log_ratio) {
  Learning& learning = learning_[static_cast<std::size_t>(driving)];
  const Forecaster::Track now = track(learning, siblings_[static_cast<std::size_t>(driving)]);
  const std::vector<Evidence> legs = evidence(driving, mission, now);

  PlanSum sum;
  double spent_j = 0;
  for (std::size_t k = 0; k < legs.size(); ++k) {
    const double energy = now.correction.energy_j(legs[k].features);
    for (std::size_t f = 0; f < feature_count; ++f) sum.features[f] += legs[k].features[f];
    sum.square_j2[static_cast<std::size_t>(mission.legs[k].motion)] += energy * energy;
    spent_j += legs[k].battery_j;
  }
  const double expected_j = std::max(least_energy_j, now.correction.energy_j(sum.features));
  spent_j = std::max(least_energy_j, spent_j);
  log_ratio = std::log(spent_j / expected_j);
  const double relative = 1 / (expected_j * expected_j);
  const double estimate_part = relative * now.correction.variance_j2(sum.features);
  double leg_part = 0;
  for (std::size_t k = 0; k < motion_count; ++k)
    leg_part += relative * now.scatter[k] * now.scatter[k] * sum.square_j2[k];
  const double common_part = now.common * now.common;
  const double z = log_ratio / std::sqrt(estimate_part + leg_part + common_part);

  const double beyond = 0.5 * (1 - interval);
  if (learnt_ > 0) {
    const double width = now.inflation;
    const bool hit = z >= width * now.scores.quantile(beyond) && z <= width * now.scores.quantile(1 - beyond);
    learning.log_inflation =
        std::clamp(learning.log_inflation + adapt_step * ((hit ? 0.0 : 1.0) - (1 - interval)),
                   std::log(narrowest), std::log(widest));
  }
  // The scores of a robot hardly known tell of the model's error, mostly to one side, and not of the scatter
  // about a corrected one.
  learning.scores.add(z, 1 - estimate_part / (estimate_part + leg_part + common_part));

  // Scatter between legs, with what the whole mission was off taken out; and between missions, less what legs
  // and the estimate explain.
  const double ratio = spent_j / expected_j;
  for (Sum& part : learning.scatter) part.squares *= scatter_keep, part.weight *= scatter_keep;
  const double mean_j = expected_j / static_cast<double>(legs.size());
  for (std::size_t k = 0; k < legs.size(); ++k) {
    const double energy = ratio * now.correction.energy_j(legs[k].features);
    Sum& part = learning.scatter[static_cast<std::size_t>(mission.legs[k].motion)];
    constexpr double clipped = 9;  // a leg that a person pushed says nothing of scatter
    const double assumed_square =
        assumed[static_cast<std::size_t>(driving)].leg[static_cast<std::size_t>(mission.legs[k].motion)];
    const double off = (legs[k].battery_j - energy) / mean_j, scale = energy / mean_j;
    part.squares += std::min(off * off, clipped * assumed_square * scale * scale);
    part.weight += scale * scale;
  }
  // A mission that the estimate's own error dominates tells little of the rest.
  const double weight = common_part / (common_part + estimate_part);
  const double beyond_legs = log_ratio * log_ratio - leg_part - estimate_part;
  constexpr double outlier = 9;
  learning.common.squares =
      scatter_keep * learning.common.squares +
      weight * std::clamp(beyond_legs, -common_part, outlier * (common_part + leg_part));
  learning.common.weight = scatter_keep * learning.common.weight + weight;

  learning.fit.forget(evidence_keep);
  learning.fit.add(legs, now.common, now.correction);
  return z;
}

void RobotForecast::refit(Driving driving, std::size_t from) {
  Learning& learning = learning_[static_cast<std::size_t>(driving)];
  for (std::size_t k = from; k < missions_.size(); ++k) {
    const Forecaster::Track now = track(learning, siblings_[static_cast<std::size_t>(driving)]);
    learning.fit.forget(evidence_keep);
    learning.fit.add(evidence(driving, missions_[k], now), now.common, now.correction);
  }
}

std::optional<Drift> RobotForecast::watch(double score, double log_ratio) {
  log_ratios_.push_back(log_ratio);
  if (log_ratios_.size() > most_missions) log_ratios_.pop_front();
  if (drift_ && learnt_ - learnt_at_drift_ > drift_shown) drift_.reset();
  if (learnt_ <= watch_after) return std::nullopt;
  const auto since = std::min(drift_watch_.add(score),
                              static_cast<std::int64_t>(std::min(missions_.size(), log_ratios_.size())));
  if (since == 0) return std::nullopt;
  double sum = 0;
  for (auto k = log_ratios_.end() - since; k != log_ratios_.end(); ++k) sum += *k;
  drift_ = Drift{(missions_.end() - since)->start_utime_us, missions_.back().start_utime_us,
                 std::exp(sum / static_cast<double>(since)), since};
  learnt_at_drift_ = learnt_;
  for (std::size_t k = 0; k < driving_count; ++k) {
    learning_[k].fit.forget(drift_forgets);
    learning_[k].scores.discount(drift_forgets);
    refit(static_cast<Driving>(k), missions_.size() - static_cast<std::size_t>(since));
  }
  return drift_;
}

std::optional<Drift> RobotForecast::learn(PastMission mission) {
  mission.legs = measured(std::move(mission.legs));
  double spent_j = 0;
  for (const Leg& leg : mission.legs) spent_j += leg.battery_j;
  if (mission.legs.empty() || spent_j < least_energy_j) return std::nullopt;

  double log_ratio = 0, usual_ratio = 0;
  const double z = score(Driving::stated, mission, log_ratio);
  score(Driving::usual, mission, usual_ratio);
  missions_.push_back(std::move(mission));
  if (missions_.size() > most_missions) missions_.pop_front();
  ++learnt_;

  std::vector<Leg> recent;
  constexpr std::size_t habit_legs = 300;
  for (auto m = missions_.rbegin(); m != missions_.rend() && recent.size() < habit_legs; ++m)
    recent.insert(recent.end(), m->legs.begin(), m->legs.end());
  pace_ = usual_pace(robot_, recent);
  // While the habit is being found, what was learnt against it is learnt again.
  constexpr std::array<std::int64_t, 5> habit_settles{2, 4, 8, 16, 32};
  if (std::ranges::find(habit_settles, learnt_) != habit_settles.end()) {
    learning_[static_cast<std::size_t>(Driving::usual)].fit = {};
    refit(Driving::usual, 0);
  }
  return watch(z, log_ratio);
}

std::shared_ptr<const Forecaster> RobotForecast::forecaster() const {
  auto made = std::make_shared<Forecaster>();
  for (std::size_t k = 0; k < driving_count; ++k) made->tracks[k] = track(learning_[k], siblings_[k]);
  made->usual = pace_;
  made->payload_limit_kg = robot_.limits.payload_kg;
  made->missions = learnt_;
  made->siblings = siblings_[0].robots;
  made->drift = drift_;
  for (auto m = missions_.rbegin(); m != missions_.rend() && made->typical.size() < typical_legs; ++m)
    made->typical.insert(made->typical.end(), m->legs.begin(), m->legs.end());
  return made;
}

}  // namespace joulecast::forecast

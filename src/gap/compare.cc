#include "gap/compare.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <nlohmann/json.hpp>

#include "base/json_number.h"
#include "dynamics/catalogue.h"
#include "gap/design.h"
#include "gap/fit.h"

namespace joulecast::gap {
namespace {

constexpr std::size_t most_effects = 5;
constexpr double log_prior = -4.0;  // of an effect to be there, and again of its strength to differ
// Groups may be far from the model and from each other: an effect may be as large as this share of the power.
constexpr double expected_share = 0.5;
constexpr double likely_chance = 0.01;
// Hours of driving, before windows are left out: which they are depends on the order of the groups in time.
constexpr std::size_t most_windows = 40'000;
constexpr std::size_t fewest_windows = 20;  // of a group

// Coefficients of all columns with some of them free to differ between groups.
class GroupedFit {
 public:
  GroupedFit(const ColumnSet& columns, std::span<const Information> groups,
             std::span<const std::size_t> common, std::span<const std::size_t> free)
      : groups_(groups.size()), first_free_(static_cast<Eigen::Index>(columns.size())) {
    const auto p = static_cast<Eigen::Index>(columns.size());
    for (const std::size_t h : free) {
      for (const std::size_t c : columns.hypotheses()[h].columns) free_columns_.push_back(c);
    }
    const auto extra = static_cast<Eigen::Index>(free_columns_.size() * groups_);
    Eigen::VectorXd sd(p + extra);
    for (Eigen::Index k = 0; k < p; ++k) {
      const Column& c = columns.columns()[static_cast<std::size_t>(k)];
      sd[k] = c.tolerance > 0 ? c.tolerance : 1e-9 * std::max(1.0, c.scatter);
    }
    const auto expected = [&](std::size_t column) {
      const double power_w = columns.columns()[column].power_w;
      return power_w > 0 ? expected_share * columns.mean_power_w() / power_w : 0.0;
    };
    for (const auto& set : {common, free}) {
      for (const std::size_t h : set) {
        for (const std::size_t c : columns.hypotheses()[h].columns)
          sd[static_cast<Eigen::Index>(c)] = std::max(sd[static_cast<Eigen::Index>(c)], expected(c));
      }
    }
    Eigen::Index at = p;
    for (const std::size_t c : free_columns_) {
      for (std::size_t g = 0; g < groups_; ++g) sd[at++] = expected(c);
    }
    Eigen::MatrixXd xx = Eigen::MatrixXd::Zero(p + extra, p + extra);
    Eigen::VectorXd xy = Eigen::VectorXd::Zero(p + extra);
    for (std::size_t g = 0; g < groups_; ++g) {
      if (groups[g].xx.size() == 0) continue;
      xx.topLeftCorner(p, p) += groups[g].xx;
      xy.head(p) += groups[g].xy;
      for (std::size_t a = 0; a < free_columns_.size(); ++a) {
        const Eigen::Index i = place(a, g), ca = static_cast<Eigen::Index>(free_columns_[a]);
        xx.block(0, i, p, 1) = groups[g].xx.col(ca);
        xx.block(i, 0, 1, p) = groups[g].xx.row(ca);
        xy[i] = groups[g].xy[ca];
        for (std::size_t b = 0; b < free_columns_.size(); ++b)
          xx(i, place(b, g)) = groups[g].xx(ca, static_cast<Eigen::Index>(free_columns_[b]));
      }
    }
    Eigen::MatrixXd a = sd.asDiagonal() * xx * sd.asDiagonal();
    a.diagonal().array() += 1.0;
    const Eigen::LLT<Eigen::MatrixXd> factor(a);
    const Eigen::VectorXd b = sd.asDiagonal() * xy;
    const Eigen::VectorXd scaled = factor.solve(b);
    log_evidence_ = 0.5 * b.dot(scaled);
    for (Eigen::Index k = 0; k < a.rows(); ++k) log_evidence_ -= std::log(factor.matrixLLT()(k, k));
    mean_ = sd.asDiagonal() * scaled;
  }

  double log_evidence() const { return log_evidence_; }
  // The coefficient of a column in a group.
  double strength(std::size_t column, std::size_t group) const {
    double value = mean_[static_cast<Eigen::Index>(column)];
    for (std::size_t a = 0; a < free_columns_.size(); ++a) {
      if (free_columns_[a] == column) value += mean_[place(a, group)];
    }
    return value;
  }

 private:
  Eigen::Index place(std::size_t free, std::size_t group) const {
    return first_free_ + static_cast<Eigen::Index>(free * groups_ + group);
  }
  std::size_t groups_;
  Eigen::Index first_free_;
  std::vector<std::size_t> free_columns_;
  Eigen::VectorXd mean_;
  double log_evidence_ = 0;
};

// Probability that a chi-square variable exceeds x, by Wilson and Hilferty's cube root.
double chi_square_tail(double x, double degrees) {
  const double z = (std::cbrt(x / degrees) - 1 + 2 / (9 * degrees)) / std::sqrt(2 / (9 * degrees));
  return 0.5 * std::erfc(z / std::sqrt(2.0));
}

double chance_of(std::span<const GroupStrength> groups) {
  double weight = 0, sum = 0;
  std::size_t count = 0;
  for (const GroupStrength& g : groups) {
    if (!(g.deviation > 0)) continue;
    const double w = 1 / (g.deviation * g.deviation);
    weight += w;
    sum += w * g.value;
    ++count;
  }
  if (count < 2) return 1;
  double chi = 0;
  for (const GroupStrength& g : groups) {
    if (g.deviation > 0) chi += std::pow((g.value - sum / weight) / g.deviation, 2);
  }
  return chi_square_tail(chi, static_cast<double>(count - 1));
}

// Effects that groups share, and those of which each group has its own strength.
struct Choice {
  std::vector<std::size_t> common, differing;
  std::vector<double> gains;  // of each that differs, over one strength for all
  double explained = 0;       // log evidence, over none
};

// One effect after the other is taken in, with one strength for all or with one for each group, as long as
// that is worth it; of each effect one variant.
Choice choose(const ColumnSet& columns, std::span<const Information> groups,
              std::span<const std::size_t> candidates) {
  Choice choice;
  auto& [common, differing, gains, explained] = choice;
  const auto taken = [&](std::size_t h) {
    const auto same = [&](std::size_t other) {
      return columns.hypotheses()[other].effect.effect == columns.hypotheses()[h].effect.effect;
    };
    return std::ranges::any_of(choice.common, same) || std::ranges::any_of(choice.differing, same);
  };
  const double none = GroupedFit(columns, groups, {}, {}).log_evidence();
  double reached = none;
  while (common.size() + differing.size() < most_effects) {
    double best = 0, best_common = 0;
    std::size_t chosen = columns.hypotheses().size();
    bool differs = false;
    for (const std::size_t h : candidates) {
      if (taken(h)) continue;
      std::vector<std::size_t> more = common;
      more.push_back(h);
      const double alike = GroupedFit(columns, groups, more, differing).log_evidence() - reached + log_prior;
      more = differing;
      more.push_back(h);
      const double apart = GroupedFit(columns, groups, common, more).log_evidence() - reached + 2 * log_prior;
      if (std::max(alike, apart) <= best) continue;
      best = std::max(alike, apart);
      best_common = alike;
      differs = apart > alike;
      chosen = h;
    }
    if (chosen == columns.hypotheses().size()) break;
    if (differs) {
      differing.push_back(chosen);
      gains.push_back(best - best_common);
    } else {
      common.push_back(chosen);
    }
    reached = GroupedFit(columns, groups, common, differing).log_evidence();
  }
  explained = reached - none;
  return choice;
}

}  // namespace

std::string group_of(const std::string& mission_id, GroupBy by) {
  if (by == GroupBy::prefix) return mission_id.substr(0, mission_id.find('-'));
  const auto at = mission_id.rfind('_');
  return at == std::string::npos ? mission_id : mission_id.substr(at + 1);
}

Result<Comparison> compare_groups(const telemetry::RecordingSet& recordings,
                                  std::span<const std::string> group_of_mission,
                                  const robot::RobotModel& robot,
                                  const std::function<bool(double)>& progress) {
  if (const auto adopted = dynamics::active_effects(robot); !adopted) return tl::unexpected(adopted.error());
  Comparison c;
  c.robot_id = recordings.robot_id;
  std::map<std::string, std::size_t> index;
  for (const std::string& name : group_of_mission) index.emplace(name, 0);
  for (auto& [name, place] : index) {
    place = c.groups.size();
    c.groups.push_back({name, 0, 0});
  }
  if (c.groups.size() < 2 || recordings.missions.size() < 2)
    return invalid("log", "holds missions of one group only; two are needed to compare");
  std::vector<std::size_t> group(recordings.missions.size());
  for (std::size_t m = 0; m < group.size(); ++m) {
    group[m] = index.at(group_of_mission[m]);
    ++c.groups[group[m]].missions;
    c.groups[group[m]].samples += recordings.missions[m].samples.size();
  }
  WindowSettings many;
  many.most_windows = most_windows;
  const std::vector<Window> windows = make_windows(recordings, robot, many);
  std::vector<std::size_t> count(c.groups.size(), 0);
  for (const Window& w : windows) ++count[group[w.mission]];
  for (std::size_t g = 0; g < count.size(); ++g) {
    if (count[g] < fewest_windows)
      return invalid("log", "holds too little motion in group " + c.groups[g].name);
  }
  c.motor_currents = !without_motor_channels(windows);
  c.power_known =
      std::ranges::any_of(windows, [](const Window& w) { return std::isfinite(w.battery_power_w); });
  if (!c.motor_currents && !c.power_known)
    return invalid("log", "measures neither battery power nor motor current");

  // Effects at the wheels are what floors, tyres and days change. Motors, masses and sensors are the robot's
  // own; they may be off, but alike in every group.
  const ColumnSet columns(robot, windows, !c.motor_currents, Shapes{});
  const std::vector<Information> missions = mission_information(columns, make_design(columns, windows));
  if (progress && !progress(0.4)) return fail(Fault::conflict, "", "comparison cancelled");
  std::vector<std::size_t> candidates;
  for (std::size_t h = 0; h < columns.hypotheses().size(); ++h) {
    const Hypothesis& hypothesis = columns.hypotheses()[h];
    if (!hypothesis.outside() && hypothesis.effect.effect->info().acts_on == dynamics::ActsOn::wheel_torque &&
        !hypothesis.effect.effect->info().needs_position)
      candidates.push_back(h);
  }
  const auto grouped = [&](std::size_t without) {
    std::vector<Information> sums(c.groups.size());
    for (std::size_t m = 0; m < missions.size(); ++m) {
      if (m == without || missions[m].xx.size() == 0) continue;
      if (sums[group[m]].xx.size() == 0) {
        sums[group[m]] = missions[m];
      } else {
        sums[group[m]] += missions[m];
      }
    }
    return sums;
  };
  const std::vector<Information> all = grouped(missions.size());

  // Chosen twice: what the first choice explains says how far the formulas themselves can be believed.
  const double coarsening = coarsening_for(choose(columns, all, candidates).explained);
  if (progress && !progress(0.6)) return fail(Fault::conflict, "", "comparison cancelled");
  std::vector<Information> believed = all;
  for (Information& sum : believed) sum *= coarsening;
  const auto [common, differing, gains, explained] = choose(columns, believed, candidates);
  if (progress && !progress(0.8)) return fail(Fault::conflict, "", "comparison cancelled");
  for (const std::size_t h : common) c.common.push_back(columns.hypotheses()[h].id());

  // Common effects are read in each group too, so that what does not differ is seen beside what does.
  std::vector<std::size_t> shown = differing;
  shown.insert(shown.end(), common.begin(), common.end());
  const GroupedFit whole(columns, all, {}, shown);
  std::vector<GroupedFit> without;
  for (std::size_t m = 0; m < missions.size(); ++m)
    without.emplace_back(columns, grouped(m), std::span<const std::size_t>{}, shown);
  for (std::size_t k = 0; k < shown.size(); ++k) {
    const Hypothesis& h = columns.hypotheses()[shown[k]];
    const auto& info = h.effect.effect->info().parameters[h.parameter];
    ComparedEffect e{h.id(), std::string(info.name), std::string(info.unit), {}, 0, 1, false, true};
    for (std::size_t g = 0; g < c.groups.size(); ++g) {
      GroupStrength s{whole.strength(h.columns.front(), g), missing};
      double square = 0, n = static_cast<double>(c.groups[g].missions);
      for (std::size_t m = 0; m < missions.size(); ++m) {
        if (group[m] == g) square += std::pow(without[m].strength(h.columns.front(), g) - s.value, 2);
      }
      if (n > 1) s.deviation = std::sqrt(square * (n - 1) / n);
      e.groups.push_back(s);
    }
    if (k < differing.size()) e.gain = gains[k];
    e.possible = std::ranges::all_of(e.groups, [&](const GroupStrength& s) {
      const double room = std::isfinite(s.deviation) ? 2 * s.deviation : 0;
      return s.value > info.minimum - room && s.value < info.maximum + room;
    });
    e.chance = chance_of(e.groups);
    e.differs = k < differing.size() && e.gain > 0 && e.chance < likely_chance;
    c.effects.push_back(std::move(e));
  }
  if (!c.power_known) {
    c.limits.emplace_back(
        "Neither battery power nor the motors' voltages were recorded: torques are compared, in effects that "
        "act on "
        "the wheels. What the differences cost in watts, and all that lies between battery and motors, is "
        "not known.");
  }
  if (!c.motor_currents)
    c.limits.emplace_back("Without the motors' currents friction, motors and drivers share one equation.");
  c.limits.emplace_back(
      "Strengths take the robot file's torque constant and masses at their word: if those are off, all "
      "groups' "
      "strengths scale together; their ratios stay.");
  c.limits.emplace_back(
      "A group is what its name says and whatever else was different that day: payload, tyres, batteries, "
      "weather.");
  return c;
}

nlohmann::json to_json(const Comparison& c) {
  using nlohmann::json;
  json out = {{"robot_id", c.robot_id},       {"kind", "comparison"},    {"motor_currents", c.motor_currents},
              {"power_known", c.power_known}, {"groups", json::array()}, {"common", c.common},
              {"effects", json::array()},     {"limits", c.limits}};
  for (const ComparedGroup& g : c.groups)
    out["groups"].push_back({{"name", g.name}, {"missions", g.missions}, {"samples", g.samples}});
  for (const ComparedEffect& e : c.effects) {
    json strengths = json::object();
    for (std::size_t g = 0; g < e.groups.size(); ++g)
      strengths[c.groups[g].name] = {{"value", json_number(e.groups[g].value)},
                                     {"sd", json_number(e.groups[g].deviation)}};
    out["effects"].push_back({{"id", e.id},
                              {"parameter", e.parameter},
                              {"unit", e.unit},
                              {"differs", e.differs},
                              {"possible", e.possible},
                              {"log_evidence", json_number(e.gain)},
                              {"chance", json_number(e.chance)},
                              {"strengths", std::move(strengths)}});
  }
  return out;
}

}  // namespace joulecast::gap

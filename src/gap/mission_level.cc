#include "gap/mission_level.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <map>
#include <numbers>
#include <random>
#include <set>

#include "gap/run_columns.h"

namespace joulecast::gap {
namespace {

constexpr std::size_t most_effects = 3;
constexpr double least_share = 0.011;      // effects that move less of the energy are no finding
constexpr double alternative_odds = 0.04;  // beside the effect in whose place it would stand
constexpr double same_answer = 0.95;  // cosine from which what two effects do to these runs counts as one
constexpr double leading = 14;        // explanations this far below the best in log odds are let go
constexpr double report_probability = 0.5;
constexpr int bootstrap_draws = 400;
constexpr int most_refits = 8;
constexpr double settled = 0.005;       // relative change of the strengths
constexpr std::size_t most_folds = 60;  // more runs than this are left out in groups
constexpr std::size_t most_levels = 8;  // of a condition to be left out one by one

std::string text(const char* format, auto... values) {
  std::array<char, 400> buffer{};
  std::snprintf(buffer.data(), buffer.size(), format, values...);
  return buffer.data();
}

// Sets of candidates with what does not matter taken out and what cannot be told apart put together.
struct Judgement {
  std::vector<std::size_t> set;                        // the most probable one
  std::vector<double> probability, group_probability;  // of its members: alone, with what stands for them
  std::vector<std::vector<std::string>> alternatives;
  double none = 0, outside = 0;
};

class Judge {
 public:
  Judge(const RunColumns& columns, const RunSums& sums)
      : columns_(columns), evidence_(columns.candidates(), sums) {}

  const RunEvidence& evidence() const { return evidence_; }

  Judgement judge(std::size_t effects) const {
    const std::vector<RunExplanation> found = evidence_.search(effects);
    std::map<std::vector<std::size_t>, double> sets;
    double total = 0;
    for (const RunExplanation& e : found) {
      if (e.log_evidence < found.front().log_evidence - leading) break;
      const double weight = std::exp(e.log_evidence - found.front().log_evidence);
      sets[noticeable(e.candidates)] += weight;
      total += weight;
    }
    Judgement j;
    std::map<std::size_t, double> inclusion;
    for (auto& [set, p] : sets) {
      p /= total;
      if (set.empty()) j.none = p;
      bool outside = false;
      for (const std::size_t c : set) {
        inclusion[c] += p;
        outside = outside || columns_.candidates()[c].outside();
      }
      if (outside) j.outside += p;
    }
    // Candidates that do the same to these runs share a class, led by the most probable one.
    std::vector<std::pair<double, std::size_t>> order;
    for (const auto& [c, p] : inclusion) order.emplace_back(-p, c);
    std::ranges::sort(order);
    std::map<std::size_t, std::size_t> leader;
    for (const auto& [p, c] : order) {
      leader[c] = c;
      for (const auto& [other, first] : leader) {
        if (other == first && other != c && evidence_.likeness(c, other) > same_answer) leader[c] = other;
      }
    }
    std::map<std::vector<std::size_t>, double> classes;
    const auto class_of = [&](const std::vector<std::size_t>& set) {
      std::vector<std::size_t> leaders;
      for (const std::size_t c : set) leaders.push_back(leader[c]);
      std::ranges::sort(leaders);
      return leaders;
    };
    for (const auto& [set, p] : sets) classes[class_of(set)] += p;
    const auto best = std::ranges::max_element(classes, {}, [](const auto& c) { return c.second; });
    double highest = -1;
    for (const auto& [set, p] : sets) {
      if (class_of(set) != best->first || p <= highest) continue;
      highest = p;
      j.set = set;
    }
    for (const std::size_t member : j.set) {
      std::set<std::string> group{columns_.candidates()[member].id()};
      std::vector<std::string> others = alternatives(j.set, member);
      group.insert(others.begin(), others.end());
      for (const auto& [c, first] : leader) {
        if (first == leader[member]) group.insert(columns_.candidates()[c].id());
      }
      double alone = 0, together = 0;
      for (const auto& [set, p] : sets) {
        const auto holds = [&](auto&& test) {
          return std::ranges::any_of(set, [&](std::size_t c) { return test(columns_.candidates()[c].id()); });
        };
        if (holds([&](const std::string& id) { return id == columns_.candidates()[member].id(); }))
          alone += p;
        if (holds([&](const std::string& id) { return group.contains(id); })) together += p;
      }
      j.probability.push_back(alone);
      j.group_probability.push_back(together);
      j.alternatives.push_back(std::move(others));
    }
    return j;
  }

 private:
  std::vector<std::size_t> noticeable(const std::vector<std::size_t>& set) const {
    std::vector<std::size_t> kept;
    if (set.empty()) return kept;
    const RunEstimate estimate = evidence_.estimate(set);
    Eigen::Index at = 0;
    for (const std::size_t c : set) {
      double share = 0;
      for (const std::size_t column : columns_.candidates()[c].columns)
        share += std::fabs(estimate.mean[at++]) * columns_.size_of(column);
      if (share > least_share) kept.push_back(c);
    }
    return kept;
  }

  // Other effects that would do nearly as well in the place of one of the set, likeliest first.
  std::vector<std::string> alternatives(const std::vector<std::size_t>& set, std::size_t member) const {
    const auto& all = columns_.candidates();
    const double reference = evidence_.log_evidence(set);
    std::map<std::string, double> best;
    for (std::size_t c = 0; c < all.size(); ++c) {
      if (std::ranges::any_of(set, [&](std::size_t s) { return all[s].id() == all[c].id(); })) continue;
      std::vector<std::size_t> other = set;
      std::ranges::replace(other, member, c);
      std::ranges::sort(other);
      double& odds = best[all[c].id()];
      odds = std::max(odds, std::exp(std::min(50.0, evidence_.log_evidence(other) - reference)));
    }
    std::vector<std::pair<double, std::string>> order;
    for (const auto& [id, odds] : best) {
      if (odds > alternative_odds) order.emplace_back(-odds, id);
    }
    std::ranges::sort(order);
    std::vector<std::string> result;
    for (auto& [odds, id] : order) result.push_back(std::move(id));
    return result;
  }

  const RunColumns& columns_;
  RunEvidence evidence_;
};

std::size_t effects_allowed(std::size_t runs) {
  return std::min(most_effects, runs / 4 + 1);
}

RunSums sums_of(const RunColumns& columns, const std::vector<bool>& left_out) {
  RunSums sums(columns.tables(), columns.size());
  for (std::size_t k = 0; k < columns.runs().size(); ++k) {
    if (k < left_out.size() && left_out[k]) continue;
    for (const RunEquation& equation : columns.equations(k)) sums.add(equation);
  }
  return sums;
}

// The strengths of a set, fitted again around themselves: energies are linear in them only nearby.
struct Refit {
  RunEstimate estimate;
  std::vector<dynamics::ActiveEffect> effects;
};

Refit refit(const RunColumns& columns, const std::vector<std::size_t>& set, RunEstimate estimate,
            const std::vector<bool>& left_out) {
  Refit fit{std::move(estimate), {}};
  fit.effects = columns.effects_of(set, fit.estimate.mean);
  if (fit.effects.empty()) return fit;
  RunColumns around = columns;
  for (int round = 0; round < most_refits; ++round) {
    const Eigen::VectorXd before = fit.estimate.mean;
    around.linearise_around(fit.effects, set);
    fit.estimate = RunEvidence(around.candidates(), sums_of(around, left_out), set).estimate(set);
    fit.effects = columns.effects_of(set, fit.estimate.mean);
    if ((fit.estimate.mean - before).norm() <= settled * before.norm()) break;
  }
  return fit;
}

struct Fold {
  std::vector<std::string> effects;
  std::vector<std::string> groups;  // of each, its alternatives too
  std::vector<double> energies;     // of the runs left out, in their order
};

Fold predict_without(const RunColumns& columns, const std::vector<bool>& left_out) {
  const auto kept = static_cast<std::size_t>(std::ranges::count(left_out, false));
  const Judge judge(columns, sums_of(columns, left_out));
  const Judgement judgement = judge.judge(effects_allowed(kept));
  Fold fold;
  for (std::size_t k = 0; k < judgement.set.size(); ++k) {
    fold.effects.push_back(columns.candidates()[judgement.set[k]].id());
    fold.groups.push_back(fold.effects.back());
    for (const std::string& other : judgement.alternatives[k]) fold.groups.push_back(other);
  }
  const Refit fit = refit(columns, judgement.set, judge.evidence().estimate(judgement.set), left_out);
  for (std::size_t k = 0; k < left_out.size(); ++k) {
    if (left_out[k]) fold.energies.push_back(columns.modelled(k, fit.effects).sum_j);
  }
  return fold;
}

struct Errors {
  std::vector<double> before, after;
};

LeftOut summary(std::string what, const Errors& errors) {
  LeftOut out;
  out.what = std::move(what);
  out.runs = errors.before.size();
  const auto mean = [](const std::vector<double>& v) {
    double sum = 0;
    for (const double e : v) sum += e;
    return sum / static_cast<double>(v.size());
  };
  out.before = mean(errors.before);
  out.after = mean(errors.after);
  std::mt19937_64 random(20240229);
  std::uniform_int_distribution<std::size_t> pick(0, errors.before.size() - 1);
  std::vector<double> falls;
  for (int draw = 0; draw < bootstrap_draws; ++draw) {
    double before = 0, after = 0;
    for (std::size_t k = 0; k < errors.before.size(); ++k) {
      const std::size_t run = pick(random);
      before += errors.before[run];
      after += errors.after[run];
    }
    falls.push_back(before > 0 ? 1 - after / before : 0);
  }
  std::ranges::sort(falls);
  out.interval = {falls[bootstrap_draws / 40], falls[bootstrap_draws - 1 - bootstrap_draws / 40]};
  return out;
}

double error_of(double measured, double modelled) {
  return std::fabs(measured - modelled) / measured;
}

// The conditions that runs can be left out by: their levels, as sets of runs.
std::vector<std::pair<std::string, std::vector<bool>>> levels_of(std::span<const MissionRun> runs) {
  const auto key = [](const char* name, double value) { return std::string(name) + " " + text("%g", value); };
  const std::array<std::function<std::string(const MissionRun&)>, 4> conditions{
      [](const MissionRun& r) { return "table " + r.table; },
      [&](const MissionRun& r) { return key("payload_kg", r.at.payload_kg); },
      [&](const MissionRun& r) { return key("speed_m_s", r.at.speed_m_s); },
      [](const MissionRun& r) {
        return std::string(r.at.turn_rad == 0 ? "straight" : r.at.turn_rad > 0 ? "turn left" : "turn right");
      }};
  std::vector<std::pair<std::string, std::vector<bool>>> levels;
  for (const auto& name : conditions) {
    std::map<std::string, std::vector<bool>> sets;
    for (std::size_t k = 0; k < runs.size(); ++k) {
      auto& set = sets[name(runs[k])];
      set.resize(runs.size(), false);
      set[k] = true;
    }
    if (sets.size() < 2 || sets.size() > most_levels) continue;
    levels.insert(levels.end(), sets.begin(), sets.end());
  }
  return levels;
}

std::optional<TurningTerm> turning_term(std::span<const MissionRun> runs, const robot::RobotModel& robot) {
  const auto model = dynamics::drive_model(robot);
  TurningTerm t;
  double xx = 0, xy = 0, yy = 0;
  for (const MissionRun& run : runs) {
    if (run.at.turn_rad == 0 || !run.by_motor() || std::isnan(run.model_motor_j[0])) continue;
    const RunEnergy right = run_energy(*model, run.at), halved = run_energy(*model, run.at, 0.5);
    // The given model is taken to be in proportion where its energies are not those of the robot file.
    const double scale =
        (run.model_motor_j[0] + run.model_motor_j[1]) / (halved.motor_j[0] + halved.motor_j[1]);
    std::array<double, 2> change{};
    for (std::size_t s : {0u, 1u}) {
      change[s] = scale * (right.motor_j[s] - halved.motor_j[s]);
      t.motor_error_before += 0.5 * error_of(run.motor_j[s], run.model_motor_j[s]);
      t.motor_error_after += 0.5 * error_of(run.motor_j[s], run.model_motor_j[s] + change[s]);
    }
    const double energy = run.measured_j();
    const double x = (change[0] - change[1]) / energy;
    const double y = (run.motor_j[0] - run.motor_j[1] - run.model_motor_j[0] + run.model_motor_j[1]) / energy;
    t.side_difference += std::fabs(x);
    t.sum += (change[0] + change[1]) / energy;
    xx += x * x, xy += x * y, yy += y * y;
    ++t.runs;
  }
  if (t.runs < 2 || xx <= 0) return std::nullopt;
  const double n = static_cast<double>(t.runs);
  t.side_difference /= n, t.sum /= n, t.motor_error_before /= n, t.motor_error_after /= n;
  t.share = xy / xx;
  t.share_sd = std::sqrt(std::max(0.0, yy - xy * xy / xx) / (n - 1) / xx);
  return t;
}

std::vector<std::string> limits_of(const MissionDiagnosis& d, std::span<const MissionRun> runs,
                                   const RunColumns& columns) {
  std::vector<std::string> limits;
  limits.emplace_back(
      "Only energies are known: in which phase of a run, at which time or place the gap arises is not.");
  std::set<double> payloads, speeds;
  std::map<std::string, std::set<double>> by_table;
  for (const MissionRun& run : runs) {
    payloads.insert(run.at.payload_kg);
    speeds.insert(run.at.speed_m_s);
    by_table[run.table].insert(run.at.payload_kg);
  }
  const bool between =
      by_table.size() > 1 && payloads.size() > 1 &&
      std::ranges::all_of(by_table, [](const auto& table) { return table.second.size() == 1; });
  if (between) {
    limits.push_back(
        text("The payload changes only from table to table: whatever else differed between them "
             "counts as payload, beyond the %.1f %% by which tables are taken to scatter.",
             100 * d.scatters.table));
  }
  if (payloads.size() == 2) {
    limits.emplace_back(
        "Two payloads make a straight line: whether an effect grows in proportion to the payload is not "
        "tested. A third payload would.");
  } else if (payloads.size() == 1) {
    limits.emplace_back("One payload: nothing that depends on the load can be seen.");
  }
  if (const double range = *speeds.rbegin() / *speeds.begin(); range < 3) {
    limits.push_back(
        text("Speeds within a factor of %.1f: dry and viscous friction and drag are hardly told "
             "apart.",
             range));
  }
  if (d.model_given && std::fabs(d.model_ratio - 1) > 0.1) {
    limits.push_back(
        text("The given model energies are %.2f times those of the robot file under the stated "
             "conditions: one of the two is off (distances, say). Strengths are worked out with "
             "the stated conditions; strengths of friction fall in proportion to the distance.",
             d.model_ratio));
  }
  for (const DiagnosedEffect& e : d.effects) {
    const auto stands_for = [&](std::string_view id) {
      return e.id == id || std::ranges::find(e.alternatives, id) != e.alternatives.end();
    };
    if (stands_for("wheel_slip") || stands_for("wheel_radius_error")) {
      limits.push_back(text("Distances that are not what the table says would look like %s.", e.id.c_str()));
    }
    if (e.alternatives.size() < 2) continue;
    limits.push_back(text("%s stands for a group of %zu that these runs do not tell apart.", e.id.c_str(),
                          e.alternatives.size() + 1));
  }
  if (!columns.by_motor())
    limits.emplace_back("The motors were not measured singly: nothing is known of right against left.");
  return limits;
}

}  // namespace

Result<MissionDiagnosis> diagnose_runs(std::span<const MissionRun> given, const robot::RobotModel& robot,
                                       const MissionSettings& settings) {
  const auto cancelled = [&](double part) { return settings.progress && !settings.progress(part); };
  std::vector<MissionRun> runs(given.begin(), given.end());
  if (settings.robot_file_model) {
    for (MissionRun& run : runs) {
      run.model_energy_j = MissionRun::absent;
      run.model_motor_j = {MissionRun::absent, MissionRun::absent};
    }
  }
  if (const auto adopted = dynamics::active_effects(robot); !adopted) return tl::unexpected(adopted.error());
  RunColumns columns(runs, robot);
  MissionDiagnosis d;
  d.robot_id = robot.robot_id;
  d.model_given = columns.model_given();
  d.model_ratio = columns.model_ratio();
  d.not_visible = columns.not_visible();

  const Judge judge(columns, sums_of(columns, {}));
  const Judgement judgement = judge.judge(effects_allowed(runs.size()));
  const auto [estimate, effects] =
      refit(columns, judgement.set, judge.evidence().estimate(judgement.set), std::vector<bool>(runs.size()));
  if (cancelled(0.3)) return fail(Fault::conflict, "", "diagnosis cancelled");
  d.scatters = estimate.scatter;
  d.scatter = std::sqrt(2 / std::numbers::pi) * estimate.scatter.run;

  double measured = 0, modelled = 0;
  for (std::size_t k = 0; k < runs.size(); ++k) {
    JudgedRun run{runs[k], columns.modelled(k, {}).sum_j, columns.modelled(k, effects).sum_j, 0};
    measured += runs[k].measured_j();
    modelled += run.model_j;
    d.error += error_of(runs[k].measured_j(), run.model_j) / static_cast<double>(runs.size());
    d.runs.push_back(std::move(run));
  }
  d.energy_relative = (measured - modelled) / measured;

  double weakest = 1, unknown = 0;
  Eigen::Index at = 0;
  for (std::size_t k = 0; k < judgement.set.size(); ++k) {
    const RunCandidate& c = columns.candidates()[judgement.set[k]];
    if (c.outside()) {
      d.outside = c.variable;
      unknown = std::max(unknown, judgement.group_probability[k]);
      at += static_cast<Eigen::Index>(c.columns.size());
      continue;
    }
    DiagnosedEffect e;
    e.id = c.id();
    e.probability = judgement.probability[k];
    e.alternatives = judgement.alternatives[k];
    const auto& info = c.effect.effect->info().parameters;
    for (std::size_t p = 0; p < info.size(); ++p) {
      const bool own = p == c.parameter;
      e.parameters.push_back({std::string(info[p].name), std::string(info[p].unit),
                              own ? estimate.mean[at] : c.effect.values[p],
                              own ? estimate.sd[at] : MissionRun::absent});
    }
    weakest = std::min(weakest, judgement.group_probability[k]);
    ++at;
    d.effects.push_back(std::move(e));
  }
  d.outside_probability = judgement.outside;
  if (!d.outside.empty() && judgement.outside >= report_probability) {
    d.verdict = Verdict::outside;
    d.verdict_probability = judgement.outside;
  } else if (judgement.set.empty()) {
    d.verdict = judgement.none >= report_probability ? Verdict::none : Verdict::inconclusive;
    d.verdict_probability = judgement.none;
  } else {
    weakest = d.outside.empty() ? weakest : std::min(weakest, unknown);
    d.verdict = weakest >= report_probability ? Verdict::effects : Verdict::inconclusive;
    d.verdict_probability = weakest;
  }
  const std::vector<double> shares = columns.effect_shares(effects);
  for (std::size_t k = 0; k < d.effects.size(); ++k) {
    d.effects[k].share = shares[k];
    d.adoptable.push_back(dynamics::adopt(effects[k]));
  }

  // Everything, the search included, is done again without the runs that are then predicted.
  Errors all;
  const std::size_t folds = std::min(runs.size(), most_folds);
  for (std::size_t f = 0; f < folds; ++f) {
    std::vector<bool> out(runs.size(), false);
    for (std::size_t k = f; k < runs.size(); k += folds) out[k] = true;
    const Fold fold = predict_without(columns, out);
    std::size_t next = 0;
    for (std::size_t k = f; k < runs.size(); k += folds) {
      d.runs[k].held_out_j = fold.energies[next++];
      all.before.push_back(error_of(runs[k].measured_j(), d.runs[k].model_j));
      all.after.push_back(error_of(runs[k].measured_j(), d.runs[k].held_out_j));
    }
    const bool same = fold.effects.size() == judgement.set.size() &&
                      std::ranges::all_of(d.effects, [&](const DiagnosedEffect& e) {
                        return std::ranges::find(fold.groups, e.id) != fold.groups.end();
                      });
    d.folds_agreeing += same ? 1 : 0;
    if (cancelled(0.3 + 0.5 * static_cast<double>(f + 1) / static_cast<double>(folds)))
      return fail(Fault::conflict, "", "diagnosis cancelled");
  }
  d.folds = folds;
  d.left_out = summary(folds == runs.size() ? "each run" : "each fold", all);
  for (const auto& [what, out] : levels_of(runs)) {
    const Fold fold = predict_without(columns, out);
    Errors errors;
    std::size_t next = 0;
    for (std::size_t k = 0; k < runs.size(); ++k) {
      if (!out[k]) continue;
      errors.before.push_back(error_of(runs[k].measured_j(), d.runs[k].model_j));
      errors.after.push_back(error_of(runs[k].measured_j(), fold.energies[next++]));
    }
    d.conditions.push_back(summary(what, errors));
    d.conditions.back().effects = fold.effects;
    if (cancelled(0.8)) return fail(Fault::conflict, "", "diagnosis cancelled");
  }
  d.turning = turning_term(given, robot);
  d.limits = limits_of(d, runs, columns);
  std::vector<std::size_t> order(d.effects.size());
  for (std::size_t k = 0; k < order.size(); ++k) order[k] = k;
  std::ranges::stable_sort(order, std::greater{}, [&](std::size_t k) { return d.effects[k].share; });
  std::vector<DiagnosedEffect> sorted;
  for (const std::size_t k : order) sorted.push_back(d.effects[k]);
  d.effects = std::move(sorted);
  return d;
}

}  // namespace joulecast::gap

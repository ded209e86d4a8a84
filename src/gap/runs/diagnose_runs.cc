#include "gap/runs/diagnose_runs.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>
#include <set>

#include "gap/diagnose/account.h"
#include "gap/diagnose/held_out.h"
#include "gap/diagnose/naming.h"
#include "gap/runs/run_checks.h"
#include "gap/runs/run_referee.h"
#include "gap/runs/run_search.h"
#include "gap/verdict/judge.h"
#include "gap/verdict/words.h"
#include "statistics/bootstrap.h"
#include "statistics/shapley.h"

namespace joulecast::gap {
namespace {

constexpr std::size_t max_run_folds = 12;
constexpr std::size_t max_held_out_levels = 8;  // of a condition to be left out one by one

// Progress of the stages, as parts of the whole.
constexpr double after_search = 0.1, progress_after_run_folds = 0.4, after_conditions = 0.6;

double mean_absolute_normal(double sd) {
  return std::sqrt(2 / std::numbers::pi) * sd;
}

// The conditions that runs can be left out by: their levels, as sets of runs.
std::vector<std::pair<std::string, std::vector<bool>>> levels_of(const RunSet& set) {
  std::vector<std::pair<std::string, std::vector<bool>>> levels;
  const auto add = [&](auto&& name_of_run) {
    std::map<std::string, std::vector<bool>> sets;
    for (std::size_t k = 0; k < set.runs.size(); ++k) {
      const std::string name = name_of_run(set.runs[k]);
      if (name.empty()) return;
      auto& own = sets[name];
      own.resize(set.runs.size(), false);
      own[k] = true;
    }
    if (sets.size() >= 2 && sets.size() <= max_held_out_levels)
      levels.insert(levels.end(), sets.begin(), sets.end());
  };
  add([](const MissionRun& r) { return r.table.empty() ? "" : "table " + r.table; });
  for (std::size_t l = 0; l < set.labels.size(); ++l)
    add([&](const MissionRun& r) { return r.labels[l].empty() ? "" : set.labels[l] + " " + r.labels[l]; });
  add([](const MissionRun& r) { return fmt::format("payload_kg {:g}", r.at.payload_kg); });
  add([](const MissionRun& r) { return fmt::format("speed_m_s {:g}", r.at.speed_m_s); });
  add([](const MissionRun& r) {
    return std::string(r.at.turn_rad == 0 ? "straight" : r.at.turn_rad > 0 ? "turn left" : "turn right");
  });
  return levels;
}

class RunDiagnoser {
 public:
  RunDiagnoser(RunSet set, const robot::RobotModel& robot, std::vector<dynamics::ActiveEffect> adopted,
               const RunSettings& settings)
      : set_(std::move(set)),
        robot_(robot),
        settings_(settings),
        columns_(set_, robot, std::move(adopted)),
        block_(blocks_of(set_.runs, {})),
        referee_(columns_) {}

  Result<RunDiagnosis> run();

 private:
  bool goes_on(double part) const { return !settings_.progress || settings_.progress(part); }
  double measured(std::size_t run) const { return set_.runs[run].measured_j(); }

  void measure();
  bool hold_out_parts();
  bool hold_out_conditions();
  void add_baseline();
  bool judge_all();
  void add_limits();

  RunSet set_;
  const robot::RobotModel& robot_;
  const RunSettings& settings_;
  RunColumns columns_;
  std::vector<std::size_t> block_;
  RunReferee referee_;
  std::vector<double> measured_j_;
  RunFinding finding_;
  std::optional<HeldOut> held_out_;
  RunDiagnosis r_;
};

void RunDiagnoser::measure() {
  Diagnosis& d = r_.diagnosis;
  d.robot_id = robot_.robot_id;
  d.missions = d.samples = set_.runs.size();
  d.motor_channels = columns_.by_motor();
  d.power = columns_.by_motor() ? PowerSource::motors : PowerSource::battery;
  r_.model_given = columns_.model_given();
  r_.model_ratio = columns_.model_ratio();
  r_.not_visible = columns_.not_visible();
  r_.scatter = finding_.scatter.run;
  r_.side_scatter = columns_.by_motor() ? finding_.scatter.difference : missing;
  double all_measured = 0, all_modelled = 0;
  for (std::size_t k = 0; k < set_.runs.size(); ++k) {
    JudgedRun run{set_.runs[k], columns_.modelled(k, {}).sum_j, columns_.modelled(k, finding_.causes).sum_j,
                  missing};
    all_measured += measured(k);
    all_modelled += run.model_j;
    measured_j_.push_back(measured(k));
    r_.runs.push_back(std::move(run));
  }
  d.energy_relative = (all_measured - all_modelled) / all_measured;
  d.power_absolute_relative = columns_.error({});
  d.noise_floor = std::min(mean_absolute_normal(r_.scatter), d.power_absolute_relative);
  d.channels = {
      {columns_.by_motor() ? "motor_power" : "battery_power", d.power_absolute_relative, d.noise_floor}};
  d.detectable_share = seen_share(Mixture(finding_.problem));
}

bool RunDiagnoser::hold_out_parts() {
  const std::size_t blocks = 1 + *std::ranges::max_element(block_);
  HeldOut held;
  held.blocks.resize(blocks);
  held.parts = std::min(max_run_folds, blocks);
  for (std::size_t part = 0; part < held.parts; ++part) {
    std::vector<bool> out(set_.runs.size());
    for (std::size_t k = 0; k < out.size(); ++k) out[k] = block_[k] % held.parts == part;
    const RunFinding without = search_runs(columns_, block_, out);
    std::vector<std::string> ids;
    for (const std::size_t h : without.named) ids.push_back(columns_.hypotheses()[h].id());
    held.named.push_back(std::move(ids));
    const std::vector<double> refereed = referee_.fit(measured_j_, out).energy_j;
    for (std::size_t k = 0; k < out.size(); ++k) {
      if (!out[k]) continue;
      r_.runs[k].held_out_j = columns_.modelled(k, without.causes).sum_j;
      BlockErrors& b = held.blocks[block_[k]];
      b.unchanged += columns_.missed(k, r_.runs[k].model_j);
      b.explained += columns_.missed(k, r_.runs[k].held_out_j);
      b.referee += columns_.missed(k, refereed[k]);
      b.size += 1;
    }
    if (!goes_on(std::lerp(after_search, progress_after_run_folds,
                           static_cast<double>(part + 1) / static_cast<double>(held.parts))))
      return false;
  }
  held_out_ = std::move(held);
  return true;
}

bool RunDiagnoser::hold_out_conditions() {
  for (const auto& [what, out] : levels_of(set_)) {
    // Each run is a block of its own, so that any can be left out.
    std::vector<std::size_t> single(out.size());
    for (std::size_t k = 0; k < single.size(); ++k) single[k] = out[k] ? block_.size() : block_[k];
    const RunFinding without = search_runs(columns_, single, out);
    const std::vector<double> refereed = referee_.fit(measured_j_, out).energy_j;
    LeftOut l;
    l.what = what;
    std::vector<double> before, after;
    for (std::size_t k = 0; k < out.size(); ++k) {
      if (!out[k]) continue;
      before.push_back(columns_.missed(k, r_.runs[k].model_j));
      after.push_back(columns_.missed(k, columns_.modelled(k, without.causes).sum_j));
      l.before += before.back();
      l.after += after.back();
      l.referee += columns_.missed(k, refereed[k]);
    }
    l.runs = before.size();
    const auto n = static_cast<double>(l.runs);
    l.before /= n, l.after /= n, l.referee /= n;
    l.interval = statistics::bootstrap_interval(l.runs, [&](std::span<const int> draw) {
      double b = 0, a = 0;
      for (std::size_t k = 0; k < draw.size(); ++k) b += draw[k] * before[k], a += draw[k] * after[k];
      return 1 - a / b;
    });
    for (const std::size_t h : without.named) l.effects.push_back(columns_.hypotheses()[h].id());
    r_.conditions.push_back(std::move(l));
    if (!goes_on(after_conditions)) return false;
  }
  return true;
}

void RunDiagnoser::add_baseline() {
  Baseline& baseline = r_.diagnosis.baseline.emplace(baseline_of(*held_out_));
  const auto data = referee_.fit(measured_j_).regression;
  std::vector<double> modelled;
  for (const JudgedRun& run : r_.runs) modelled.push_back(run.model_j);
  const auto model = referee_.fit(modelled).regression;
  for (std::size_t k = 0; k < referee_.terms().size(); ++k) {
    const auto at = static_cast<Eigen::Index>(k);
    add_term(baseline, referee_.terms()[k], data.coefficients[at], data.sd[at], model.coefficients[at]);
  }
}

bool RunDiagnoser::judge_all() {
  auto controls = control_runs(columns_, block_, finding_, settings_.controls,
                               [&](double part) { return goes_on(std::lerp(after_conditions, 1.0, part)); });
  if (!controls) return false;
  const std::vector<Cause>& causes = finding_.causes;
  Findings f{.problem = finding_.problem,
             .explanation = finding_.explanation,
             .controls = settings_.controls > 0 ? std::move(*controls) : std::vector<Controls>{},
             .named = finding_.named,
             .causes = causes,
             .held_out = held_out_};
  f.shares = statistics::shapley_shares(causes.size(), [&](const std::vector<std::size_t>& members) {
    std::vector<Cause> some;
    for (const std::size_t k : members) some.push_back(causes[k]);
    return columns_.error(some);
  });
  for (std::size_t c = 0; c < causes.size(); ++c) {
    std::vector<Cause> others = causes;
    others.erase(others.begin() + static_cast<std::ptrdiff_t>(c));
    double change = 0;
    for (std::size_t k = 0; k < set_.runs.size(); ++k) {
      const auto whole = columns_.modelled(k, causes);
      change += std::fabs(whole.sum_j - columns_.modelled(k, others).sum_j) / whole.duration_s;
    }
    f.power_w.push_back(change / static_cast<double>(set_.runs.size()));
  }
  add_baseline();
  if (!finding_.named.empty())
    r_.diagnosis.shrinkage =
        shrinkage_of(*held_out_, columns_.hypotheses(), finding_.named, r_.diagnosis.noise_floor);
  judge(r_.diagnosis, f, robot_);
  if (r_.diagnosis.effects.empty()) r_.diagnosis.shrinkage.reset();
  return true;
}

void RunDiagnoser::add_limits() {
  std::vector<std::string>& limits = r_.limits;
  limits.emplace_back(
      "Only energies are known: in which phase of a run, at which time or place the gap arises is not.");
  std::set<double> payloads, speeds;
  std::map<std::string, std::set<double>> by_table;
  for (const MissionRun& run : set_.runs) {
    payloads.insert(run.at.payload_kg);
    speeds.insert(run.at.speed_m_s);
    by_table[run.table].insert(run.at.payload_kg);
  }
  if (by_table.size() > 1 && payloads.size() > 1 &&
      std::ranges::all_of(by_table, [](const auto& table) { return table.second.size() == 1; })) {
    limits.emplace_back(
        "The payload changes only from table to table: whatever else differed between them counts as "
        "payload, beyond "
        "the 2 % by which tables are taken to shift.");
  }
  if (payloads.size() == 2) {
    limits.emplace_back(
        "Two payloads make a straight line: whether an effect grows in proportion to the payload is not "
        "tested. A third "
        "payload would.");
  } else if (payloads.size() == 1) {
    limits.emplace_back("One payload: nothing that depends on the load can be seen.");
  }
  if (const double range = *speeds.rbegin() / *speeds.begin(); range < 3) {
    limits.push_back(fmt::format(
        "Speeds within a factor of {:.1f}: dry and viscous friction and drag are hardly distinguishable.",
        range));
  }
  if (r_.model_given && std::fabs(r_.model_ratio - 1) > 0.1) {
    limits.push_back(
        fmt::format("The given model energies are {:.2f} times those of the robot file under the stated "
                    "conditions: one of the two "
                    "is off (distances, say). Strengths are worked out with the stated conditions; strengths "
                    "of friction fall in "
                    "proportion to the distance.",
                    r_.model_ratio));
  }
  for (const DiagnosedEffect& e : r_.diagnosis.effects) {
    const auto stands_for = [&](std::string_view id) {
      return e.id == id || std::ranges::find(e.alternatives, id) != e.alternatives.end();
    };
    if (stands_for("wheel_slip") || stands_for("wheel_radius_error"))
      limits.push_back(fmt::format("Distances that are not what the table says would look like {}.", e.id));
  }
  if (!columns_.by_motor())
    limits.emplace_back("The motors were not measured singly: nothing is known of right against left.");
}

Result<RunDiagnosis> RunDiagnoser::run() {
  r_.diagnosis.checks = check_runs(columns_);
  const auto contradicted = std::ranges::find(r_.diagnosis.checks, true, &Check::contradicted);
  finding_ = search_runs(columns_, block_);
  if (contradicted != r_.diagnosis.checks.end()) {
    finding_.explanation.members.clear();
    finding_.named.clear();
    finding_.causes.clear();
  }
  measure();
  if (contradicted != r_.diagnosis.checks.end()) {
    // Energies that are none say nothing of any cause.
    r_.diagnosis.verdict = Verdict::inconclusive;
    r_.diagnosis.verdict_probability = 1;
    r_.diagnosis.reasons = {contradicted->says};
    r_.diagnosis.refusal = contradicted->says;
    add_limits();
    return std::move(r_);
  }
  if (!goes_on(after_search) || !hold_out_parts() || !hold_out_conditions() || !judge_all())
    return fail(Fault::conflict, "", "diagnosis cancelled");
  r_.turning = turning_term(set_.runs, robot_);
  add_limits();
  return std::move(r_);
}

}  // namespace

Result<RunDiagnosis> diagnose_runs(const RunSet& set, const robot::RobotModel& robot,
                                   const RunSettings& settings) {
  auto adopted = dynamics::active_effects(robot);
  if (!adopted) return tl::unexpected(adopted.error());
  RunSet judged = set;
  if (settings.robot_file_model) {
    for (MissionRun& run : judged.runs) {
      run.model_energy_j = MissionRun::absent;
      run.model_motor_j = {MissionRun::absent, MissionRun::absent};
    }
  }
  auto diagnosis = RunDiagnoser(std::move(judged), robot, *std::move(adopted), settings).run();
  if (diagnosis && settings.robot_file_model) diagnosis->turning = turning_term(set.runs, robot);
  return diagnosis;
}

}  // namespace joulecast::gap

#include "gap/runs/diagnose_runs.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>
#include <set>

#include "base/try.h"
#include "gap/runs/run_rows.h"
#include "gap/verdict/answer.h"
#include "gap/verdict/words.h"
#include "statistics/regression.h"
#include "statistics/robust.h"

namespace joulecast::gap {
namespace {

// Progress of the stages, as parts of the whole.
constexpr double after_search = 0.6;

double mean_absolute_normal(double sd) {
  return std::sqrt(2 / std::numbers::pi) * sd;
}

class RunDiagnoser {
 public:
  RunDiagnoser(const RunSet& set, const robot::RobotModel& robot, std::vector<dynamics::ActiveEffect> in_file,
               const Progress& progress)
      : set_(set), robot_(robot), progress_(progress), rows_(set, robot, std::move(in_file)) {}

  RunDiagnosis run() {
    Diagnosis& d = r_.diagnosis;
    measure();
    RunChecks checked = check_runs(rows_, robot_);
    d.checks = std::move(checked.checks);
    const auto contradicted = std::ranges::find(d.checks, true, &Check::contradicted);
    if (contradicted != d.checks.end()) return nothing_to_judge(contradicted->says);
    rows_.silence(checked.apart);
    report(0);
    fit_ = posterior::walk(rows_.data);
    if (!(fit_->noise.back().sigma > 0))
      return nothing_to_judge(
          "The energies follow from the conditions of the runs to the last digit: they were computed, or "
          "there are too few runs for so many conditions.");
    answer_ = posterior::explain(*fit_);
    report(after_search);
    judge_runs();
    add_limits();
    return std::move(r_);
  }

 private:
  // Energies that were not measured show no cause.
  RunDiagnosis nothing_to_judge(const std::string& why) {
    Diagnosis& d = r_.diagnosis;
    d.verdict_probability = 1;
    d.reasons = {why};
    d.refusal = why;
    add_limits();
    return std::move(r_);
  }

  void report(double part) const {
    if (progress_) progress_(part);
  }

  // Compares the model as it is with the measured energies.
  void measure() {
    Diagnosis& d = r_.diagnosis;
    d.robot_id = robot_.robot_id;
    d.missions = d.samples = set_.runs.size();
    d.motor_channels = rows_.by_motor;
    d.power = rows_.by_motor ? PowerSource::motors : PowerSource::battery;
    r_.model_given = rows_.model_given;
    r_.model_ratio = rows_.model_ratio;
    const std::vector<double> modelled = rows_.modelled_j();
    double all_measured = 0, all_modelled = 0;
    for (std::size_t k = 0; k < set_.runs.size(); ++k) {
      all_measured += set_.runs[k].measured_j();
      all_modelled += modelled[k];
      d.power_absolute_relative += rows_.missed(k, modelled[k]) / static_cast<double>(set_.runs.size());
      r_.runs.push_back({set_.runs[k], modelled[k], modelled[k], modelled[k]});
    }
    d.energy_relative = (all_measured - all_modelled) / all_measured;
  }

  void judge_runs() {
    Diagnosis& d = r_.diagnosis;
    double power_w = 0;
    const std::vector<double> after = rows_.energies_j(answer_.explained_w),
                              held_out = rows_.energies_j(answer_.held_out.explained_w);
    for (std::size_t k = 0; k < set_.runs.size(); ++k) {
      r_.runs[k].after_j = after[k];
      if (std::isfinite(held_out[k])) r_.runs[k].held_out_j = held_out[k];
      power_w += set_.runs[k].measured_j() / rows_.duration_s[k] / static_cast<double>(set_.runs.size());
    }
    // Spreads, corrected for the degrees of freedom of the fit of all columns; the sides come first.
    const auto spread = [&](const posterior::Noise& noise) {
      const std::vector<double> weights(noise.weight.begin(), noise.weight.end());
      return 1 / std::sqrt(statistics::median(weights) * noise.inflation) / fit_->data.mean_power_w;
    };
    r_.scatter = spread(fit_->noise.back());
    r_.side_scatter = fit_->noise.size() > 1 ? spread(fit_->noise.front()) : missing;
    d.noise_floor = std::min(mean_absolute_normal(r_.scatter), d.power_absolute_relative);
    d.channels = {
        {rows_.by_motor ? "motor_power" : "battery_power", d.power_absolute_relative, d.noise_floor}};
    state_effects(answer_, power_w, d);
    for (const std::string& reason : answer_.reasons) d.reasons.push_back(sentence(reason));
    state_offer(*fit_, answer_, false, d);
    state_held_out(answer_.held_out, d);
    if (d.baseline) add_terms(*d.baseline);
  }

  // The terms of the linear regression, in the readings and in the model.
  void add_terms(Baseline& b) {
    const posterior::TermColumns terms = posterior::term_columns(fit_->data);
    const std::vector<std::size_t> block = fit_->data.rows.blocks();
    const auto data = statistics::robust_regression(terms.x, fit_->data.rows.measured_w(), block);
    const auto model = statistics::robust_regression(terms.x, fit_->unchanged_w, block);
    for (std::size_t k = 0; k < terms.names.size(); ++k) {
      const Eigen::Index at = posterior::ix(k);
      if (terms.x.col(at).isZero(0)) continue;
      b.terms.push_back(
          {terms.names[k], terms.units[k], data.coefficients[at], data.sd[at], model.coefficients[at]});
    }
  }

  void add_limits() {
    std::vector<std::string>& limits = r_.limits;
    limits.emplace_back("Runs have energies only: the phase, time and place of the gap are undetermined.");
    std::set<double> payloads, speeds;
    std::map<std::string, std::set<double>> by_table;
    for (const MissionRun& run : set_.runs) {
      payloads.insert(run.at.payload_kg);
      speeds.insert(run.at.speed_m_s);
      by_table[run.table].insert(run.at.payload_kg);
    }
    if (by_table.size() > 1 && payloads.size() > 1 &&
        std::ranges::all_of(by_table, [](const auto& table) { return table.second.size() == 1; }))
      limits.emplace_back(
          "The payload changes only from table to table: other differences between tables of more than 2 % "
          "count as payload.");
    if (payloads.size() == 2) {
      limits.emplace_back(
          "Two payloads do not show whether an effect is proportional to the payload: a third one is "
          "needed.");
    } else if (payloads.size() == 1) {
      limits.emplace_back("One payload: effects that depend on the load cannot be detected.");
    }
    if (const double range = *speeds.rbegin() / *speeds.begin(); range < 3)
      limits.push_back(fmt::format(
          "Speeds within a factor of {:.1f}: dry and viscous friction and drag are barely distinguishable.",
          range));
    if (r_.model_given && std::fabs(r_.model_ratio - 1) > 0.1)
      limits.push_back(fmt::format(
          "The given model energies are {:.2f} times those of the robot file under the stated "
          "conditions: one of the two is wrong, for example the distances. Strengths are computed with "
          "the stated conditions; those of friction are inversely proportional to the distance.",
          r_.model_ratio));
    for (const DiagnosedEffect& e : r_.diagnosis.effects) {
      const auto stands_for = [&](std::string_view id) {
        return e.id == id || std::ranges::find(e.alternatives, id) != e.alternatives.end();
      };
      if (stands_for("wheel_slip") || stands_for("wheel_radius_error"))
        limits.push_back(fmt::format("Wrong distances in the table would have the same effect as {}.", e.id));
    }
    if (!rows_.by_motor)
      limits.emplace_back("The motors were not measured separately: the sides cannot be compared.");
  }

  const RunSet& set_;
  const robot::RobotModel& robot_;
  const Progress& progress_;
  RunRows rows_;
  std::unique_ptr<posterior::Fit> fit_;
  posterior::Explained answer_;
  RunDiagnosis r_;
};

}  // namespace

Result<RunDiagnosis> diagnose_runs(const RunSet& set, const robot::RobotModel& robot, bool robot_file_model,
                                   const Progress& progress) {
  TRY_ASSIGN(auto adopted, dynamics::active_effects(robot));
  RunSet judged = set;
  if (robot_file_model) {
    for (MissionRun& run : judged.runs) {
      run.model_energy_j = MissionRun::absent;
      run.model_motor_j = {MissionRun::absent, MissionRun::absent};
    }
  }
  return RunDiagnoser(judged, robot, std::move(adopted), progress).run();
}

}  // namespace joulecast::gap

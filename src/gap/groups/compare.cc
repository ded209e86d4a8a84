#include "gap/groups/compare.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <numbers>
#include <set>

#include "base/try.h"
#include "gap/diagnose/recordings.h"
#include "gap/groups/contrast.h"
#include "gap/runs/run_rows.h"
#include "gap/verdict/answer.h"
#include "gap/verdict/words.h"

namespace joulecast::gap {
namespace {

using posterior::ix;

constexpr std::size_t min_group_windows = 20;                                   // of a group
constexpr double after_base = 0.4, after_contrast = 0.7, after_compared = 0.8;  // of the progress

// The data of a comparison: rows of missions (or runs) in groups (posterior::Data::group).
struct GroupedData {
  posterior::Data data;
  // Of each row of power: J for one of its watts, its part of the way, and energy that is not in its power
  // [J].
  std::vector<double> joule, way_m, offset_j;
};

// Silences variables that are constant within each group: they are equivalent to the group.
void silence_names_of_groups(posterior::Data& d) {
  for (std::size_t c = 0; c < d.covariates.size(); ++c) {
    std::vector<std::set<double>> values(1 + *std::ranges::max_element(d.group));
    const auto each = [&](auto&& what) {
      for (std::vector<Window>* windows : {&d.windows, &d.rows.instants}) {
        for (Window& w : *windows)
          if (c < w.covariates.size()) what(w.covariates[c], d.group[w.mission]);
      }
    };
    each([&](double value, std::size_t group) {
      if (std::isfinite(value) && values[group].size() < 2) values[group].insert(value);
    });
    if (std::ranges::all_of(values, [](const auto& own) { return own.size() < 2; }))
      each([](double& value, std::size_t) { value = missing; });
  }
}

class Comparer {
 public:
  Comparer(GroupedData grouped, const Progress& progress, Comparison& comparison)
      : grouped_(std::move(grouped)),
        progress_(progress),
        c_(comparison),
        groups_(comparison.groups.size()) {}

  void run() {
    report(0);
    silence_names_of_groups(grouped_.data);
    base_ = posterior::walk(std::move(grouped_.data));
    report(after_base);
    contrasted_ = contrast(*base_);
    report(after_contrast);
    answer_ = posterior::explain(fit());
    report(after_compared);
    // A large difference does not indicate another robot.
    if (answer_.verdict == Verdict::not_this_robot) answer_.verdict = Verdict::effects;
    // Only named effects are compared.
    std::erase_if(answer_.effects,
                  [](const posterior::ExplainedBy& e) { return e.group < posterior::named; });
    measure();
    state_effects(answer_, fit().data.power ? fit().data.mean_power_w : missing, c_.diagnosis);
    for (const std::string& reason : answer_.reasons) c_.diagnosis.reasons.push_back(sentence(reason));
    if (fit().data.power) state_held_out(answer_.held_out, c_.diagnosis);
    c_.diagnosis.refusal = "a robot file has one strength for all groups";
    add_effects();
    add_difference();
    add_common();
  }

 private:
  void report(double part) const {
    if (progress_) progress_(part);
  }
  std::size_t group_of(std::size_t row) const {
    return fit().data.group[fit().data.rows.window(row).mission];
  }
  const posterior::Fit& fit() const { return *contrasted_.fit; }

  // Energy per metre of each group by these powers of rows.
  std::vector<double> per_m(const Eigen::VectorXd& power_w, bool offset) const {
    std::vector<double> energy_j(groups_, 0);
    for (std::size_t r = 0; r < grouped_.joule.size(); ++r)
      energy_j[group_of(r)] += grouped_.joule[r] * power_w[ix(r)] + (offset ? grouped_.offset_j[r] : 0);
    for (std::size_t g = 0; g < groups_; ++g)
      energy_j[g] /= c_.groups[g].way_m > 0 ? c_.groups[g].way_m : missing;
    return energy_j;
  }

  // Compares measured energies with those of the model with the common causes.
  void measure() {
    Diagnosis& d = c_.diagnosis;
    d.noise_floor = d.energy_relative = d.power_absolute_relative = missing;
    for (ComparedGroup& group : c_.groups) group.energy_per_m_j = group.model_per_m_j = missing;
    if (!fit().data.power) return;
    for (std::size_t r = 0; r < grouped_.way_m.size(); ++r) c_.groups[group_of(r)].way_m += grouped_.way_m[r];
    const Eigen::VectorXd measured = fit().data.rows.measured_w();
    const std::vector<double> taken = per_m(measured, true), by_model = per_m(fit().unchanged_w, true);
    double all = 0, missed = 0;
    for (std::size_t g = 0; g < groups_; ++g) {
      ComparedGroup& group = c_.groups[g];
      group.energy_per_m_j = taken[g];
      group.model_per_m_j = by_model[g];
      if (!std::isfinite(taken[g])) continue;
      all += group.way_m * taken[g];
      missed += group.way_m * (taken[g] - by_model[g]);
    }
    d.energy_relative = missed / all;
    d.power_absolute_relative = (measured - fit().unchanged_w).cwiseAbs().mean() / measured.cwiseAbs().mean();
    // Without a channel of power its noise is unknown.
    if (answer_.noise > 0)
      d.noise_floor = std::min(std::sqrt(2 / std::numbers::pi) * answer_.noise, d.power_absolute_relative);
    d.channels = {{d.power == PowerSource::motors ? "motor_power" : "battery_power",
                   d.power_absolute_relative, d.noise_floor}};
  }

  // Adds the strengths in each group of all effects that were named together: posterior of their contrasts.
  void add_effects() {
    Diagnosis& d = c_.diagnosis;
    std::vector<std::vector<Eigen::Index>> own;  // places in `columns` of each effect's contrasts
    std::vector<Eigen::Index> columns;           // of the contrasts of each effect's likeliest hypothesis
    std::vector<double> sd;
    for (const posterior::ExplainedBy& e : answer_.effects) {
      const std::size_t base = contrasted_.hypothesis[e.hypothesis];
      own.emplace_back();
      for (std::size_t h = 0; h < contrasted_.hypothesis.size(); ++h) {
        if (contrasted_.hypothesis[h] != base) continue;
        for (const std::size_t k : fit().catalogue.hypotheses[h].columns) {
          own.back().push_back(ix(columns.size()));
          columns.push_back(ix(k));
          sd.push_back(posterior::slab_shares.back() * fit().equations.columns[k].unit);
        }
      }
    }
    const statistics::Information& information = fit().reduced[fit().factor].information;
    Eigen::MatrixXd precision = information.xx(columns, columns);
    for (std::size_t k = 0; k < sd.size(); ++k) precision(ix(k), ix(k)) += 1 / (sd[k] * sd[k]);
    const Eigen::MatrixXd covariance = precision.inverse();
    const Eigen::VectorXd strengths = covariance * information.xy(columns);
    for (std::size_t n = 0; n < d.effects.size(); ++n) {
      std::vector<Eigen::Index> of_effect;
      for (const Eigen::Index k : own[n]) of_effect.push_back(columns[posterior::ux(k)]);
      add_effect(of_effect, strengths(own[n]), covariance(own[n], own[n]), d.effects[n]);
    }
  }

  // `columns`: contrast by contrast, each with the components of the strength.
  void add_effect(std::span<const Eigen::Index> columns, const Eigen::VectorXd& strengths,
                  const Eigen::MatrixXd& covariance, DiagnosedEffect& effect) {
    const std::size_t contrasts = contrasted_.contrasts.count(), components = columns.size() / contrasts;
    // Strengths of groups from strengths of contrasts.
    Eigen::MatrixXd to_groups = Eigen::MatrixXd::Zero(ix(groups_ * components), ix(columns.size()));
    for (std::size_t g = 0; g < groups_; ++g) {
      for (std::size_t k = 0; k < contrasts; ++k) {
        for (std::size_t q = 0; q < components; ++q)
          to_groups(ix(g * components + q), ix(k * components + q)) = contrasted_.contrasts.of(k, g);
      }
    }
    Eigen::VectorXd moved_w = Eigen::VectorXd::Zero(fit().equations.moved.rows());
    for (std::size_t k = 0; k < columns.size(); ++k)
      moved_w += strengths[ix(k)] * fit().equations.moved.col(columns[k]);
    const std::vector<double> energy =
        fit().data.power ? per_m(moved_w, false) : std::vector<double>(groups_, missing);
    ComparedEffect& e = c_.effects.emplace_back();
    e.id = effect.id;
    const auto strength = std::ranges::find_if(
        effect.parameters, [](const DiagnosedParameter& p) { return std::isfinite(p.deviation); });
    e.parameter = strength->name;
    e.unit = strength->unit;
    const auto apart = [&, n = ix(components)](std::size_t g, std::size_t o) -> Eigen::MatrixXd {
      return to_groups.middleRows(ix(g) * n, n) - to_groups.middleRows(ix(o) * n, n);
    };
    const auto above = [&](std::size_t g, std::size_t o) {
      const Eigen::MatrixXd rows = apart(g, o);
      return GroupStrength{c_.groups[g].name, (rows * strengths).norm(),
                           std::sqrt((rows * covariance * rows.transpose()).trace()), energy[g] - energy[o]};
    };
    std::size_t low = 0, high = 0;
    for (std::size_t g = 0; g < groups_; ++g) {
      for (std::size_t o = 0; o < groups_; ++o) {
        if (components == 1 && (apart(g, o) * strengths)[0] < 0) continue;
        if (above(g, o).value > above(high, low).value) low = o, high = g;
      }
    }
    for (std::size_t g = 0; g < groups_; ++g) e.groups.push_back(above(g, low));
    strength->value = e.groups[high].value;
    strength->deviation = e.groups[high].deviation;
  }

  void add_difference() {
    const auto known = [](const ComparedGroup& g) { return std::isfinite(g.energy_per_m_j); };
    if (!std::ranges::all_of(c_.groups, known)) return;
    GroupDifference& d = c_.difference.emplace();
    const auto [least, most] = std::ranges::minmax_element(c_.groups, {}, &ComparedGroup::energy_per_m_j);
    d.from = least->name;
    d.to = most->name;
    d.energy_per_m_j = most->energy_per_m_j - least->energy_per_m_j;
    d.by_motion_j = most->model_per_m_j - least->model_per_m_j;
    d.unexplained_j = d.energy_per_m_j - d.by_motion_j;
    for (const ComparedEffect& e : c_.effects) {
      const auto of = [&](const auto& group) { return e.groups[group - c_.groups.begin()].energy_per_m_j; };
      d.by_effect_j.emplace_back(e.id, of(most) - of(least));
      d.unexplained_j -= d.by_effect_j.back().second;
    }
  }

  // Adds the causes that the posterior of all groups together contains and that do not differ.
  void add_common() {
    const Eigen::VectorXd p = posterior::bagged(*base_->prior, base_->grams, base_->models);
    for (const posterior::Found& found : posterior::summarise(*base_, p).effects) {
      const bool differs = std::ranges::any_of(c_.diagnosis.effects, [&](const DiagnosedEffect& e) {
        return e.id == found.id || std::ranges::find(e.alternatives, found.id) != e.alternatives.end();
      });
      if (found.group >= posterior::named && !differs) c_.common.push_back(found.id);
    }
  }

  GroupedData grouped_;
  const Progress& progress_;
  Comparison& c_;
  std::size_t groups_;
  std::unique_ptr<posterior::Fit> base_;
  Contrasted contrasted_;
  posterior::Explained answer_;
};

// Returns the group of each item by its name, and sets the names of the comparison's groups.
std::vector<std::size_t> name_groups(std::span<const std::string> group_of_item, Comparison& comparison) {
  const std::set<std::string> names(group_of_item.begin(), group_of_item.end());
  for (const std::string& name : names) comparison.groups.emplace_back().name = name;
  std::vector<std::size_t> groups;
  for (const std::string& name : group_of_item)
    groups.push_back(static_cast<std::size_t>(std::distance(names.begin(), names.find(name))));
  return groups;
}

}  // namespace

Result<std::vector<std::string>> groups_of(const telemetry::RecordingSet& recordings, const std::string& by) {
  std::vector<std::string> groups;
  for (const telemetry::Recording& mission : recordings.missions) {
    const std::string& id = mission.mission_id;
    if (by == "prefix") {
      groups.push_back(id.substr(0, id.find('-')));
      continue;
    }
    if (by == "suffix") {
      const auto at = id.rfind('_');
      groups.push_back(at == std::string::npos ? id : id.substr(at + 1));
      continue;
    }
    std::map<std::string, double> held_s;
    for (const signals::CovariateSeries& series : mission.covariates) {
      if (!series.name.starts_with(by + "=")) continue;
      for (std::size_t k = 0; k < series.value.size(); ++k) {
        const std::int64_t until =
            k + 1 < series.utime_us.size() ? series.utime_us[k + 1] : mission.samples.back().utime_us;
        if (series.value[k] == 1)
          held_s[series.name.substr(by.size() + 1)] += 1e-6 * static_cast<double>(until - series.utime_us[k]);
      }
    }
    if (held_s.empty()) return invalid("--compare-by", "mission " + id + " has no label " + by);
    groups.push_back(std::ranges::max_element(held_s, {}, [](const auto& h) { return h.second; })->first);
  }
  return groups;
}

Result<Comparison> compare_recordings(const telemetry::RecordingSet& recordings,
                                      std::span<const std::string> group_of_mission,
                                      const robot::RobotModel& file, const Progress& progress) {
  Comparison c;
  robot::RobotModel robot = file;
  std::vector<std::size_t> groups = name_groups(group_of_mission, c);
  if (c.groups.size() < 2)
    return invalid("log", "contains missions of one group only; a comparison needs two");
  telemetry::RecordingSet trusted = recordings;
  Diagnosis& d = c.diagnosis;
  d.checks = check_and_correct(trusted, robot);
  // Steps from one mission to the next are the subject of the comparison.
  std::erase_if(d.checks, [](const Check& check) { return check.id == "step_between_missions"; });
  TRY_ASSIGN(auto data, posterior::make_data(trusted.missions, robot));
  data.group = std::move(groups);
  std::vector<std::size_t> count(c.groups.size(), 0);
  for (const Window& w : data.windows) ++count[data.group[w.mission]];
  for (std::size_t k = 0; k < count.size(); ++k) {
    if (count[k] < min_group_windows)
      return invalid("log", "contains too little motion of group " + c.groups[k].name);
  }
  if (!data.power && !data.motors && !data.voltages)
    return invalid("log", "measures neither power nor voltage nor current of the motors");
  for (std::size_t m = 0; m < data.group.size(); ++m) {
    ++c.groups[data.group[m]].missions;
    c.groups[data.group[m]].samples += trusted.missions[m].samples.size();
  }
  d.robot_id = trusted.robot_id;
  d.missions = trusted.missions.size();
  d.samples = trusted.samples;
  d.notes = trusted.notes;
  d.motor_channels = data.motors;
  d.power = power_source(data);
  if (!data.power)
    c.limits.emplace_back(
        "Neither battery nor motor power was recorded: the cost of the differences in watts, and all losses "
        "between battery and motors, are undetermined.");
  if (!data.motors)
    c.limits.emplace_back("Without the motors' currents friction, motors and drivers share one equation.");
  c.limits.emplace_back(
      "Groups may differ in more than their names: payload, tyres, batteries, weather of the day.");
  // Rows are equally long.
  const Eigen::VectorXd speed = data.rows.mean(
      [&](const Window& w) { return windows::plain_terms(w, robot.kinematics.wheel_radius_m)[1]; });
  GroupedData grouped{std::move(data), {}, {speed.begin(), speed.end()}, {}};
  grouped.joule.assign(grouped.way_m.size(), 1);
  grouped.offset_j.assign(grouped.way_m.size(), 0);
  Comparer(std::move(grouped), progress, c).run();
  return c;
}

Result<Comparison> compare_runs(const RunSet& set, std::span<const std::string> group_of_run,
                                const robot::RobotModel& robot, const Progress& progress) {
  TRY_ASSIGN(auto in_file, dynamics::active_effects(robot));
  Comparison c;
  const std::vector<std::size_t> groups = name_groups(group_of_run, c);
  if (c.groups.size() < 2) return invalid("--compare-by", "gives one group only; two are needed to compare");
  RunRows rows(set, robot, std::move(in_file));
  RunChecks checked = check_runs(rows, robot);
  c.diagnosis.checks = std::move(checked.checks);
  rows.silence(checked.apart);
  GroupedData grouped{rows.data, rows.joule, {}, rows.offset_j};
  for (const std::size_t group : groups) ++c.groups[group].missions, ++c.groups[group].samples;
  grouped.data.group = groups;
  for (const MissionRun& run : set.runs) grouped.way_m.push_back(run.at.distance_m);
  Diagnosis& d = c.diagnosis;
  d.robot_id = robot.robot_id;
  d.missions = d.samples = set.runs.size();
  d.motor_channels = rows.by_motor;
  d.power = d.motor_channels ? PowerSource::motors : PowerSource::battery;
  c.limits.emplace_back(
      "Groups may differ in more than their names: day, payload, tyres, batteries, weather.");
  Comparer(std::move(grouped), progress, c).run();
  return c;
}

}  // namespace joulecast::gap

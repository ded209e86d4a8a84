#include "gap/runs/run_rows.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <set>

#include "gap/posterior/hold_out.h"
#include "statistics/robust.h"

namespace joulecast::gap {
namespace {

using posterior::ix;
using posterior::Meter;

constexpr std::size_t fewest_runs_of_channel = 4;
constexpr std::size_t most_run_blocks = 100;  // limit of CPU time; runs are blocks of their own below it
constexpr std::size_t max_label_levels = 8;   // of a label
// Of a run's energy over the model's, relative to the usual ratio: a file that lacks most of the base load
// changes it by less, between runs that are mostly standstill and runs that are mostly motion.
constexpr double far_off_ratio = 3;
constexpr double silent = 1e-3;        // scale of a silenced run
constexpr double least_spread = 0.01;  // of an energy: accuracy of meters and conditions

// Replaces missing covariates by the median.
void fill_covariates(std::vector<MissionRun>& runs, std::size_t count) {
  for (MissionRun& run : runs) run.covariates.resize(count, MissionRun::absent);
  for (std::size_t c = 0; c < count; ++c) {
    std::vector<double> known;
    for (const MissionRun& run : runs)
      if (std::isfinite(run.covariates[c])) known.push_back(run.covariates[c]);
    if (known.empty()) continue;
    const double middle = statistics::median(std::move(known));
    for (MissionRun& run : runs)
      if (!std::isfinite(run.covariates[c])) run.covariates[c] = middle;
  }
}

// Each level of a label as a covariate: 1 or 0 less the median, as the choice of the zero level is arbitrary;
// of two levels one.
void labels_as_covariates(const RunSet& set, std::vector<MissionRun>& runs, std::vector<std::string>& names) {
  for (std::size_t l = 0; l < set.labels.size(); ++l) {
    std::set<std::string> levels;
    for (const MissionRun& run : set.runs) levels.insert(l < run.labels.size() ? run.labels[l] : "");
    levels.erase("");
    if (levels.size() < 2 || levels.size() > max_label_levels) continue;
    if (levels.size() == 2) levels.erase(levels.begin());
    for (const std::string& level : levels) {
      names.push_back(set.labels[l] + "=" + level);
      std::vector<double> known;
      for (MissionRun& run : runs) {
        const std::string own = l < run.labels.size() ? run.labels[l] : "";
        run.covariates.push_back(own.empty() ? MissionRun::absent : own == level ? 1 : 0);
        if (!own.empty()) known.push_back(run.covariates.back());
      }
      const double middle = statistics::median(std::move(known));
      for (MissionRun& run : runs) run.covariates.back() -= middle;
    }
  }
}

// Conditions that an unknown cause may follow; `order`: place in the table.
std::vector<std::pair<std::string, double>> conditions_of(const MissionRun& r, std::size_t order) {
  return {{"payload", r.at.payload_kg},
          {"speed", r.at.speed_m_s},
          {"acceleration", r.at.acceleration_m_s2},
          {"distance", r.at.distance_m},
          {"turning", std::fabs(r.at.turn_rad)},
          {"standstill", r.at.standstill_s},
          {"order", static_cast<double>(order)}};
}

}  // namespace

RunRows::RunRows(const RunSet& set, const robot::RobotModel& robot,
                 std::vector<dynamics::ActiveEffect> in_file)
    : runs(set.runs) {
  posterior::Data& d = data;
  d.robot = robot;
  d.in_file = std::move(in_file);
  d.covariates = set.covariates;
  d.missions = runs.size();
  d.blocks = std::min(runs.size(), most_run_blocks);
  d.power = true;
  d.fewest = fewest_runs_of_channel;
  fill_covariates(runs, d.covariates.size());
  labels_as_covariates(set, runs, d.covariates);
  const dynamics::DriveModel model(robot, d.in_file);
  double given = 0, ours = 0;
  std::vector<double> modelled_j, ratios, side_offset_j;
  const auto add = [](posterior::PowerRows& rows, const std::vector<Window>& instants, Meter meter) {
    rows.instants.insert(rows.instants.end(), instants.begin(), instants.end());
    rows.first.push_back(rows.instants.size());
    rows.meter.push_back(meter);
  };
  for (std::size_t k = 0; k < runs.size(); ++k) {
    const MissionRun& run = runs[k];
    std::vector<Window> instants = run_instants(model, run.at);
    for (Window& w : instants) {
      w.mission = k;
      w.block = k * d.blocks / runs.size();
      w.covariates = run.covariates;
    }
    add(d.rows, instants, run.by_motor() ? Meter::motors : Meter::battery);
    if (run.by_motor()) add(d.sides, instants, Meter::sides);
    const RunEnergy own = run_energy(model, run.at);
    const double by_robot_j = run.by_motor() ? own.motor_j[0] + own.motor_j[1] : own.battery_j;
    const bool has_model = !std::isnan(run.given_j());
    by_motor = by_motor && run.by_motor();
    model_given = model_given && has_model;
    duration_s.push_back(own.duration_s);
    offset_j.push_back(has_model ? run.given_j() - by_robot_j : 0);
    side_offset_j.push_back(has_model && run.by_motor() ? run.model_motor_j[0] - run.model_motor_j[1] -
                                                              own.motor_j[0] + own.motor_j[1]
                                                        : 0);
    modelled_j.push_back(by_robot_j + offset_j.back());
    ratios.push_back(run.measured_j() / modelled_j.back());
    if (!has_model) continue;
    given += run.given_j();
    ours += by_robot_j;
  }
  if (ours > 0) model_ratio = given / ours;
  const double usual = statistics::median(ratios);
  d.mean_power_w = 0;
  for (std::size_t k = 0; k < runs.size(); ++k) {
    const bool far = !(std::fabs(std::log(ratios[k] / usual)) < std::log(far_off_ratio));
    size_j.push_back(far ? std::fabs(usual * modelled_j[k]) : runs[k].measured_j());
    d.mean_power_w += size_j[k] / duration_s[k] / static_cast<double>(runs.size());
  }
  std::map<std::string, Eigen::VectorXd> shifts;
  for (std::size_t k = 0; k < runs.size(); ++k) {
    const MissionRun& run = runs[k];
    joule.push_back(size_j[k] / d.mean_power_w);
    d.rows.scale.push_back(duration_s[k] / joule[k]);
    d.rows.power_w.push_back((run.measured_j() - offset_j[k]) / joule[k]);
    if (run.by_motor()) {
      d.sides.scale.push_back(d.rows.scale.back());
      d.sides.power_w.push_back((run.motor_j[0] - run.motor_j[1] - side_offset_j[k]) / joule[k]);
    }
    shifts.try_emplace(run.table, Eigen::VectorXd::Zero(ix(runs.size()))).first->second[ix(k)] =
        d.mean_power_w;
  }
  for (auto& [table, shift] : shifts)
    if (shifts.size() > 1) d.shifts.push_back(std::move(shift));
  for (std::size_t c = 0; c < conditions_of(runs.front(), 0).size(); ++c) {
    posterior::Condition condition{conditions_of(runs.front(), 0)[c].first, Eigen::VectorXd(ix(runs.size()))};
    for (std::size_t k = 0; k < runs.size(); ++k)
      condition.value[ix(k)] = conditions_of(runs[k], k)[c].second;
    if (condition.value.maxCoeff() > condition.value.minCoeff()) d.conditions.push_back(std::move(condition));
  }
}

std::vector<double> RunRows::energies_j(const Eigen::VectorXd& power_w) const {
  std::vector<double> out;
  for (std::size_t k = 0; k < runs.size(); ++k) out.push_back(joule[k] * power_w[ix(k)] + offset_j[k]);
  return out;
}

std::vector<double> RunRows::modelled_j() const {
  return energies_j(posterior::predicted_power(data, data.in_file));
}

double RunRows::missed(std::size_t run, double energy_j) const {
  const double measured = runs[run].measured_j();
  return std::fabs(measured - energy_j) / std::max(measured, size_j[run]);
}

RunRows::Regression RunRows::regression() const {
  const std::vector<double> all(data.blocks, 1.0);
  Regression out{energies_j(posterior::plain_regression(data, posterior::term_columns(data), all)), {}};
  for (std::size_t k = 0; k < runs.size(); ++k)
    out.apart.push_back((runs[k].measured_j() - out.energy_j[k]) / size_j[k]);
  const double spread = std::max(statistics::spread_about_zero(out.apart), least_spread);
  for (double& apart : out.apart) apart /= spread;
  return out;
}

void RunRows::silence(const std::vector<std::size_t>& wrong) {
  for (const std::size_t k : wrong) {
    joule[k] /= silent;
    for (Eigen::VectorXd& shift : data.shifts) shift[ix(k)] *= silent;
    for (posterior::PowerRows* rows : {&data.rows, &data.sides}) {
      for (std::size_t r = 0; r < rows->size(); ++r)
        if (rows->window(r).mission == k) rows->scale[r] *= silent, rows->power_w[r] *= silent;
    }
  }
}

}  // namespace joulecast::gap

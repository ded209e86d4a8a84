#include "gap/runs/run_rows.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <numeric>
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
// Of a run's energy over the model's against the usual ratio: a file that lacks most of the base load moves
// it by less, between runs that mostly stand and that mostly drive.
constexpr double far_off_ratio = 3;
constexpr double silent = 1e-3;        // scale of a run that has no say
constexpr double least_spread = 0.01;  // of an energy, to which meters and conditions are known

// Where a covariate is not given the median stands.
void fill_covariates(std::vector<MissionRun>& runs, std::size_t count) {
  for (MissionRun& run : runs) run.covariates.resize(count, MissionRun::absent);
  for (std::size_t c = 0; c < count; ++c) {
    std::vector<double> known;
    for (const MissionRun& run : runs) {
      if (std::isfinite(run.covariates[c])) known.push_back(run.covariates[c]);
    }
    if (known.empty()) continue;
    const double middle = statistics::median(std::move(known));
    for (MissionRun& run : runs) {
      if (!std::isfinite(run.covariates[c])) run.covariates[c] = middle;
    }
  }
}

// Each level of a label as a covariate: 1 or 0 less the median, as which level is zero is chance; of two
// levels one.
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

// Conditions that something unknown may follow; `order`: place in the table.
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
    : runs_(set.runs) {
  posterior::Data& d = data_;
  d.robot = robot;
  d.in_file = std::move(in_file);
  d.covariates = set.covariates;
  d.missions = runs_.size();
  d.blocks = std::min(runs_.size(), most_run_blocks);
  d.power = d.from_motion.power = true;
  d.fewest = fewest_runs_of_channel;
  fill_covariates(runs_, d.covariates.size());
  labels_as_covariates(set, runs_, d.covariates);
  const dynamics::DriveModel model(robot, d.in_file);
  double given = 0, ours = 0;
  std::vector<double> measured_j, modelled_j;  // of each row
  for (std::size_t k = 0; k < runs_.size(); ++k) {
    const MissionRun& run = runs_[k];
    by_motor_ = by_motor_ && run.by_motor();
    model_given_ = model_given_ && !std::isnan(run.given_j());
    std::vector<Window> instants = run_instants(model, run.at);
    double t_s = 0;
    for (Window& w : instants) {
      w.mission = k;
      w.block = k * d.blocks / runs_.size();
      w.covariates = run.covariates;
      w.t_s = t_s + 0.5 * w.length_s;
      t_s += w.length_s;
    }
    duration_s_.push_back(t_s);
    const RunEnergy own = run_energy(model, run.at);
    const auto add = [&](Meter meter, double energy_j, double by_model_j, double given_j) {
      run_.push_back(k);
      d.rows.meter.push_back(meter);
      d.rows.instants.insert(d.rows.instants.end(), instants.begin(), instants.end());
      d.rows.first.push_back(d.rows.instants.size());
      offset_j_.push_back(std::isnan(given_j) ? 0 : given_j - by_model_j);
      measured_j.push_back(energy_j);
      modelled_j.push_back(by_model_j + offset_j_.back());
      if (std::isnan(given_j)) return;
      given += given_j;
      ours += by_model_j;
    };
    if (run.by_motor()) {
      add(Meter::motor_right, run.motor_j[0], own.motor_j[0], run.model_motor_j[0]);
      add(Meter::motor_left, run.motor_j[1], own.motor_j[1], run.model_motor_j[1]);
    } else {
      add(Meter::battery, run.energy_j, own.battery_j, run.model_energy_j);
    }
  }
  if (ours > 0) model_ratio_ = given / ours;
  if (std::ranges::find(d.rows.meter, Meter::motor_right) == d.rows.meter.end()) d.rows.meter.clear();
  std::vector<double> ratios, size_j;
  for (std::size_t r = 0; r < run_.size(); ++r) ratios.push_back(measured_j[r] / modelled_j[r]);
  const double usual = statistics::median(ratios);
  size_j_.assign(runs_.size(), 0);
  double power_w = 0;
  for (std::size_t r = 0; r < run_.size(); ++r) {
    const bool far = !(std::fabs(std::log(ratios[r] / usual)) < std::log(far_off_ratio));
    size_j.push_back(far ? std::fabs(usual * modelled_j[r]) : measured_j[r]);
    size_j_[run_[r]] += size_j[r];
    power_w += size_j[r] / duration_s_[run_[r]] / static_cast<double>(run_.size());
  }
  d.mean_power_w = power_w;
  for (std::size_t r = 0; r < run_.size(); ++r) {
    joule_.push_back(size_j[r] / power_w);
    d.rows.scale.push_back(duration_s_[run_[r]] / joule_[r]);
    d.rows.power_w.push_back((measured_j[r] - offset_j_[r]) / joule_[r]);
  }
  std::map<std::string, Eigen::VectorXd> shifts;
  for (std::size_t r = 0; r < run_.size(); ++r)
    shifts.try_emplace(runs_[run_[r]].table, Eigen::VectorXd::Zero(ix(run_.size()))).first->second[ix(r)] =
        power_w;
  for (auto& [table, shift] : shifts) {
    if (shifts.size() > 1) d.shifts.push_back(std::move(shift));
  }
  for (std::size_t c = 0; c < conditions_of(runs_.front(), 0).size(); ++c) {
    posterior::Condition condition{conditions_of(runs_.front(), 0)[c].first,
                                   Eigen::VectorXd(ix(run_.size()))};
    for (std::size_t r = 0; r < run_.size(); ++r)
      condition.value[ix(r)] = conditions_of(runs_[run_[r]], run_[r])[c].second;
    if (condition.value.maxCoeff() > condition.value.minCoeff()) d.conditions.push_back(std::move(condition));
  }
}

std::vector<double> RunRows::sums(const Eigen::VectorXd& power_w, double left) const {
  std::vector<double> out(runs_.size(), 0);
  for (std::size_t r = 0; r < run_.size(); ++r) {
    const bool is_left = !data_.rows.meter.empty() && data_.rows.meter[r] == Meter::motor_left;
    out[run_[r]] += (is_left ? left : 1) * (joule_[r] * power_w[ix(r)] + offset_j_[r]);
  }
  return out;
}

std::vector<double> RunRows::energies_j(const Eigen::VectorXd& power_w) const {
  return sums(power_w, 1);
}

std::vector<double> RunRows::differences_j(const Eigen::VectorXd& power_w) const {
  return sums(power_w, -1);
}

std::vector<double> RunRows::modelled_j() const {
  return energies_j(posterior::predicted_power(data_, data_.in_file));
}

double RunRows::missed(std::size_t run, double energy_j) const {
  const double measured = runs_[run].measured_j();
  return std::fabs(measured - energy_j) / std::max(measured, size_j_[run]);
}

RunRows::Regression RunRows::regression() const {
  const std::vector<double> all(data_.blocks, 1.0);
  Regression out{energies_j(posterior::plain_regression(data_, all)), {}};
  for (std::size_t k = 0; k < runs_.size(); ++k)
    out.apart.push_back((runs_[k].measured_j() - out.energy_j[k]) / size_j_[k]);
  const double spread = std::max(statistics::spread_about_zero(out.apart), least_spread);
  for (double& apart : out.apart) apart /= spread;
  return out;
}

void RunRows::silence(const std::vector<std::size_t>& runs) {
  for (std::size_t r = 0; r < run_.size(); ++r) {
    if (std::ranges::find(runs, run_[r]) == runs.end()) continue;
    data_.rows.scale[r] *= silent;
    data_.rows.power_w[r] *= silent;
    joule_[r] /= silent;
    for (Eigen::VectorXd& shift : data_.shifts) shift[ix(r)] *= silent;
  }
}

}  // namespace joulecast::gap

#include "gap/runs/run_referee.h"

#include <algorithm>
#include <cmath>

namespace joulecast::gap {

RunReferee::RunReferee(const RunColumns& columns) {
  const auto& runs = columns.runs();
  const auto n = static_cast<Eigen::Index>(runs.size());
  for (std::size_t k = 0; k < runs.size(); ++k) size_.push_back(columns.size_j(k));
  const std::size_t most_terms = std::max<std::size_t>(2, runs.size() / 4);
  const auto take = [&](RefereeTerm term, auto&& value, bool always) {
    Eigen::VectorXd column(n);
    for (Eigen::Index k = 0; k < n; ++k) column[k] = value(static_cast<std::size_t>(k));
    // What is the same for each metre, or each second, of every run says nothing beside the distance and the
    // time.
    if (!always && (terms_.size() >= most_terms || !(column.cwiseAbs().maxCoeff() > 0))) return;
    terms_.push_back(std::move(term));
    x_.conservativeResize(n, x_.cols() + 1);
    x_.rightCols(1) = column;
  };
  const auto duration_s = [&](std::size_t k) { return columns.modelled(k, {}).duration_s; };
  const auto at = [&](std::size_t k) -> const RunConditions& { return runs[k].at; };
  take({"time", "W", "W whatever the robot does"}, duration_s, true);
  take(
      {"distance", "J/m", "J per m of way"}, [&](std::size_t k) { return at(k).distance_m; }, true);
  for (std::size_t c = 0; c < columns.covariates().size(); ++c) {
    const std::string& name = columns.covariates()[c];
    take(
        {"covariate:" + name, "W/unit", "W per unit of " + name},
        [&](std::size_t k) { return columns.covariate(k, c) * duration_s(k); }, false);
  }
  take(
      {"payload", "J/(kg m)", "J per kg carried and m of way"},
      [&](std::size_t k) { return at(k).payload_kg * at(k).distance_m; }, false);
  take(
      {"turning", "J/rad", "J per rad turned"}, [&](std::size_t k) { return std::fabs(at(k).turn_rad); },
      false);
  take(
      {"climb", "J/m", "J per m climbed"},
      [&](std::size_t k) { return std::isfinite(at(k).climb_m) ? at(k).climb_m : 0.0; }, false);
}

RunReferee::Fit RunReferee::fit(const std::vector<double>& energy_j,
                                const std::vector<bool>& left_out) const {
  Eigen::MatrixXd x(x_.rows(), x_.cols());
  Eigen::VectorXd y(x_.rows());
  std::vector<std::size_t> block;
  Eigen::Index rows = 0;
  for (std::size_t k = 0; k < energy_j.size(); ++k) {
    if (!left_out.empty() && left_out[k]) continue;
    x.row(rows) = x_.row(static_cast<Eigen::Index>(k)) / size_[k];
    y[rows++] = energy_j[k] / size_[k];
    block.push_back(k);
  }
  Fit fit{statistics::robust_regression(x.topRows(rows), y.head(rows), block), {}};
  const Eigen::VectorXd energies = x_ * fit.regression.coefficients;
  fit.energy_j.assign(energies.begin(), energies.end());
  return fit;
}

std::vector<double> RunReferee::apart(const std::vector<double>& energy_j,
                                      const std::vector<bool>& left_out) const {
  constexpr double least_spread = 0.01;  // of an energy, to which meters and conditions are known
  const Fit fit = this->fit(energy_j, left_out);
  const double spread = std::max(fit.regression.spread, least_spread);
  std::vector<double> apart;
  for (std::size_t k = 0; k < energy_j.size(); ++k)
    apart.push_back((energy_j[k] - fit.energy_j[k]) / size_[k] / spread);
  return apart;
}

}  // namespace joulecast::gap

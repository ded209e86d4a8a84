#include "gap/diagnose/referee.h"

#include <array>
#include <cmath>

namespace joulecast::gap {

Eigen::VectorXd Referee::values_of(const Window& w) const {
  const std::array<double, 5> plain = windows::plain_terms(w, wheel_radius_m_);
  Eigen::VectorXd x(static_cast<Eigen::Index>(terms_.size()));
  Eigen::Index at = climb_ ? 5 : 4;
  x.head(at) = Eigen::Map<const Eigen::VectorXd>(plain.data(), at);
  for (const Modulation& by : covariates_) x[at++] = by.of(w);
  return x;
}

Referee::Referee(const Material& m, std::span<const double> power_w, const std::vector<bool>& use)
    : wheel_radius_m_(m.robot.kinematics.wheel_radius_m),
      climb_(ranges_of(m.windows, m.robot).climb),
      covariates_(modulations_of(m.windows)),
      terms_{{"constant", "W", "W whatever the robot does"},
             {"speed", "W/(m/s)", "W per m/s of speed"},
             {"side_difference", "W/(m/s)", "W per m/s of difference between the sides"},
             {"acceleration", "kg", "W per m/s of speed and m/s² of acceleration, as of so many kg"}} {
  if (climb_) terms_.push_back({"climb", "W/(m/s)", "W per m/s straight up"});
  for (const Modulation& by : covariates_) {
    const std::string& name = m.covariates[by.covariate];
    terms_.push_back({"covariate:" + name, "W/unit", "W per unit of " + name});
  }
  Eigen::MatrixXd x(static_cast<Eigen::Index>(m.windows.size()), static_cast<Eigen::Index>(terms_.size()));
  Eigen::VectorXd y(x.rows());
  std::vector<std::size_t> block;
  Eigen::Index rows = 0;
  for (std::size_t k = 0; k < m.windows.size(); ++k) {
    if (!std::isfinite(power_w[k]) || (!use.empty() && !use[k])) continue;
    x.row(rows) = values_of(m.windows[k]).transpose();
    y[rows++] = power_w[k];
    block.push_back(m.windows[k].block);
  }
  fit_ = statistics::robust_regression(x.topRows(rows), y.head(rows), block);
}

}  // namespace joulecast::gap

#include "gap/diagnose/referee.h"

#include <cmath>

namespace joulecast::gap {

Eigen::VectorXd Referee::values_of(const Window& w) const {
  const double speed = 0.5 * wheel_radius_m_ * (w.speed_rad_s[0] + w.speed_rad_s[1]);
  const double difference = wheel_radius_m_ * (w.speed_rad_s[0] - w.speed_rad_s[1]);
  const double acceleration = 0.5 * wheel_radius_m_ * (w.acceleration_rad_s2[0] + w.acceleration_rad_s2[1]);
  Eigen::VectorXd x(static_cast<Eigen::Index>(terms_.size()));
  x.head(4) << 1.0, std::fabs(speed), std::fabs(difference), speed * acceleration;
  Eigen::Index at = 4;
  if (climb_) x[at++] = std::isfinite(w.climb_rad) ? speed * std::sin(w.climb_rad) : 0;
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

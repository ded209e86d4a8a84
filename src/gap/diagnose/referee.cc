#include "gap/diagnose/referee.h"

#include <fmt/format.h>

#include <cmath>

#include "gap/verdict/words.h"

namespace joulecast::gap {

Eigen::VectorXd Referee::terms_of(const Window& w) const {
  const double speed = 0.5 * wheel_radius_m_ * (w.speed_rad_s[0] + w.speed_rad_s[1]);
  const double difference = wheel_radius_m_ * (w.speed_rad_s[0] - w.speed_rad_s[1]);
  const double acceleration = 0.5 * wheel_radius_m_ * (w.acceleration_rad_s2[0] + w.acceleration_rad_s2[1]);
  Eigen::VectorXd x(static_cast<Eigen::Index>(referee_terms.size()));
  x << 1.0, std::fabs(speed), std::fabs(difference), speed * acceleration;
  return x;
}

Referee::Referee(std::span<const Window> windows, std::span<const double> power_w, const robot::RobotModel& robot,
                 const std::vector<bool>& use)
    : wheel_radius_m_(robot.kinematics.wheel_radius_m) {
  Eigen::MatrixXd x(static_cast<Eigen::Index>(windows.size()), static_cast<Eigen::Index>(referee_terms.size()));
  Eigen::VectorXd y(x.rows());
  std::vector<std::size_t> block;
  Eigen::Index rows = 0;
  for (std::size_t k = 0; k < windows.size(); ++k) {
    if (!std::isfinite(power_w[k]) || (!use.empty() && !use[k])) continue;
    x.row(rows) = terms_of(windows[k]).transpose();
    y[rows++] = power_w[k];
    block.push_back(windows[k].block);
  }
  fit_ = statistics::robust_regression(x.topRows(rows), y.head(rows), block);
}

double Referee::predict(const Window& w) const {
  return fit_.coefficients.dot(terms_of(w));
}

std::string referee_words(const RefereeTerm& term, double data, double model) {
  return sentence(fmt::format("the data have {} {}; the model has {}", brief(data), term.words, brief(model)));
}

}  // namespace joulecast::gap

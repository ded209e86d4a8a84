#include "statistics/information.h"

#include <vector>

namespace joulecast::statistics {

Information::Information(Eigen::Index columns)
    : xx(Eigen::MatrixXd::Zero(columns, columns)), xy(Eigen::VectorXd::Zero(columns)) {}

Information& Information::operator+=(const Information& other) {
  if (xx.size() == 0) return *this = other;
  if (other.xx.size() == 0) return *this;
  xx += other.xx;
  xy += other.xy;
  yy += other.yy;
  log_scale += other.log_scale;
  return *this;
}

Information& Information::operator*=(double factor) {
  xx *= factor;
  xy *= factor;
  yy *= factor;
  log_scale *= factor;
  return *this;
}

void Information::add(const Eigen::Ref<const Eigen::MatrixXd>& x,
                      const Eigen::Ref<const Eigen::VectorXd>& y) {
  // Eigen's product into a triangle refers to the first coefficient, which an empty matrix has not.
  if (x.size() > 0) xx.triangularView<Eigen::Lower>() += x.transpose() * x;
  xx.triangularView<Eigen::StrictlyUpper>() = xx.transpose();
  xy += x.transpose() * y;
  yy += y.squaredNorm();
}

void Information::add(const Eigen::Ref<const Eigen::MatrixXd>& x, const Eigen::Ref<const Eigen::VectorXd>& y,
                      std::span<const std::size_t> columns) {
  Information part(x.cols());
  part.add(x, y);
  for (std::size_t a = 0; a < columns.size(); ++a) {
    const auto la = static_cast<Eigen::Index>(a), ga = static_cast<Eigen::Index>(columns[a]);
    xy[ga] += part.xy[la];
    for (std::size_t b = 0; b < columns.size(); ++b)
      xx(ga, static_cast<Eigen::Index>(columns[b])) += part.xx(la, static_cast<Eigen::Index>(b));
  }
  yy += part.yy;
}

void Information::integrate_out(const Eigen::VectorXd& sd) {
  std::vector<Eigen::Index> own;
  for (Eigen::Index k = 0; k < sd.size(); ++k) {
    if (sd[k] > 0 && xx(k, k) > 0) own.push_back(k);
  }
  if (own.empty()) return;
  const Eigen::VectorXd scale = sd(own);
  // In units of their sd, S = Z'Z + 1 is well conditioned.
  const Eigen::MatrixXd cross = scale.asDiagonal() * xx(own, Eigen::all);
  Eigen::MatrixXd s = cross(Eigen::all, own) * scale.asDiagonal();
  s.diagonal().array() += 1.0;
  const Eigen::LLT<Eigen::MatrixXd> factor(s);
  const Eigen::MatrixXd solved = factor.matrixL().solve(cross);
  const Eigen::VectorXd solved_y = factor.matrixL().solve(scale.asDiagonal() * xy(own));
  xx.noalias() -= solved.transpose() * solved;
  xy.noalias() -= solved.transpose() * solved_y;
  yy -= solved_y.squaredNorm();
  log_scale -= factor.matrixLLT().diagonal().array().log().sum();
}

}  // namespace joulecast::statistics

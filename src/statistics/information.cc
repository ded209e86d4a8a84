#include "statistics/information.h"

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

void Information::add(const Eigen::Ref<const Eigen::MatrixXd>& x, const Eigen::Ref<const Eigen::VectorXd>& y,
                      const std::vector<Eigen::Index>& columns) {
  Eigen::MatrixXd products = Eigen::MatrixXd::Zero(x.cols(), x.cols());
  // Eigen's product into a triangle refers to the first coefficient, which an empty matrix has not.
  if (x.size() > 0) products.triangularView<Eigen::Lower>() += x.transpose() * x;
  products.triangularView<Eigen::StrictlyUpper>() = products.transpose();
  xx(columns, columns) += products;
  xy(columns) += x.transpose() * y;
  yy += y.squaredNorm();
}

void Information::integrate_out(const Eigen::VectorXd& sd) {
  std::vector<Eigen::Index> own;
  for (Eigen::Index k = 0; k < sd.size(); ++k)
    if (sd[k] > 0 && xx(k, k) > 0) own.push_back(k);
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

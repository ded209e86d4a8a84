#pragma once

#include <span>
#include <string>
#include <vector>

#include "gap/equations/columns.h"
#include "statistics/regression.h"

namespace joulecast::gap {

// One term of a plain regression of power on motion: what anybody would try before a model.
struct RefereeTerm {
  std::string name, unit;
  std::string words;  // "so many W ..."
};

// P = c0 + c1 |v| + c2 |v_right - v_left| + c3 v a, with climb c v sin(climb), with covariates c for each,
// fitted robustly. The referee of a diagnosis: what predicts held-out data worse than this is no explanation.
class Referee {
 public:
  // On the windows in which `use` holds and power is known.
  Referee(const Material& material, std::span<const double> power_w, const std::vector<bool>& use = {});

  double predict(const Window& w) const { return fit_.coefficients.dot(values_of(w)); }
  const std::vector<RefereeTerm>& terms() const { return terms_; }
  const statistics::Regression& fit() const { return fit_; }

 private:
  Eigen::VectorXd values_of(const Window& w) const;
  double wheel_radius_m_;
  bool climb_;
  std::vector<Modulation> covariates_;
  std::vector<RefereeTerm> terms_;
  statistics::Regression fit_;
};

}  // namespace joulecast::gap

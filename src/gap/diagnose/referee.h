#pragma once

#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "gap/equations/channels.h"
#include "robot/robot_model.h"
#include "statistics/regression.h"

namespace joulecast::gap {

// The terms of a plain regression of power on motion: what anybody would try before a model.
struct RefereeTerm {
  std::string_view name, unit;
  std::string_view words;  // "so many W ..."
};
inline constexpr auto referee_terms = std::to_array<RefereeTerm>({
    {"constant", "W", "W whatever the robot does"},
    {"speed", "W/(m/s)", "W per m/s of speed"},
    {"side_difference", "W/(m/s)", "W per m/s of difference between the sides"},
    {"acceleration", "kg", "W per m/s of speed and m/s² of acceleration, as of so many kg"},
});

// P = c0 + c1 |v| + c2 |v_right - v_left| + c3 v a, fitted robustly. The referee of a diagnosis: what predicts held-out
// data worse than this is no explanation.
class Referee {
 public:
  // On the windows in which `use` holds and power is known.
  Referee(std::span<const Window> windows, std::span<const double> power_w, const robot::RobotModel& robot,
          const std::vector<bool>& use = {});

  double predict(const Window& w) const;
  const statistics::Regression& fit() const { return fit_; }

 private:
  Eigen::VectorXd terms_of(const Window& w) const;
  double wheel_radius_m_;
  statistics::Regression fit_;
};

// One term as the data have it, beside what the model comes to in the same term.
std::string referee_words(const RefereeTerm& term, double data, double model);

}  // namespace joulecast::gap

#pragma once

#include <array>
#include <cstddef>
#include <span>
#include <string_view>
#include <vector>

#include "tests/study/trial/motion/motion_log.h"

namespace joulecast::trial::motion {

// Battery power as a plain regression has it:
//   P = idle + friction f + turning yaw tanh(yaw/b) + inertia (v a + rho^2 yaw yaw') + drag |v|^3
// with f the mean over both wheels of |u| + k u^2, u the speed of the wheel's rim. Coefficients: W, N, N m,
// kg, N s^2/m^2.
enum class Term : std::size_t { idle, friction, turning, inertia, drag };
inline constexpr std::size_t term_count = 5;
using Terms = std::array<double, term_count>;
[[nodiscard]] std::string_view name_of(Term term);
inline double of(const Terms& terms, Term term) {
  return terms[static_cast<std::size_t>(term)];
}

// The terms that a recording determines, the parameters of their shapes, and the bounds of the coefficients.
struct BaseForm {
  bool turns = false;                // the turning term
  bool fast = false;                 // the drag term
  double viscous_s_m = 0;            // k
  double turning_rate_rad_s = 0.02;  // b
  double gyration_m2 = 0;            // rho^2
  Terms least{}, most{};             // of the coefficients
};
[[nodiscard]] BaseForm base_form_of(const MotionLog& log);

// A fit to a log, and its residuals of zero mean, W, for each instant of each mission.
struct BaseFit {
  BaseForm form;
  Terms base{};
  std::vector<std::vector<double>> residual_w;
};
[[nodiscard]] BaseFit fit_log(const MotionLog& log);

[[nodiscard]] Terms regressors(const BaseForm& form, const Instant& at);
[[nodiscard]] double base_power_w(const BaseForm& form, const Terms& coefficients, const Instant& at);

// The value below which a share q of the values lies; there must be one.
[[nodiscard]] double quantile_of(std::vector<double> values, double q);

// Coefficients within their bounds, by Huber's weights from `huber` spreads on. `power_w` has one value for
// each instant.
[[nodiscard]] Terms fit_base(const BaseForm& form, std::span<const Instant> instants,
                             std::span<const double> power_w, double huber);

// Fitted to every second of some twenty blocks and evaluated on the others, both ways: the sum of the
// absolute errors over that of the absolute powers. The error of the best plain regression on these data.
[[nodiscard]] double referee_error(const BaseForm& form, std::span<const Instant> instants,
                                   std::span<const double> power_w);

}  // namespace joulecast::trial::motion

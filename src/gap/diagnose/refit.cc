#include "gap/diagnose/refit.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "gap/diagnose/referee.h"
#include "gap/equations/power.h"
#include "gap/equations/zone_scan.h"
#include "gap/traits.h"
#include "statistics/evidence.h"
#include "statistics/regression.h"
#include "statistics/robust.h"

namespace joulecast::gap {
namespace {

constexpr int most_steps = 12, max_refit_halvings = 4;
constexpr double better = 0.998;  // misfit, over the one before: a step that gains less is the last
constexpr double wide_share = 1;  // of the mean power, that a strength is held by
constexpr double noticed_share = 0.002;

Shapes shapes_of(std::span<const Cause> causes, const robot::RobotModel& robot) {
  Shapes shapes;
  for (const Cause& cause : causes) {
    const dynamics::ActiveEffect& e = cause.effect;
    if (is_zone(cause)) {
      shapes.zones = {{e.values[1], e.values[2], e.values[3]}};
    } else {
      shapes.only(e, robot.kinematics.wheel_radius_m);
    }
  }
  return shapes;
}

// One Gauss-Newton step: the strengths that these causes would have where everything is linear.
std::vector<Cause> step(const Material& material, const Linear& linear, std::span<const Cause> causes) {
  const ColumnSet& columns = *linear.columns;
  Eigen::VectorXd sd(static_cast<Eigen::Index>(columns.size()));
  for (std::size_t k = 0; k < columns.size(); ++k)
    sd[static_cast<Eigen::Index>(k)] =
        std::hypot(columns.columns()[k].tolerance, columns.columns()[k].scatter);
  for (const Hypothesis& h : columns.hypotheses()) {
    for (const std::size_t k : h.candidate.columns) sd[static_cast<Eigen::Index>(k)] = 0;
  }
  std::vector<std::size_t> free;
  for (const Cause& cause : causes) {
    const auto at = columns.coordinates_of(cause);
    if (!at) continue;
    free.push_back(at->hypothesis);
    const auto& candidate = columns.hypotheses()[at->hypothesis].candidate;
    for (const std::size_t k : candidate.columns) sd[static_cast<Eigen::Index>(k)] = candidate.expected;
  }
  statistics::Information total;
  for (const auto& block : block_information(columns, linear.rows, linear.noise, material.blocks))
    total += block;
  const statistics::Ridge ridge = statistics::ridge(total, sd);
  std::vector<Chosen> chosen;
  for (const std::size_t h : free) {
    const auto& candidate = columns.hypotheses()[h].candidate;
    Chosen c{h, {}};
    for (const std::size_t k : candidate.columns)
      c.coefficients.push_back(
          std::clamp(ridge.mean[static_cast<Eigen::Index>(k)], candidate.least, candidate.most));
    chosen.push_back(std::move(c));
  }
  return columns.causes_of(chosen);
}

// All of these effects, without strength.
std::vector<Cause> as_filed(const ColumnSet& columns, std::span<const std::string_view> ids) {
  std::vector<Chosen> chosen;
  for (std::size_t h = 0; h < columns.hypotheses().size(); ++h) {
    if (std::ranges::find(ids, columns.hypotheses()[h].id()) != ids.end()) chosen.push_back({h, {0.0}});
  }
  return columns.causes_of(chosen);
}

// The effects that make the robot file's model the plain regression.
std::vector<Cause> as_regression(const Material& m, std::span<const double> power_w, const ColumnSet& columns,
                                 std::span<const std::string_view> ids) {
  const Referee referee(m, power_w);
  const auto& c = referee.fit().coefficients;
  const auto& k = m.robot.kinematics;
  const auto& mass = m.robot.mass;
  const double inertia_kg = 2 * (mass.wheel_inertia_kg_m2 + m.robot.motor.rotor_inertia_kg_m2) /
                            (k.wheel_radius_m * k.wheel_radius_m);
  const double chassis_kg = std::max(0.2 * mass.chassis_kg, c[3] - inertia_kg - 2 * mass.wheel_kg);
  const double weight_n = (chassis_kg + 2 * mass.wheel_kg) * robot::standard_gravity_m_s2;
  const double torque_nm = 0.5 * std::max(0.0, c[1]) * k.wheel_radius_m;
  const double scrub = std::max(0.0, c[2]) * 2 * k.half_track_m / (0.5 * weight_n * k.half_track_m);
  const double file_nm = 0.5 * (m.robot.motor.friction_torque_nm[0] + m.robot.motor.friction_torque_nm[1]);
  double file_scrub = 0;
  for (const dynamics::ActiveEffect& e : m.adopted) {
    if (e.effect->info().id == "turning_scrub") file_scrub += e.values[0];
  }
  std::vector<Chosen> chosen;
  for (std::size_t h = 0; h < columns.hypotheses().size(); ++h) {
    const Hypothesis& hypothesis = columns.hypotheses()[h];
    const std::string id = hypothesis.id();
    if (std::ranges::find(ids, id) == ids.end()) continue;
    const bool ratio = hypothesis.parameter == 0;
    const double value = id == "accessory_load"     ? c[0] - m.robot.idle_power_w
                         : id == "coulomb_friction" ? (ratio ? torque_nm / file_nm - 1 : torque_nm - file_nm)
                         : id == "turning_scrub"    ? scrub - file_scrub
                         : id == "chassis_mass_error" ? chassis_kg / mass.chassis_kg - 1
                         : id == "resistance_error"   ? hypothesis.candidate.least
                                                      : 0.0;
    chosen.push_back({h, {std::clamp(value, hypothesis.candidate.least, hypothesis.candidate.most)}});
  }
  return columns.causes_of(chosen);
}

std::vector<Cause> rest(const Material& whole, const Shapes& shapes, std::vector<Cause> causes) {
  const std::vector<Window> some = thinned(whole.windows);
  Material material = whole;
  material.windows = some;
  std::vector<Cause> next = causes;
  std::vector<std::string_view> effects;
  for (const Cause& cause : causes) effects.push_back(cause.effect.effect->info().id);
  std::optional<Noise> noise;
  double least = std::numeric_limits<double>::infinity();
  for (int k = 0, halved = 0; k < most_steps; ++k) {
    const Linear linear = noise ? linearise(material, shapes, std::array{wide_share}, next, effects, *noise)
                                : linearise(material, shapes, std::array{wide_share}, next);
    if (!noise) noise = linear.noise;
    const double now = misfit(linear, *noise);
    if (now > better * least) {
      if (now < least) causes = next;
      if (++halved > max_refit_halvings) break;
      next = half_way(causes, std::move(next));
      continue;
    }
    halved = 0;
    least = now;
    causes = next;
    next = step(material, linear, causes);
  }
  return causes;
}

// Measured less modelled power as a function of the strengths that may move. Each is held by what is expected
// of it; what other channels show stays.
class PowerMisfit {
 public:
  PowerMisfit(const Material& material, const Shapes& shapes, std::span<const Cause> causes,
              std::span<const double> power_w)
      : m_(material), power_w_(power_w) {
    const ColumnSet columns(m_, shapes, std::array{wide_share});
    for (std::size_t k = 0; k < causes.size(); ++k) {
      const auto at = columns.coordinates_of(causes[k]);
      if (!at || causes[k].by || traits_of(causes[k].effect.effect->info().id).elsewhere) continue;
      const Hypothesis& h = columns.hypotheses()[at->hypothesis];
      if (h.candidate.columns.size() == 1)
        free_.push_back({k, h.parameter, h.candidate.expected, h.candidate.least, h.candidate.most});
    }
    for (std::size_t k = 0; k < power_w.size(); ++k) {
      if (std::isfinite(power_w[k])) rows_.push_back(k);
    }
  }

  bool empty() const { return free_.empty() || rows_.empty(); }

  Eigen::VectorXd left_by(std::span<const Cause> causes) const {
    const std::vector<double> modelled = modelled_power(m_.robot, m_.adopted, causes, m_.windows);
    Eigen::VectorXd left(static_cast<Eigen::Index>(rows_.size()));
    for (std::size_t k = 0; k < rows_.size(); ++k) {
      const double model = modelled[rows_[k]];
      left[static_cast<Eigen::Index>(k)] = std::isfinite(model) ? power_w_[rows_[k]] - model : 0;
    }
    return left;
  }

  // Strengths in units of what is expected of them, and what a unit more of each takes from what is left, by
  // differences.
  struct Slopes {
    Eigen::VectorXd strengths;
    Eigen::MatrixXd takes;
  };
  Slopes slopes(const std::vector<Cause>& causes, const Eigen::VectorXd& left) const {
    constexpr double step_share = 1e-3;
    Slopes s{Eigen::VectorXd(size()), Eigen::MatrixXd(left.size(), size())};
    for (Eigen::Index k = 0; k < size(); ++k) {
      const Free& f = free_[static_cast<std::size_t>(k)];
      std::vector<Cause> moved = causes;
      double& value = moved[f.cause].effect.values[f.parameter];
      s.strengths[k] = value / f.unit;
      const double step = value + step_share * f.unit > f.most ? -step_share : step_share;
      value += step * f.unit;
      s.takes.col(k) = (left - left_by(moved)) / step;
    }
    return s;
  }

  // `causes` moved by a step within their bounds; the largest part of it that was possible.
  double move(std::vector<Cause>& causes, const Eigen::VectorXd& step) const {
    double moved = 0;
    for (Eigen::Index k = 0; k < size(); ++k) {
      const Free& f = free_[static_cast<std::size_t>(k)];
      double& value = causes[f.cause].effect.values[f.parameter];
      const double before = value;
      value = std::clamp(value + step[k] * f.unit, f.least, f.most);
      moved = std::max(moved, std::fabs(value - before) / f.unit);
    }
    return moved;
  }

 private:
  struct Free {
    std::size_t cause, parameter;
    double unit, least, most;
  };
  Eigen::Index size() const { return static_cast<Eigen::Index>(free_.size()); }

  const Material& m_;
  std::span<const double> power_w_;
  std::vector<Free> free_;
  std::vector<std::size_t> rows_;
};

// Where only battery power was measured, the strengths that leave least of it, by the model itself:
// Levenberg's steps of Huber's estimator on numerical differences.
std::vector<Cause> rest_of_power(const PowerMisfit& misfit, std::vector<Cause> causes) {
  constexpr int most_rounds = 25;
  // Of a step, in units of what is expected, and of errors.
  constexpr double settled = 1e-4, least_gain = 1e-4;
  constexpr double first_damping = 1e-3, most_damping = 1e3;
  if (misfit.empty()) return causes;
  Eigen::VectorXd left = misfit.left_by(causes);
  double damping = first_damping;
  for (int round = 0; round < most_rounds && damping < most_damping; ++round) {
    const double spread = statistics::spread_about_zero({left.data(), static_cast<std::size_t>(left.size())});
    if (!(spread > 0)) break;
    const PowerMisfit::Slopes s = misfit.slopes(causes, left);
    const Eigen::VectorXd weight = statistics::huber_weights(left, spread) / (spread * spread);
    const Eigen::MatrixXd weighted = weight.asDiagonal() * s.takes;
    Eigen::MatrixXd information = weighted.transpose() * s.takes;
    const Eigen::VectorXd slope = weighted.transpose() * left - s.strengths;
    information.diagonal().array() += 1;
    for (bool improved = false; !improved && damping < most_damping; damping *= 10) {
      Eigen::MatrixXd damped = information;
      damped.diagonal() *= 1 + damping;
      std::vector<Cause> next = causes;
      const double moved = misfit.move(next, damped.ldlt().solve(slope));
      const Eigen::VectorXd now = misfit.left_by(next);
      const double before = left.cwiseAbs().sum(), after = now.cwiseAbs().sum();
      if (!(after < before)) continue;
      causes = std::move(next);
      left = now;
      improved = true;
      damping *= 0.01;
      if (moved < settled || after > (1 - least_gain) * before) return causes;
    }
  }
  return causes;
}

}  // namespace

std::vector<Cause> refit(const Material& material, std::vector<Cause> causes) {
  if (causes.empty()) return causes;
  const Shapes shapes = shapes_of(causes, material.robot);
  if (!material.from_motion.alone()) return rest(material, shapes, std::move(causes));
  const std::vector<double> power_w = measured_power(material.windows, material.robot, false);
  const PowerMisfit power(material, shapes, causes, power_w);
  return rest_of_power(power, std::move(causes));
}

std::vector<Cause> base_fit(const Material& material, std::span<const double> power_w, Starts starts) {
  constexpr std::array<std::string_view, 7> ids{"accessory_load",     "coulomb_friction", "viscous_friction",
                                                "chassis_mass_error", "turning_scrub",    "aerodynamic_drag",
                                                "resistance_error"};
  // Resistance to turning that sets in at once, as of tyres that slide, or with the rate of turning.
  constexpr std::array scrub_rates_rad_s{0.03, 0.1, 0.3};
  std::vector<Cause> best;
  double least = std::numeric_limits<double>::infinity();
  const auto try_from = [&](const Shapes& shapes, const ColumnSet& columns, std::vector<Cause> causes) {
    const PowerMisfit power(material, shapes, causes, power_w);
    causes = material.from_motion.alone() ? rest_of_power(power, std::move(causes))
                                          : rest(material, shapes, std::move(causes));
    const double gap =
        gap_size(power_w, modelled_power(material.robot, material.adopted, causes, material.windows))
            .absolute_relative;
    if (gap >= least) return;
    least = gap;
    std::erase_if(causes, [&](const Cause& cause) {
      const auto at = columns.coordinates_of(cause);
      const std::size_t k = columns.hypotheses()[at->hypothesis].candidate.columns.front();
      return std::fabs(at->coefficients[0]) * columns.columns()[k].power_share < noticed_share;
    });
    best = std::move(causes);
  };
  for (const double rate_rad_s : scrub_rates_rad_s) {
    Shapes shapes;
    shapes.scrub_rates_rad_s = {rate_rad_s};
    const ColumnSet columns(material, shapes, std::array{wide_share});
    try_from(shapes, columns, as_regression(material, power_w, columns, ids));
    if (starts == Starts::both) try_from(shapes, columns, as_filed(columns, ids));
  }
  return best;
}

}  // namespace joulecast::gap

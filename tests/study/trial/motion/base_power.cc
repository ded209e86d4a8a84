#include "tests/study/trial/motion/base_power.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace joulecast::trial::motion {
namespace {

// Spreads beyond which a residual gets less weight. For the base power single glitches are down-weighted,
// frequently high loads are not; the referee, scored by absolute errors, fits nearly those.
constexpr double base_huber = 2.5, referee_huber = 0.5;
constexpr int reweightings = 30;
constexpr int sweeps = 2000;
constexpr std::size_t blocks = 20;

using Gram = std::array<Terms, term_count>;

struct Equations {
  Gram gram{};
  Terms right{};
};

Terms solve_bounded(const Equations& e, const BaseForm& form, Terms c) {
  for (int sweep = 0; sweep < sweeps; ++sweep) {
    for (std::size_t k = 0; k < term_count; ++k) {
      if (!(e.gram[k][k] > 0)) {
        c[k] = form.least[k];
        continue;
      }
      double right = e.right[k];
      for (std::size_t j = 0; j < term_count; ++j) right -= j == k ? 0 : e.gram[k][j] * c[j];
      c[k] = std::clamp(right / e.gram[k][k], form.least[k], form.most[k]);
    }
  }
  return c;
}

}  // namespace

std::string_view name_of(Term term) {
  constexpr std::array<std::string_view, term_count> names{"idle_w", "friction_n", "turning_nm", "inertia_kg",
                                                           "drag_n_s2_m2"};
  return names[static_cast<std::size_t>(term)];
}

double quantile_of(std::vector<double> values, double q) {
  const auto at = values.begin() + static_cast<std::ptrdiff_t>(q * static_cast<double>(values.size() - 1));
  std::ranges::nth_element(values, at);
  return *at;
}

BaseForm base_form_of(const MotionLog& log) {
  constexpr double viscous_share = 0.02;  // of friction at the usual speed
  constexpr double fast_m_s = 5;          // below it air drag is negligible
  constexpr double turning_share = 0.02;  // of the wheels' speed
  const std::vector<Instant> instants = log.all_instants();
  std::vector<double> speeds, sides;
  double mean_w = 0, sum = 0, squares = 0;
  for (const Instant& at : instants) {
    speeds.push_back(std::fabs(at.speed_m_s));
    sides.push_back(std::fabs(at.rim_m_s[0] - at.rim_m_s[1]) / 2);
    mean_w += std::fabs(at.power_w()) / static_cast<double>(instants.size());
    sum += (std::fabs(at.rim_m_s[0]) + std::fabs(at.rim_m_s[1])) / 2;
    squares += (at.rim_m_s[0] * at.rim_m_s[0] + at.rim_m_s[1] * at.rim_m_s[1]) / 2;
  }
  const robot::RobotModel& given = log.kinematics;
  BaseForm form;
  const double top_m_s = quantile_of(speeds, 0.95);
  form.fast = top_m_s > fast_m_s;
  form.turns = quantile_of(sides, 0.95) > turning_share * std::max(top_m_s, 1e-9);
  form.viscous_s_m = squares > 0 ? viscous_share * sum / squares : 0;
  const double half_m = given.kinematics.half_track_m;
  const double mass_kg = given.total_mass_kg(0);
  form.gyration_m2 = log.own_kinematics ? given.mass.yaw_inertia_kg_m2 / mass_kg : half_m * half_m;
  form.most.fill(std::numeric_limits<double>::max());
  const auto bound = [&](Term term, double least, double most) {
    form.least[static_cast<std::size_t>(term)] = least;
    form.most[static_cast<std::size_t>(term)] = most;
  };
  const double mean_speed = sum / static_cast<double>(instants.size());
  bound(Term::friction, mean_speed > 0 ? 0.02 * mean_w / mean_speed : 1, 1e9);
  bound(Term::inertia, log.own_kinematics ? 0.3 * mass_kg : 1, log.own_kinematics ? 6 * mass_kg : 1e5);
  if (!form.turns) bound(Term::turning, 0, 0);
  if (!form.fast) bound(Term::drag, 0, 0);
  return form;
}

Terms regressors(const BaseForm& form, const Instant& at) {
  double friction = 0;
  for (const double u : at.rim_m_s) friction += (std::fabs(u) + form.viscous_s_m * u * u) / 2;
  const double yaw = at.yaw_rate_rad_s, v = std::fabs(at.speed_m_s);
  return {1, friction, form.turns ? yaw * std::tanh(yaw / form.turning_rate_rad_s) : 0,
          at.speed_m_s * at.acceleration_m_s2 + form.gyration_m2 * yaw * at.yaw_acceleration_rad_s2,
          form.fast ? v * v * v : 0};
}

double base_power_w(const BaseForm& form, const Terms& coefficients, const Instant& at) {
  const Terms x = regressors(form, at);
  double power = 0;
  for (std::size_t k = 0; k < term_count; ++k) power += coefficients[k] * x[k];
  return power;
}

Terms fit_base(const BaseForm& form, std::span<const Instant> instants, std::span<const double> power_w,
               double huber) {
  std::vector<Terms> rows;
  for (const Instant& at : instants) rows.push_back(regressors(form, at));
  std::vector<double> left(rows.size()), weight(rows.size(), 1.0);
  Terms c = form.least;
  for (int round = 0; round < reweightings; ++round) {
    Equations e;
    for (std::size_t n = 0; n < rows.size(); ++n) {
      for (std::size_t k = 0; k < term_count; ++k) {
        e.right[k] += weight[n] * rows[n][k] * power_w[n];
        for (std::size_t j = 0; j < term_count; ++j) e.gram[k][j] += weight[n] * rows[n][k] * rows[n][j];
      }
    }
    c = solve_bounded(e, form, c);
    for (std::size_t n = 0; n < rows.size(); ++n) {
      left[n] = power_w[n];
      for (std::size_t k = 0; k < term_count; ++k) left[n] -= c[k] * rows[n][k];
    }
    // From the mean, not the median: if the robot mostly rests, the median does not depend on motion.
    double spread = 0;
    for (const double e_w : left) spread += 1.2533 * std::fabs(e_w) / static_cast<double>(left.size());
    for (std::size_t n = 0; n < rows.size(); ++n) {
      const double size = std::fabs(left[n]);
      weight[n] = size > huber * spread ? huber * spread / size : 1;
    }
  }
  return c;
}

BaseFit fit_log(const MotionLog& log) {
  // A twisting contact has at most about this friction; the catalogue allows 3, and effects are added to it.
  constexpr double most_scrub = 1.5;
  BaseFit fit;
  fit.form = base_form_of(log);
  const std::vector<Instant> instants = log.all_instants();
  std::vector<double> power_w;
  power_w.reserve(instants.size());
  for (const Instant& at : instants) power_w.push_back(at.power_w());
  fit.base = fit_base(fit.form, instants, power_w, base_huber);
  // Scrub grows with weight: a robot with this turning friction has at least this weight.
  constexpr auto turning = static_cast<std::size_t>(Term::turning),
                 inertia = static_cast<std::size_t>(Term::inertia);
  const double scrub_nm_kg =
      most_scrub * robot::standard_gravity_m_s2 * log.kinematics.kinematics.half_track_m / 2;
  if (fit.base[turning] > scrub_nm_kg * fit.base[inertia]) {
    fit.form.least[inertia] = fit.base[turning] / scrub_nm_kg;
    fit.form.most[inertia] = std::max(fit.form.most[inertia], fit.form.least[inertia]);
    fit.base = fit_base(fit.form, instants, power_w, base_huber);
  }
  double mean_w = 0;
  for (std::size_t n = 0; n < instants.size(); ++n) {
    mean_w +=
        (power_w[n] - base_power_w(fit.form, fit.base, instants[n])) / static_cast<double>(instants.size());
  }
  double& idle_w = fit.base[static_cast<std::size_t>(Term::idle)];
  idle_w = std::max(0.0, idle_w + mean_w);
  for (const auto& of_mission : log.instants) {
    auto& left = fit.residual_w.emplace_back();
    for (const Instant& at : of_mission) {
      left.push_back(at.power_w() - base_power_w(fit.form, fit.base, at));
    }
  }
  return fit;
}

double referee_error(const BaseForm& form, std::span<const Instant> instants,
                     std::span<const double> power_w) {
  double missed = 0, total = 0;
  const auto fold_of = [&](std::size_t n) { return n * blocks / instants.size() % 2; };
  for (const std::size_t fold : {0u, 1u}) {
    std::vector<Instant> seen;
    std::vector<double> seen_w;
    for (std::size_t n = 0; n < instants.size(); ++n) {
      if (fold_of(n) == fold) continue;
      seen.push_back(instants[n]);
      seen_w.push_back(power_w[n]);
    }
    const Terms c = fit_base(form, seen, seen_w, referee_huber);
    for (std::size_t n = 0; n < instants.size(); ++n) {
      if (fold_of(n) != fold) continue;
      missed += std::fabs(power_w[n] - base_power_w(form, c, instants[n]));
      total += std::fabs(power_w[n]);
    }
  }
  return total > 0 ? missed / total : 0;
}

}  // namespace joulecast::trial::motion

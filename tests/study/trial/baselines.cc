#include "tests/study/trial/baselines.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <string>
#include <utility>
#include <vector>

#include "dynamics/catalogue.h"
#include "tests/study/trial/window_power.h"
#include "windows/windows.h"

namespace joulecast::trial {
namespace {

constexpr std::size_t most_terms = 8;
constexpr double threshold_share = 0.02;  // of the mean power, below which a term is dropped
constexpr double ridge = 1e-3;
constexpr int threshold_rounds = 10;
constexpr double multiplier_sds = 2;

// One candidate: an effect in one shape, and the battery power that a strength of one adds in every window.
struct Term {
  const dynamics::Effect* effect = nullptr;
  Eigen::MatrixXd power_w;  // windows by one column, two where a direction is free
};

struct Problem {
  std::vector<std::size_t> mission;  // of each row
  std::size_t missions = 0;
  Eigen::VectorXd measured_w, nominal_w;
  Eigen::MatrixXd motion;  // regressors of a plain regression
  std::vector<Term> terms;

  Eigen::VectorXd residual_w() const { return measured_w - nominal_w; }
  Eigen::MatrixXd columns_of(const std::vector<std::size_t>& chosen) const {
    Eigen::Index width = 0;
    for (const std::size_t k : chosen) width += terms[k].power_w.cols();
    Eigen::MatrixXd x(nominal_w.size(), width);
    Eigen::Index at = 0;
    for (const std::size_t k : chosen) {
      x.middleCols(at, terms[k].power_w.cols()) = terms[k].power_w;
      at += terms[k].power_w.cols();
    }
    return x;
  }
};

using Shape = dynamics::EffectValues<double>;

// Where the robot was.
struct Floor {
  bool position = false, heading = false;
  double x_low_m = 0, x_high_m = 0, y_low_m = 0, y_high_m = 0;

  void cover(const windows::Window& w) {
    heading = heading || std::isfinite(w.heading_rad);
    if (!std::isfinite(w.x_m + w.y_m)) return;
    if (!position) x_low_m = x_high_m = w.x_m, y_low_m = y_high_m = w.y_m;
    position = true;
    x_low_m = std::min(x_low_m, w.x_m);
    x_high_m = std::max(x_high_m, w.x_m);
    y_low_m = std::min(y_low_m, w.y_m);
    y_high_m = std::max(y_high_m, w.y_m);
  }
};

// The shapes that an effect is tried in: its initial ones, a net of places, two creeping speeds.
std::vector<std::vector<Shape>> shapes_of(const dynamics::Effect& effect, const Floor& floor,
                                          double wheel_radius_m) {
  Shape shape = dynamics::initial(effect).values;
  const std::string_view id = effect.info().id;
  if (id == "floor_resistance_zone") {
    std::vector<std::vector<Shape>> places;
    if (!floor.position) return places;
    const double width = floor.x_high_m - floor.x_low_m, height = floor.y_high_m - floor.y_low_m;
    for (const double x : {0.2, 0.5, 0.8}) {
      for (const double y : {0.2, 0.5, 0.8}) {
        places.push_back({{0, floor.x_low_m + x * width, floor.y_low_m + y * height,
                           std::clamp(0.25 * std::min(width, height), 0.2, 100.0), 0}});
      }
    }
    return places;
  }
  if (id == "slope") {
    if (!floor.heading) return {};
    Shape other = shape;
    other[1] = std::numbers::pi / 2;
    return {{shape, other}};
  }
  if (id == "stribeck_friction") {
    Shape faster = shape;
    shape[1] = 0.1 / wheel_radius_m;
    faster[1] = 0.3 / wheel_radius_m;
    return {{shape}, {faster}};
  }
  if (id == "friction_asymmetry") {
    Shape left = shape;
    left[1] = 1;
    return {{shape}, {left}};
  }
  return {{shape}};
}

Problem make_problem(const telemetry::RecordingSet& recordings, const robot::RobotModel& robot) {
  const auto windows =
      windows::make_windows(recordings.missions, robot, windows::find_readings(recordings.missions));
  const std::vector<double> nominal = window_powers_w(robot, {}, windows);
  Problem problem;
  Floor floor;
  std::vector<windows::Window> usable;
  std::vector<double> measured_w, nominal_w;
  for (std::size_t k = 0; k < windows.size(); ++k) {
    if (!std::isfinite(windows[k].battery_power_w + nominal[k])) continue;
    usable.push_back(windows[k]);
    floor.cover(windows[k]);
    problem.mission.push_back(windows[k].mission);
    problem.missions = std::max(problem.missions, windows[k].mission + 1);
    measured_w.push_back(windows[k].battery_power_w);
    nominal_w.push_back(nominal[k]);
  }
  const auto n = static_cast<Eigen::Index>(usable.size());
  problem.measured_w = Eigen::Map<const Eigen::VectorXd>(measured_w.data(), n);
  problem.nominal_w = Eigen::Map<const Eigen::VectorXd>(nominal_w.data(), n);
  problem.motion.resize(n, 4);
  for (Eigen::Index k = 0; k < n; ++k) {
    const windows::Window& w = usable[static_cast<std::size_t>(k)];
    const double speed = 0.5 * (w.speed_rad_s[0] + w.speed_rad_s[1]);
    problem.motion.row(k) << 1, std::fabs(speed), std::fabs(w.speed_rad_s[0] - w.speed_rad_s[1]),
        speed * 0.5 * (w.acceleration_rad_s2[0] + w.acceleration_rad_s2[1]);
  }
  for (const dynamics::Effect* effect : dynamics::catalogue()) {
    for (const auto& shapes : shapes_of(*effect, floor, robot.kinematics.wheel_radius_m)) {
      Term term{effect, Eigen::MatrixXd::Zero(n, static_cast<Eigen::Index>(shapes.size()))};
      for (std::size_t column = 0; column < shapes.size(); ++column) {
        const dynamics::ActiveEffect active{effect, shapes[column]};
        const dynamics::BasicDriveModel<dynamics::Dual> model(robot, {&active, 1}, 0, 0);
        for (Eigen::Index k = 0; k < n; ++k) {
          const double slope = window_power_w(model, usable[static_cast<std::size_t>(k)]).slope;
          term.power_w(k, static_cast<Eigen::Index>(column)) = std::isfinite(slope) ? slope : 0;
        }
      }
      // A term that never changes battery power cannot be regressed on it.
      if (term.power_w.cwiseAbs().mean() > 1e-9) problem.terms.push_back(std::move(term));
    }
  }
  return problem;
}

Eigen::VectorXd least_squares(const Eigen::MatrixXd& x, const Eigen::VectorXd& y, double damping) {
  Eigen::MatrixXd normal = x.transpose() * x;
  const Eigen::VectorXd diagonal = normal.diagonal();
  normal.diagonal() += (damping + 1e-12) * diagonal;
  return normal.ldlt().solve(x.transpose() * y);
}

double bic(const Problem& p, const std::vector<std::size_t>& chosen) {
  const auto n = static_cast<double>(p.nominal_w.size());
  Eigen::VectorXd left = p.residual_w();
  double parameters = 0;
  if (!chosen.empty()) {
    const Eigen::MatrixXd x = p.columns_of(chosen);
    left -= x * least_squares(x, left, 0);
    parameters = static_cast<double>(x.cols());
  }
  return n * std::log(std::max(left.squaredNorm() / n, 1e-12)) + parameters * std::log(n);
}

bool has_effect(const Problem& p, const std::vector<std::size_t>& chosen, std::size_t term) {
  return std::ranges::any_of(chosen,
                             [&](std::size_t k) { return p.terms[k].effect == p.terms[term].effect; });
}

std::vector<std::size_t> stepwise(const Problem& p) {
  std::vector<std::size_t> chosen;
  double best = bic(p, chosen);
  while (true) {
    std::vector<std::size_t> better;
    for (std::size_t k = 0; k < p.terms.size() && chosen.size() < most_terms; ++k) {
      if (has_effect(p, chosen, k)) continue;
      auto candidate = chosen;
      candidate.push_back(k);
      if (const double b = bic(p, candidate); b < best) best = b, better = candidate;
    }
    for (std::size_t k = 0; k < chosen.size(); ++k) {
      auto candidate = chosen;
      candidate.erase(candidate.begin() + static_cast<std::ptrdiff_t>(k));
      if (const double b = bic(p, candidate); b < best) best = b, better = candidate;
    }
    if (better.empty()) return chosen;
    chosen = better;
  }
}

double moved_w(const Problem& p, std::size_t term, const Eigen::VectorXd& own) {
  return (p.terms[term].power_w * own).cwiseAbs().mean();
}

std::vector<std::size_t> thresholded(const Problem& p) {
  // One shape for each effect: the one that fits the residual best on its own.
  std::vector<std::size_t> chosen;
  for (std::size_t k = 0; k < p.terms.size(); ++k) {
    const auto same = std::ranges::find_if(
        chosen, [&](std::size_t other) { return p.terms[other].effect == p.terms[k].effect; });
    if (same == chosen.end()) {
      chosen.push_back(k);
    } else if (bic(p, {k}) < bic(p, {*same})) {
      *same = k;
    }
  }
  const double least_w = threshold_share * p.measured_w.cwiseAbs().mean();
  for (int round = 0; round < threshold_rounds && !chosen.empty(); ++round) {
    const Eigen::VectorXd c = least_squares(p.columns_of(chosen), p.residual_w(), ridge);
    std::vector<std::size_t> kept;
    Eigen::Index at = 0;
    for (const std::size_t k : chosen) {
      const Eigen::Index width = p.terms[k].power_w.cols();
      if (moved_w(p, k, c.segment(at, width)) >= least_w) kept.push_back(k);
      at += width;
    }
    if (kept.size() == chosen.size()) break;
    chosen = kept;
  }
  return chosen;
}

// Held out, mission by mission. `predict` gives the whole prediction from the rows that it may see.
template <class Predict>
void add_shrinkage(const Problem& p, Predict predict, gap::Diagnosis& d) {
  double after = 0;
  for (std::size_t m = 0; m < p.missions; ++m) {
    std::vector<Eigen::Index> seen;
    for (std::size_t k = 0; k < p.mission.size(); ++k) {
      if (p.mission[k] != m) seen.push_back(static_cast<Eigen::Index>(k));
    }
    if (seen.empty()) return;
    const Eigen::VectorXd predicted = predict(seen);
    for (std::size_t k = 0; k < p.mission.size(); ++k) {
      const auto row = static_cast<Eigen::Index>(k);
      if (p.mission[k] == m) after += std::fabs(p.measured_w[row] - predicted[row]);
    }
  }
  const double before = p.residual_w().cwiseAbs().sum();
  const double size = p.measured_w.cwiseAbs().sum();
  if (!(before > 0 && size > 0)) return;
  d.shrinkage.emplace();
  d.shrinkage->before = before / size;
  d.shrinkage->after = after / size;
  d.shrinkage->fraction = 1 - after / before;
}

gap::Diagnosis by_multiplier(const Problem& p) {
  gap::Diagnosis d;
  const auto factor_of = [&](const std::vector<Eigen::Index>& rows) {
    return p.measured_w(rows).sum() / p.nominal_w(rows).sum();
  };
  std::vector<double> factors;
  for (std::size_t m = 0; m < p.missions; ++m) {
    std::vector<Eigen::Index> own;
    for (std::size_t k = 0; k < p.mission.size(); ++k) {
      if (p.mission[k] == m) own.push_back(static_cast<Eigen::Index>(k));
    }
    if (!own.empty()) factors.push_back(factor_of(own));
  }
  const auto n = static_cast<double>(factors.size());
  double mean = 0, variance = 0;
  for (const double f : factors) mean += f / n;
  for (const double f : factors) variance += (f - mean) * (f - mean) / std::max(1.0, n - 1);
  const bool departs = std::fabs(mean - 1) > multiplier_sds * std::sqrt(variance / n);
  d.verdict = departs ? gap::Verdict::inconclusive : gap::Verdict::none;
  add_shrinkage(
      p,
      [&](const std::vector<Eigen::Index>& rows) -> Eigen::VectorXd { return factor_of(rows) * p.nominal_w; },
      d);
  return d;
}

gap::Diagnosis by_regression(const Problem& p) {
  gap::Diagnosis d;
  add_shrinkage(
      p,
      [&](const std::vector<Eigen::Index>& rows) -> Eigen::VectorXd {
        const Eigen::MatrixXd seen = p.motion(rows, Eigen::all);
        const Eigen::VectorXd seen_w = p.measured_w(rows);
        return p.motion * least_squares(seen, seen_w, 0);
      },
      d);
  return d;
}

gap::Diagnosis by_terms(const Problem& p, const std::vector<std::size_t>& chosen) {
  gap::Diagnosis d;
  d.verdict = chosen.empty() ? gap::Verdict::none : gap::Verdict::effects;
  d.verdict_probability = 1;
  if (chosen.empty()) return d;
  const Eigen::MatrixXd x = p.columns_of(chosen);
  const Eigen::VectorXd c = least_squares(x, p.residual_w(), 0);
  Eigen::Index at = 0;
  for (const std::size_t k : chosen) {
    const Eigen::Index width = p.terms[k].power_w.cols();
    const auto own = c.segment(at, width);
    const auto& info = p.terms[k].effect->info();
    gap::DiagnosedEffect effect;
    effect.id = info.id;
    effect.probability = 1;
    effect.share = moved_w(p, k, own);
    effect.parameters = {{std::string(info.parameters[0].name), std::string(info.parameters[0].unit),
                          width == 1 ? own[0] : own.norm(), windows::missing}};
    d.effects.push_back(std::move(effect));
    at += width;
  }
  std::ranges::stable_sort(d.effects, std::greater{}, &gap::DiagnosedEffect::share);
  const Eigen::VectorXd y = p.residual_w();
  add_shrinkage(
      p,
      [&](const std::vector<Eigen::Index>& rows) -> Eigen::VectorXd {
        const Eigen::MatrixXd seen = x(rows, Eigen::all);
        const Eigen::VectorXd seen_y = y(rows);
        return p.nominal_w + x * least_squares(seen, seen_y, 0);
      },
      d);
  return d;
}

}  // namespace

std::string_view name_of(Baseline baseline) {
  switch (baseline) {
    case Baseline::multiplier:
      return "one factor on energy";
    case Baseline::regression:
      return "plain regression on motion";
    case Baseline::stepwise_bic:
      return "stepwise regression, BIC";
    case Baseline::thresholded_squares:
      return "thresholded least squares";
  }
  return "";
}

gap::Diagnosis diagnose_by(Baseline baseline, const telemetry::RecordingSet& recordings,
                           const robot::RobotModel& robot) {
  const Problem problem = make_problem(recordings, robot);
  if (problem.mission.empty()) return {};
  switch (baseline) {
    case Baseline::multiplier:
      return by_multiplier(problem);
    case Baseline::regression:
      return by_regression(problem);
    case Baseline::stepwise_bic:
      return by_terms(problem, stepwise(problem));
    case Baseline::thresholded_squares:
      return by_terms(problem, thresholded(problem));
  }
  return {};
}

}  // namespace joulecast::trial

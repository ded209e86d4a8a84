#include "gap/posterior/terms.h"

#include <algorithm>
#include <cmath>

#include "gap/posterior/constants.h"
#include "gap/traits.h"
#include "gap/verdict/adopt.h"
#include "statistics/bootstrap.h"
#include "statistics/regression.h"
#include "windows/windows.h"

namespace joulecast::gap::posterior {
namespace {

constexpr std::size_t fewest_term_rows = 30;

// Terms that are reported as one.
using TermGroup = std::vector<Eigen::Index>;

double deviation_of(const Eigen::VectorXd& draws) {
  return std::sqrt((draws.array() - draws.mean()).square().mean());
}

class TermTable {
 public:
  TermTable(const Fit& fit, const Eigen::VectorXd& explained_w)
      : fit_(fit), columns_(term_columns(fit.data)), x_(columns_.x) {
    const Data& d = fit.data;
    const Eigen::VectorXd measured = d.rows.measured_w();
    const std::vector<std::size_t> block = d.rows.blocks();
    const statistics::Regression r = statistics::robust_regression(x_, measured, block, columns_.nonnegative);
    data_ = r.coefficients;
    const Eigen::MatrixXd weighted = r.weight.asDiagonal() * x_, xx = weighted.transpose() * x_;
    const auto in_terms = [&](const Eigen::VectorXd& power_w) {
      return statistics::signed_solution(xx, weighted.transpose() * power_w, columns_.nonnegative);
    };
    model_ = in_terms(fit.unchanged_w);
    explained_ = in_terms(explained_w);
    size_ = x_.cwiseAbs().colwise().mean();
    mean_ = x_.colwise().mean();
    resample(weighted, measured, block);
  }

  PowerTerms table() const {
    PowerTerms out;
    for (const TermGroup& g : groups()) {
      Term t = term(g);
      const double least = std::max(term_sd * t.deviation_w, term_part * fit_.data.mean_power_w);
      if (std::fabs(t.difference_w) >= least) add_sum(g, t, out.sums);
      out.terms.push_back(std::move(t));
    }
    const auto size = [](const Term& t) { return std::fabs(t.difference_w); };
    std::ranges::stable_sort(out.terms, std::greater(), size);
    return out;
  }

 private:
  // Coefficients of resampled blocks at the weights of all rows, with signs and without.
  void resample(const Eigen::MatrixXd& weighted, const Eigen::VectorXd& measured,
                const std::vector<std::size_t>& block) {
    std::vector<statistics::Information> blocks(fit_.data.blocks, statistics::Information(x_.cols()));
    for (Eigen::Index row = 0; row < x_.rows(); ++row) {
      statistics::Information& own = blocks[block[ux(row)]];
      own.xx.noalias() += weighted.row(row).transpose() * x_.row(row);
      own.xy += measured[row] * weighted.row(row).transpose();
    }
    const std::vector<bool> unsigned_terms(columns_.nonnegative.size(), false);
    const auto draws = statistics::bootstrap_counts(blocks.size(), term_draws);
    signed_draws_.resize(ix(draws.size()), x_.cols());
    free_draws_ = signed_draws_;
    for (std::size_t n = 0; n < draws.size(); ++n) {
      const std::vector<double> weights(draws[n].begin(), draws[n].end());
      const Information all = weighted_sum(blocks, weights);
      signed_draws_.row(ix(n)) = statistics::signed_solution(all.xx, all.xy, columns_.nonnegative);
      free_draws_.row(ix(n)) = statistics::signed_solution(all.xx, all.xy, unsigned_terms);
    }
  }

  // A term at zero by its sign constraint has the deviation of the unconstrained fit: otherwise it would be 0
  // +- 0.
  Eigen::VectorXd draws_of(const TermGroup& g, const Eigen::RowVectorXd& scale) const {
    const bool held = std::ranges::any_of(g, [&](Eigen::Index k) { return data_[k] == 0; });
    Eigen::VectorXd own = signed_draws_(Eigen::all, g) * scale(g).transpose();
    if (!held) return own;
    Eigen::VectorXd free = free_draws_(Eigen::all, g) * scale(g).transpose();
    return deviation_of(free) > deviation_of(own) ? free : own;
  }

  std::vector<TermGroup> groups() const {
    std::vector<TermGroup> out;
    for (Eigen::Index k = 0; k < x_.cols(); ++k) {
      const double most = std::max({std::fabs(data_[k]), std::fabs(model_[k]), std::fabs(explained_[k])});
      if (most * size_[k] > shown_part * fit_.data.mean_power_w) out.push_back({k});
    }
    while (out.size() > 1) {
      double least = joined_deviation;
      std::array<std::size_t, 2> join{};
      for (std::size_t a = 0; a < out.size(); ++a) {
        for (std::size_t b = a + 1; b < out.size(); ++b)
          if (const double r = distinct(out[a], out[b]); r < least) least = r, join = {a, b};
      }
      if (join[1] == 0) break;
      out[join[0]].insert(out[join[0]].end(), out[join[1]].begin(), out[join[1]].end());
      out.erase(out.begin() + static_cast<std::ptrdiff_t>(join[1]));
    }
    return out;
  }

  // Deviation of the sum of two terms over the smaller of theirs; 1 where one of them is certain.
  double distinct(const TermGroup& a, const TermGroup& b) const {
    const Eigen::VectorXd x = draws_of(a, mean_), y = draws_of(b, mean_);
    const double sx = deviation_of(x), sy = deviation_of(y);
    if (sx < known_part * std::fabs(x.mean()) || sy < known_part * std::fabs(y.mean())) return 1;
    const Eigen::VectorXd u = x_(Eigen::all, a).rowwise().sum(), v = x_(Eigen::all, b).rowwise().sum();
    if (std::fabs(u.dot(v)) > joined_alike * u.norm() * v.norm()) return 0;
    return deviation_of(x + y) / std::max(std::min(sx, sy), 1e-12);
  }

  Term term(const TermGroup& g) const {
    Term t;
    for (const Eigen::Index k : g) t.name += (t.name.empty() ? "" : " + ") + columns_.names[ux(k)];
    Eigen::RowVectorXd scale = mean_;
    double to_w = 1;
    t.unit = "W";
    if (g.size() == 1) {
      scale.setOnes();
      to_w = size_[g[0]];
      t.unit = columns_.units[ux(g[0])];
    }
    const auto value = [&](const Eigen::VectorXd& c) { return scale(g).dot(c(g)); };
    t.value = value(data_);
    t.model = value(model_);
    t.explained = value(explained_);
    t.deviation = deviation_of(draws_of(g, scale));
    t.difference_w = to_w * (t.value - t.model);
    t.deviation_w = to_w * t.deviation;
    return t;
  }

  // Adds the effects that have the form of these terms, and the one that takes the difference.
  void add_sum(const TermGroup& g, const Term& t, std::vector<TermSum>& sums) const {
    const Eigen::MatrixXd own = x_(Eigen::all, g);
    const Eigen::ColPivHouseholderQR<Eigen::MatrixXd> solver(own);
    const Eigen::VectorXd difference = own * (data_ - model_)(g);
    struct Like {
      double r2, off;  // off: mean |difference - change by the effect| over mean power
      std::size_t hypothesis;
      double strength;
    };
    std::vector<Like> like;
    for (std::size_t h = 0; h < fit_.catalogue.hypotheses.size(); ++h) {
      const auto& columns = fit_.catalogue.hypotheses[h].columns;
      const Eigen::VectorXd moved = fit_.equations.moved.col(ix(columns[0]));
      const double size = moved.squaredNorm();
      if (columns.size() > 1 || size == 0) continue;
      const double r2 = 1 - (moved - own * solver.solve(moved)).squaredNorm() / size;
      const double strength = moved.dot(difference) / size;
      const double off = (difference - strength * moved).cwiseAbs().mean() / fit_.data.mean_power_w;
      if (r2 > same_form) like.push_back({r2, off, h, strength});
    }
    if (like.empty()) return;
    std::ranges::stable_sort(like, std::greater(), &Like::r2);
    TermSum sum{t.name, t.difference_w, t.deviation_w, {}, {}, {}, missing, missing};
    bool own_parameter = false;
    for (const Like& l : like) {
      const Hypothesis& h = fit_.catalogue.hypotheses[l.hypothesis];
      if (std::ranges::find(sum.effects, h.id()) == sum.effects.end()) sum.effects.push_back(h.id());
      if (!h.is_effect() || h.parameter != 0 || l.off > equivalent || own_parameter) continue;
      const bool of_file = !traits_of(h.id()).calibrates.empty();
      if (!sum.parameter.empty() && !of_file) continue;
      dynamics::ActiveEffect effect = h.effect;
      effect.values[h.parameter] = l.strength;
      const std::array found{dynamics::adopt(effect)};
      if (!with_corrections(fit_.data.robot, found)) continue;
      const double sd = std::fabs(l.strength * t.deviation_w / t.difference_w);
      const auto corrections = corrections_of(fit_.data.robot, found, std::array{sd});
      if (corrections.empty()) continue;
      sum.parameter = corrections[0].parameter;
      sum.value = corrections[0].fits;
      sum.deviation = corrections[0].deviation;
      own_parameter = of_file;
    }
    sums.push_back(std::move(sum));
  }

  const Fit& fit_;
  TermColumns columns_;
  const Eigen::MatrixXd& x_;
  Eigen::VectorXd data_, model_, explained_;
  Eigen::RowVectorXd size_, mean_;  // mean |x| and mean x
  Eigen::MatrixXd signed_draws_, free_draws_;
};

// Of runs and groups. Groups may have nothing in common: each has columns of its own.
TermColumns whole_run_columns(const Data& d) {
  const double r = d.robot.kinematics.wheel_radius_m;
  const std::vector<Modulation> by = modulations_of(d.rows.instants);
  TermColumns out{{"constant", "|v|", "turning", "v a", "climb", "payload"},
                  {"W", "J/m", "J/m", "W s^3/m^2", "J/m", "J/(kg m)"},
                  {},
                  Eigen::MatrixXd(ix(d.rows.size()), 6 + ix(by.size()))};
  for (Eigen::Index k = 0; k < 5; ++k)
    out.x.col(k) = d.rows.mean([&](const Window& w) { return windows::plain_terms(w, r)[ux(k)]; });
  out.x.col(5) = d.rows.mean([&](const Window& w) { return w.payload_kg * windows::plain_terms(w, r)[1]; });
  for (std::size_t k = 0; k < by.size(); ++k) {
    out.x.col(6 + ix(k)) = d.rows.mean([&](const Window& w) { return by[k].of(w); });
    out.names.push_back("covariate:" + d.covariates[by[k].covariate]);
    out.units.emplace_back("W/unit");
  }
  // From rest to rest v a is rounding error.
  for (Eigen::Index k = 2; k < 5; ++k) {
    if (out.x.col(k).cwiseAbs().maxCoeff() < rounding * out.x.col(1).cwiseAbs().maxCoeff())
      out.x.col(k).setZero();
  }
  if (d.group.empty()) return out;
  const Eigen::MatrixXd all = out.x;
  const std::size_t groups = 1 + *std::ranges::max_element(d.group);
  out.x.setZero(all.rows(), all.cols() * ix(groups));
  for (Eigen::Index row = 0; row < all.rows(); ++row)
    out.x.row(row).segment(all.cols() * ix(d.group[d.rows.window(ux(row)).mission]), all.cols()) =
        all.row(row);
  return out;
}

}  // namespace

TermColumns term_columns(const Data& d) {
  if (!d.of_instants()) return whole_run_columns(d);
  const double radius = d.robot.kinematics.wheel_radius_m;
  TermColumns out;
  std::vector<Eigen::VectorXd> columns;
  const auto add = [&](std::string name, std::string unit, const auto& value, bool nonnegative = true) {
    Eigen::VectorXd column = d.rows.mean(value);
    if (column.cwiseAbs().maxCoeff() == 0) return;
    columns.push_back(std::move(column));
    out.names.push_back(std::move(name));
    out.units.push_back(std::move(unit));
    out.nonnegative.push_back(nonnegative);
  };
  const auto speed = [&](const Window& w) { return radius / 2 * (w.speed_rad_s[0] + w.speed_rad_s[1]); };
  add("constant", "W", [](const Window&) { return 1.0; });
  add("|v|", "W per m/s", [&](const Window& w) { return std::fabs(speed(w)); });
  add("v^2", "W per (m/s)^2", [&](const Window& w) { return std::pow(speed(w), 2); });
  add("v^3", "W per (m/s)^3", [&](const Window& w) { return std::pow(std::fabs(speed(w)), 3); });
  add("turning", "W per m/s of half the wheel-speed difference",
      [&](const Window& w) { return radius / 2 * std::fabs(w.speed_rad_s[0] - w.speed_rad_s[1]); });
  add("v a", "W per m^2/s^3 (kg)", [&](const Window& w) {
    return speed(w) * radius / 2 * (w.acceleration_rad_s2[0] + w.acceleration_rad_s2[1]);
  });
  add("v climb", "W per m/s of climb",
      [&](const Window& w) { return std::isfinite(w.climb_rad) ? speed(w) * std::sin(w.climb_rad) : 0.0; });
  for (const Modulation& by : modulations_of(d.rows.instants))
    add(
        d.covariates[by.covariate], "W per unit", [&](const Window& w) { return by.of(w); }, false);
  out.x.resize(ix(d.rows.size()), ix(columns.size()));
  for (std::size_t k = 0; k < columns.size(); ++k) out.x.col(ix(k)) = columns[k];
  return out;
}

PowerTerms power_terms(const Fit& fit, const Eigen::VectorXd& explained_w) {
  if (fit.data.rows.size() < fewest_term_rows) return {};
  return TermTable(fit, explained_w).table();
}

}  // namespace joulecast::gap::posterior

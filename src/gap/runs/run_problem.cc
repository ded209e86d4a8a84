#include "gap/runs/run_problem.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <numeric>

#include "gap/runs/run_referee.h"
#include "statistics/robust.h"

namespace joulecast::gap {
namespace {

using statistics::Information;

constexpr double any_run_load =
    0.3;  // most share of the energy that each cause may move in the fit of everything
constexpr double least_scatter = 0.002;                    // rounding, and conditions that no table lists
constexpr double most_scatter = 0.5, scatter_step = 1.15;  // of the search
constexpr std::array widths{0.003, 0.01, 0.03, 0.1, 0.3, 1.0};  // of the prior of the fit of everything
constexpr double run_outlier_sd = 2.5;                          // spreads from which on a run counts less
constexpr std::size_t most_blocks = 24;
constexpr double usual_shift = 0.02;  // from day to day and floor to floor

// What is averaged over: the scatter over what was learnt, how well the robot keeps to its file, how far
// formulas are off as a part of the energy, and shifts between tables.
constexpr std::array scatters{0.6, 0.8, 1.0, 1.3, 1.7, 2.3, 3.2};
constexpr double scatter_known_to = 0.4;  // sd of its logarithm
constexpr std::array run_keeping{0.5, 1.0, 2.0};
constexpr std::array run_formulas{0.0, 0.003};
constexpr std::array shifts{0.005, 0.01, 0.02, 0.04, 0.08};

// Rows with everything relative to the size of their run.
struct Relative {
  Eigen::MatrixXd x;
  Eigen::VectorXd y;
};

Relative relative(const RunColumns& columns, const Eigen::VectorXd& size_j) {
  const auto& rows = columns.rows();
  Relative r{
      Eigen::MatrixXd(static_cast<Eigen::Index>(rows.size()), static_cast<Eigen::Index>(columns.size())),
      Eigen::VectorXd(static_cast<Eigen::Index>(rows.size()))};
  for (std::size_t k = 0; k < rows.size(); ++k) {
    const auto at = static_cast<Eigen::Index>(k);
    const double size = size_j[static_cast<Eigen::Index>(rows[k].run)];
    r.x.row(at) = rows[k].x.transpose();
    for (std::size_t c = 0; c < columns.size() && !columns.relative(c); ++c)
      r.x(at, static_cast<Eigen::Index>(c)) /= size;
    r.y[at] = rows[k].y / size;
  }
  return r;
}

// sd of every coefficient in a fit of everything.
Eigen::VectorXd freedom(const RunColumns& columns) {
  Eigen::VectorXd sd(static_cast<Eigen::Index>(columns.size()));
  for (std::size_t c = 0; c < columns.size(); ++c) {
    const Column& column = columns.columns()[c];
    const bool cause = column.discrepancy > 0;
    const double shift = c >= columns.first_shift() ? usual_shift : column.tolerance;
    sd[static_cast<Eigen::Index>(c)] = cause ? any_run_load / column.power_share : shift;
  }
  return sd;
}

// Mean change that hypotheses make, over the energies.
class MovedRuns {
 public:
  MovedRuns(const RunColumns& columns, Relative rows) : columns_(columns.columns()), rows_(std::move(rows)) {}

  double operator()(const Hypothesis& h, const Eigen::VectorXd& coefficients) const {
    if (h.outside()) return change(h, coefficients).cwiseAbs().mean();
    const std::size_t own = h.candidate.columns.front();
    return std::fabs(coefficients[0]) * columns_[own].power_share;
  }

  double likeness(const Hypothesis& a, const Hypothesis& b) const {
    const auto moved = [&](const Hypothesis& h) {
      return change(h, Eigen::VectorXd::Ones(static_cast<Eigen::Index>(h.candidate.columns.size())));
    };
    const Eigen::VectorXd of_a = moved(a), of_b = moved(b);
    const double size = of_a.norm() * of_b.norm();
    return size > 0 ? std::fabs(of_a.dot(of_b)) / size : 0;
  }

  double cancelling(const std::vector<Hypothesis>& hypotheses, const HypothesisSet& set,
                    const Eigen::VectorXd& coefficients) const {
    constexpr double matters = 0.1;  // of what the response is
    double apart = 0;
    Eigen::VectorXd together = Eigen::VectorXd::Zero(rows_.y.size());
    Eigen::Index at = 0;
    for (const std::size_t h : set) {
      const auto n = static_cast<Eigen::Index>(hypotheses[h].candidate.columns.size());
      const Eigen::VectorXd own = change(hypotheses[h], coefficients.segment(at, n));
      apart += own.cwiseAbs().mean();
      together += own;
      at += n;
    }
    if (apart <= matters * rows_.y.cwiseAbs().mean()) return 1;
    return apart / std::max(together.cwiseAbs().mean(), 1e-12);
  }

 private:
  Eigen::VectorXd change(const Hypothesis& h, const Eigen::VectorXd& coefficients) const {
    Eigen::VectorXd sum = Eigen::VectorXd::Zero(rows_.y.size());
    for (std::size_t k = 0; k < h.candidate.columns.size(); ++k)
      sum += coefficients[static_cast<Eigen::Index>(k)] *
             rows_.x.col(static_cast<Eigen::Index>(h.candidate.columns[k]));
    return sum;
  }
  std::vector<Column> columns_;
  Relative rows_;
};

// Adds columns of their own for each group but the first.
void in_groups(Relative& r, Eigen::VectorXd& sd, const std::vector<RunRow>& rows,
               std::span<const std::size_t> group) {
  const Eigen::Index p = r.x.cols();
  const auto more = static_cast<Eigen::Index>(*std::ranges::max_element(group));
  r.x.conservativeResize(Eigen::NoChange, p * (more + 1));
  r.x.rightCols(p * more).setZero();
  for (Eigen::Index k = 0; k < r.x.rows(); ++k) {
    const auto own = static_cast<Eigen::Index>(group[rows[static_cast<std::size_t>(k)].run]);
    if (own > 0) r.x.row(k).segment(p * own, p) = r.x.row(k).head(p).eval();
  }
  sd = sd.replicate(more + 1, 1).eval();
}

// A fit of every cause and trend at once, each held by one prior; the scatter and the prior's width are those
// under which the energies are likeliest.
struct FitOfAll {
  std::array<double, 2> scatter{};  // of the energy, of right minus left
  Eigen::VectorXd left, residual;   // relative; the same over what it is expected to scatter by

  FitOfAll(const Relative& r, const std::vector<RunRow>& rows, const Eigen::VectorXd& freedom,
           const RunScatter& start)
      : scatter{start.run, start.difference} {
    double width = 1, best = -std::numeric_limits<double>::infinity();
    const bool differences = std::ranges::any_of(rows, &RunRow::difference);
    // One after the other, as each depends little on the other.
    for (const std::size_t which :
         differences ? std::vector<std::size_t>{0, 1, 0, 1} : std::vector<std::size_t>{0}) {
      best = -std::numeric_limits<double>::infinity();
      std::array<double, 2> now = scatter;
      for (double sigma = least_scatter; sigma < most_scatter; sigma *= scatter_step) {
        now[which] = sigma;
        for (const double w : widths) {
          const double density = solve(r, rows, w * freedom, start.weight, now);
          if (density <= best) continue;
          best = density;
          scatter[which] = sigma;
          width = w;
        }
      }
    }
    solve(r, rows, width * freedom, start.weight, scatter);
  }

 private:
  double solve(const Relative& r, const std::vector<RunRow>& rows, const Eigen::VectorXd& sd,
               const Eigen::VectorXd& weight, const std::array<double, 2>& sigma) {
    const Eigen::Index n = r.y.size();
    Eigen::VectorXd root(n);
    double density = 0;
    for (Eigen::Index k = 0; k < n; ++k) {
      root[k] = std::sqrt(weight[k]) / sigma[rows[static_cast<std::size_t>(k)].difference ? 1 : 0];
      if (root[k] > 0) density += std::log(root[k]);
    }
    const Eigen::MatrixXd x = root.asDiagonal() * r.x * sd.asDiagonal();
    const Eigen::VectorXd y = root.cwiseProduct(r.y);
    // Whichever is smaller: coefficients or runs.
    Eigen::MatrixXd a =
        n < x.cols() ? Eigen::MatrixXd(x * x.transpose()) : Eigen::MatrixXd(x.transpose() * x);
    a.diagonal().array() += 1.0;
    const Eigen::LLT<Eigen::MatrixXd> factor(a);
    density -= factor.matrixLLT().diagonal().array().log().sum();
    Eigen::VectorXd whitened,
        kept;  // what the fit leaves, and the part of each row's variance that it leaves
    if (n < x.cols()) {
      whitened = factor.solve(y);
      kept = factor.solve(Eigen::MatrixXd::Identity(n, n)).diagonal();
    } else {
      whitened = y - x * factor.solve(x.transpose() * y);
      kept = 1 - factor.matrixL().solve(x.transpose()).colwise().squaredNorm().transpose().array();
    }
    density -= 0.5 * y.dot(whitened);
    residual = whitened.cwiseQuotient(kept.cwiseMax(0.02).cwiseSqrt());
    left = Eigen::VectorXd::Zero(n);
    for (Eigen::Index k = 0; k < n; ++k) {
      if (root[k] > 0) left[k] = whitened[k] / root[k];
    }
    return density;
  }
};

}  // namespace

RunScatter learn_scatter(const RunColumns& columns, const std::vector<bool>& left_out,
                         std::span<const std::size_t> group) {
  const auto& rows = columns.rows();
  const auto n = static_cast<Eigen::Index>(rows.size());
  RunScatter s;
  s.size_j.resize(static_cast<Eigen::Index>(columns.runs().size()));
  for (std::size_t k = 0; k < columns.runs().size(); ++k)
    s.size_j[static_cast<Eigen::Index>(k)] = columns.size_j(k);
  s.run = s.difference = least_scatter;
  s.weight = Eigen::VectorXd::Zero(n);
  // A fit of everything follows single runs whose conditions no other has: what a plain regression is far
  // from counts less from the beginning.
  std::vector<double> measured;
  for (const MissionRun& run : columns.runs()) measured.push_back(run.measured_j());
  const std::vector<double> apart = RunReferee(columns).apart(measured, left_out);
  for (Eigen::Index k = 0; k < n; ++k) {
    const std::size_t run = rows[static_cast<std::size_t>(k)].run;
    s.weight[k] = !left_out.empty() && left_out[run]
                      ? 0
                      : std::pow(statistics::huber_weight(apart[run], 1, RunReferee::gross), 2);
  }
  const Eigen::VectorXd use = s.weight;
  for (int pass = 0; pass < 3; ++pass) {
    Relative r = relative(columns, s.size_j);
    Eigen::VectorXd sd = freedom(columns);
    if (!group.empty()) in_groups(r, sd, rows, group);
    const FitOfAll fit(r, rows, sd, s);
    s.run = fit.scatter[0];
    s.difference = fit.scatter[1];
    s.weight = use;
    for (Eigen::Index k = 0; k < n; ++k) {
      const RunRow& row = rows[static_cast<std::size_t>(k)];
      if (use[k] == 0) continue;
      s.weight[k] = use[k] * statistics::huber_weight(fit.residual[k], 1, run_outlier_sd);
      if (row.difference) continue;
      double& size_j = s.size_j[static_cast<Eigen::Index>(row.run)];
      const double usual = columns.size_j(row.run);
      size_j = std::clamp(measured[row.run] - fit.left[k] * size_j, 0.5 * usual, 2 * usual);
    }
  }
  return s;
}

std::vector<std::size_t> blocks_of(std::span<const MissionRun> runs, std::span<const std::string> groups) {
  std::vector<std::size_t> order(runs.size()), block(runs.size());
  std::iota(order.begin(), order.end(), 0u);
  const auto place = [&](std::size_t k) {
    return std::pair<std::string_view, std::string_view>(groups.empty() ? "" : std::string_view(groups[k]),
                                                         runs[k].table);
  };
  std::ranges::stable_sort(order, {}, place);
  const std::size_t most = (runs.size() + most_blocks - 1) / most_blocks;
  std::size_t next = 0, length = 0;
  for (std::size_t k = 0; k < order.size(); ++k) {
    if (k > 0 && (length == most || place(order[k]) != place(order[k - 1]))) {
      ++next;
      length = 0;
    }
    block[order[k]] = next;
    ++length;
  }
  return block;
}

Problem make_problem(const RunColumns& columns, const RunScatter& scatter, std::span<const std::size_t> block,
                     const Eigen::VectorXd* response) {
  const auto p = static_cast<Eigen::Index>(columns.size());
  Relative r = relative(columns, scatter.size_j);
  if (response != nullptr) {
    for (Eigen::Index k = 0; k < r.y.size(); ++k)
      r.y[k] = (*response)[k] /
               scatter.size_j[static_cast<Eigen::Index>(columns.rows()[static_cast<std::size_t>(k)].run)];
  }
  Problem problem;
  problem.hypotheses = columns.hypotheses();
  std::vector<Information> plain(1 + *std::ranges::max_element(block), Information(p));
  for (std::size_t k = 0; k < columns.rows().size(); ++k) {
    const RunRow& row = columns.rows()[k];
    const auto at = static_cast<Eigen::Index>(k);
    if (!(scatter.weight[at] > 0)) continue;
    const double by = std::sqrt(scatter.weight[at]) / (row.difference ? scatter.difference : scatter.run);
    plain[block[row.run]].add(by * r.x.row(at), by * r.y.segment(at, 1));
    plain[block[row.run]].log_scale += std::log(by);
  }
  std::vector<double> rows_of(plain.size(), 0);
  for (std::size_t k = 0; k < columns.rows().size(); ++k)
    rows_of[block[columns.rows()[k].run]] += scatter.weight[static_cast<Eigen::Index>(k)] > 0 ? 1 : 0;
  Eigen::VectorXd tolerance(p), discrepancy(p);
  for (Eigen::Index k = 0; k < p; ++k) {
    tolerance[k] = columns.columns()[static_cast<std::size_t>(k)].tolerance;
    discrepancy[k] = columns.columns()[static_cast<std::size_t>(k)].discrepancy;
  }
  const Eigen::Index first_shift = static_cast<Eigen::Index>(columns.first_shift()), tables = p - first_shift;
  for (const double wider : scatters) {
    problem.blocks.push_back(plain);
    for (std::size_t b = 0; b < plain.size(); ++b) {
      Information& block_info = problem.blocks.back()[b];
      block_info *= 1 / (wider * wider);
      block_info.log_scale = plain[b].log_scale - rows_of[b] * std::log(wider);
    }
    if (wider == 1) {
      problem.plain.tolerance = tolerance;
      problem.plain.tolerance.tail(tables).setConstant(usual_shift);
      problem.plain.noise = problem.blocks.size() - 1;
    }
    for (const double factor : run_keeping) {
      for (const double off : run_formulas) {
        for (const double shift : shifts) {
          if (tables == 0 && shift != usual_shift) continue;
          Circumstances c;
          c.log_prior = -0.5 * (std::pow(std::log(wider) / scatter_known_to, 2) +
                                std::pow(std::log2(factor), 2) + std::pow(shift / usual_shift, 2));
          c.tolerance = ((factor * tolerance).array().square() + (off * discrepancy).array().square()).sqrt();
          c.tolerance.tail(tables).setConstant(shift);
          c.noise = problem.blocks.size() - 1;
          problem.circumstances.push_back(std::move(c));
        }
      }
    }
  }
  for (const Hypothesis& h : problem.hypotheses) {
    for (const std::size_t k : h.candidate.columns) problem.plain.tolerance[static_cast<Eigen::Index>(k)] = 0;
  }
  const auto moved = std::make_shared<const MovedRuns>(columns, std::move(r));
  problem.moved = [moved](const Hypothesis& h, const Eigen::VectorXd& c) { return (*moved)(h, c); };
  problem.likeness = [moved](const Hypothesis& a, const Hypothesis& b) { return moved->likeness(a, b); };
  problem.cancelling = [moved, hypotheses = problem.hypotheses](const HypothesisSet& set,
                                                                const Eigen::VectorXd& c) {
    return moved->cancelling(hypotheses, set, c);
  };
  return problem;
}

}  // namespace joulecast::gap

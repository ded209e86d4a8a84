#include "gap/equations/noise.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>

#include "statistics/robust.h"

namespace joulecast::gap {
namespace {

constexpr double outlier = 3.5;  // in spreads; beyond it the weight falls
constexpr std::size_t fewest_rows = 20;
constexpr std::size_t fewest_blocks = 6;  // to learn from how blocks scatter
constexpr std::size_t at_once = 256;      // windows that are evaluated before their rows are written

// Standard deviation that each coefficient may have, there or not.
std::vector<double> possible_sd(const ColumnSet& columns) {
  std::vector<double> sd(columns.size(), 1e-9);
  for (std::size_t j = 0; j < columns.size(); ++j)
    sd[j] = std::max({sd[j], columns.columns()[j].tolerance, columns.columns()[j].scatter});
  for (const Hypothesis& h : columns.hypotheses()) {
    for (const std::size_t j : h.candidate.columns) sd[j] = std::max(sd[j], h.candidate.expected);
  }
  return sd;
}

struct FlexibleFit {
  Eigen::VectorXd residual;
  double freedom = 0;  // rows that the fit has not used up
};

// Everything that may be there, held by its prior. Rows of weight 0 take no part, and still get a residual.
FlexibleFit fit_everything(const ChannelRows& rows, const Eigen::VectorXd& weight,
                           const Eigen::VectorXd& sd) {
  const Eigen::MatrixXd scaled = rows.x * sd.asDiagonal();
  const Eigen::MatrixXd weighted = weight.asDiagonal() * scaled;
  const Eigen::Index p = scaled.cols();
  Eigen::MatrixXd normal = Eigen::MatrixXd::Zero(p, p);
  if (scaled.size() > 0) normal.triangularView<Eigen::Lower>() += weighted.transpose() * scaled;
  normal = normal.selfadjointView<Eigen::Lower>();
  normal.diagonal().array() += 1.0;
  const Eigen::LDLT<Eigen::MatrixXd> factor(normal);
  FlexibleFit fit;
  fit.residual = rows.y - scaled * factor.solve(weighted.transpose() * rows.y);
  const double used = static_cast<double>(p) - factor.solve(Eigen::MatrixXd::Identity(p, p)).trace();
  const double count = (weight.array() > 0).cast<double>().sum();
  fit.freedom = std::max(count - used, 0.1 * count);
  return fit;
}

// Robust spread of the rows that take part.
double spread_of(const Eigen::VectorXd& residual, const Eigen::VectorXd& part) {
  std::vector<double> values;
  for (Eigen::Index k = 0; k < residual.size(); ++k) {
    if (part[k] > 0) values.push_back(residual[k]);
  }
  return std::max(statistics::spread_about_zero(values), 1e-9);
}

// How much more whole blocks' scores scatter than independent rows would let them: 1 where rows are
// independent.
double block_inflation(const ChannelRows& rows, const Eigen::MatrixXd& x, const Eigen::VectorXd& residual,
                       const Eigen::VectorXd& part) {
  const Eigen::Index p = x.cols();
  Eigen::VectorXd naive = Eigen::VectorXd::Zero(p), clustered = naive, score = naive;
  std::size_t blocks = 0;
  for (Eigen::Index k = 0; k < x.rows(); ++k) {
    const auto at = static_cast<std::size_t>(k);
    if (part[k] > 0) {
      const Eigen::VectorXd own = residual[k] * x.row(k).transpose();
      naive += own.cwiseAbs2();
      score += own;
    }
    if (k + 1 < x.rows() && rows.block[at + 1] == rows.block[at]) continue;
    if (score.squaredNorm() > 0) ++blocks;
    clustered += score.cwiseAbs2();
    score.setZero();
  }
  if (blocks < fewest_blocks) return 1;
  double sum = 0, count = 0;
  for (Eigen::Index j = 0; j < p; ++j) {
    if (!(naive[j] > 0)) continue;
    sum += clustered[j] / naive[j];
    ++count;
  }
  const double n = static_cast<double>(blocks);
  return count > 0 ? std::max(1.0, sum / count * n / (n - 1)) : 1.0;
}

// Spread of residuals as it differs between standing and moving, and with the size of what the channel reads:
// a robot at rest is read more precisely than one on rough ground. One spread a row.
Eigen::VectorXd spreads(const ChannelRows& rows, const Eigen::VectorXd& residual,
                        const Eigen::VectorXd& part) {
  constexpr std::size_t classes = 4, fewest = 30;
  constexpr double least = 0.05;  // of the spread of all: a reading that does not move is no measure of noise
  const double all = spread_of(residual, part);
  const Eigen::Index n = residual.size();
  Eigen::VectorXd spread = Eigen::VectorXd::Constant(n, all);
  std::vector<Eigen::Index> moving, resting;
  for (Eigen::Index k = 0; k < n; ++k)
    (rows.resting[static_cast<std::size_t>(k)] ? resting : moving).push_back(k);
  std::ranges::stable_sort(moving, {}, [&](Eigen::Index k) { return std::fabs(rows.y[k] - residual[k]); });
  std::vector<std::vector<Eigen::Index>> groups{resting};
  const std::size_t many = std::clamp<std::size_t>(moving.size() / (2 * fewest), 1, classes);
  for (std::size_t g = 0; g < many; ++g) {
    groups.emplace_back(moving.begin() + static_cast<std::ptrdiff_t>(g * moving.size() / many),
                        moving.begin() + static_cast<std::ptrdiff_t>((g + 1) * moving.size() / many));
  }
  double most = 0;
  std::vector<double> found;
  for (const auto& group : groups) {
    std::vector<double> values;
    for (const Eigen::Index k : group) {
      if (part[k] > 0) values.push_back(residual[k]);
    }
    found.push_back(values.size() < fewest ? missing : statistics::spread_about_zero(values));
    if (std::isfinite(found.back())) most = std::max(most, found.back());
  }
  if (!(most > 0)) return spread;
  for (std::size_t g = 0; g < groups.size(); ++g) {
    const double s = std::max(std::isfinite(found[g]) ? found[g] : most, least * most);
    for (const Eigen::Index k : groups[g]) spread[k] = std::max(s, 1e-9);
  }
  return spread;
}

ChannelNoise learn_channel(const ChannelRows& rows, const Eigen::VectorXd& sd,
                           const std::vector<bool>& left_out) {
  ChannelNoise noise;
  const Eigen::Index n = rows.y.size();
  if (n == 0) return noise;
  Eigen::VectorXd part = Eigen::VectorXd::Ones(n);
  for (Eigen::Index k = 0; k < n && !left_out.empty(); ++k) {
    if (left_out[rows.block[static_cast<std::size_t>(k)]]) part[k] = 0;
  }
  if (part.sum() < static_cast<double>(fewest_rows)) return noise;
  const double size = std::sqrt((part.array() * rows.y.array().square()).sum() / part.sum());
  if (!(size > 0)) return noise;
  Eigen::VectorXd spread = Eigen::VectorXd::Constant(n, size), weight = part / (size * size);
  FlexibleFit fit;
  for (int pass = 0; pass < 3; ++pass) {
    fit = fit_everything(rows, weight, sd);
    // What follows a formula to the last digit was computed, or never moved: it is no measurement.
    if (spread_of(fit.residual, part) <= std::max(1e-9, 1e-6 * size)) return noise;
    spread = spreads(rows, fit.residual, part);
    for (Eigen::Index k = 0; k < n; ++k)
      weight[k] =
          part[k] * statistics::huber_weight(fit.residual[k], spread[k], outlier) / (spread[k] * spread[k]);
  }
  noise.residual = fit.residual;
  // What the fit has used up it has taken from the residuals.
  const double used = std::sqrt(part.sum() / fit.freedom);
  noise.sigma = spread_of(fit.residual, part) * used;
  Eigen::VectorXd filtered = fit.residual.cwiseQuotient(spread);
  const double scale = spread_of(filtered, part) * used;
  noise.weight.resize(n);
  for (Eigen::Index k = 0; k < n; ++k)
    noise.weight[k] = part[k] * std::sqrt(statistics::huber_weight(filtered[k], scale, outlier)) / scale;
  noise.spread = spread;
  Eigen::MatrixXd x = spread.cwiseInverse().asDiagonal() * rows.x;
  noise.inflation =
      block_inflation(rows, noise.weight.asDiagonal() * x, noise.weight.cwiseProduct(filtered), part);
  noise.weight /= std::sqrt(noise.inflation);
  return noise;
}

}  // namespace

Rows make_rows(const ColumnSet& columns, std::span<const Window> windows) {
  Rows all;
  const std::size_t p = columns.size(), cell_count = p * channel_count;
  std::vector<double> cells(at_once * cell_count);
  std::vector<ChannelValues<double>> values(at_once);
  std::array<std::vector<bool>, channel_count> speaks;
  for (auto& s : speaks) s.assign(p, false);
  for (ChannelRows& rows : all) rows.y.resize(static_cast<Eigen::Index>(windows.size()));
  for (std::size_t first = 0; first < windows.size(); first += at_once) {
    const std::size_t count = std::min(at_once, windows.size() - first);
    for (std::size_t k = 0; k < count; ++k)
      columns.evaluate(windows[first + k], values[k], std::span(cells).subspan(k * cell_count, cell_count));
    for (std::size_t c = 0; c < channel_count; ++c) {
      ChannelRows& rows = all[c];
      const auto cell = [&](std::size_t k, std::size_t j) { return cells[k * cell_count + c * p + j]; };
      // Columns that speak here for the first time were silent before.
      const Eigen::Index known = rows.x.cols();
      for (std::size_t j = 0; j < p; ++j) {
        for (std::size_t k = 0; k < count && !speaks[c][j]; ++k) {
          if (!std::isfinite(values[k][c]) || cell(k, j) == 0) continue;
          speaks[c][j] = true;
          rows.columns.push_back(j);
        }
      }
      rows.x.conservativeResize(static_cast<Eigen::Index>(windows.size()),
                                static_cast<Eigen::Index>(rows.columns.size()));
      rows.x.rightCols(rows.x.cols() - known)
          .topRows(static_cast<Eigen::Index>(rows.window.size()))
          .setZero();
      for (std::size_t k = 0; k < count; ++k) {
        if (!std::isfinite(values[k][c])) continue;
        const auto row = static_cast<Eigen::Index>(rows.window.size());
        const Window& w = windows[first + k];
        rows.y[row] = values[k][c];
        for (std::size_t j = 0; j < rows.columns.size(); ++j)
          rows.x(row, static_cast<Eigen::Index>(j)) = cell(k, rows.columns[j]);
        rows.window.push_back(first + k);
        rows.block.push_back(w.block);
        rows.resting.push_back(w.resting[0] && w.resting[1]);
      }
    }
  }
  for (ChannelRows& rows : all) {
    const auto count = static_cast<Eigen::Index>(rows.window.size());
    if (rows.window.size() < fewest_rows) {
      rows = {};
      continue;
    }
    rows.x.conservativeResize(count, Eigen::NoChange);
    rows.y.conservativeResize(count);
  }
  return all;
}

Noise learn_noise(const ColumnSet& columns, const Rows& rows, const std::vector<bool>& left_out) {
  Noise noise;
  const std::vector<double> possible = possible_sd(columns);
  for (std::size_t c = 0; c < channel_count; ++c) {
    Eigen::VectorXd sd(static_cast<Eigen::Index>(rows[c].columns.size()));
    for (std::size_t j = 0; j < rows[c].columns.size(); ++j)
      sd[static_cast<Eigen::Index>(j)] = possible[rows[c].columns[j]];
    noise[c] = learn_channel(rows[c], sd, left_out);
  }
  return noise;
}

std::vector<statistics::Information> block_information(const ColumnSet& columns, const Rows& rows,
                                                       const Noise& noise, std::size_t blocks,
                                                       const Responses* response) {
  std::vector<statistics::Information> information(
      blocks, statistics::Information(static_cast<Eigen::Index>(columns.size())));
  for (std::size_t c = 0; c < channel_count; ++c) {
    const ChannelRows& r = rows[c];
    const ChannelNoise& n = noise[c];
    if (!(n.sigma > 0) || (response != nullptr && (*response)[c].size() == 0)) continue;
    const Eigen::VectorXd by_spread = n.spread.cwiseInverse();
    Eigen::MatrixXd x = by_spread.asDiagonal() * r.x;
    Eigen::VectorXd y = by_spread.cwiseProduct(response == nullptr ? r.y : (*response)[c]);
    x = n.weight.asDiagonal() * x;
    y = n.weight.asDiagonal() * y;
    std::size_t from = 0;
    while (from < r.block.size()) {
      std::size_t to = from;
      double scale = 0;
      for (; to < r.block.size() && r.block[to] == r.block[from]; ++to) {
        const auto at = static_cast<Eigen::Index>(to);
        if (n.weight[at] > 0) scale += std::log(n.weight[at] * by_spread[at]);
      }
      const auto first = static_cast<Eigen::Index>(from), count = static_cast<Eigen::Index>(to - from);
      information[r.block[from]].add(x.middleRows(first, count), y.segment(first, count), r.columns);
      information[r.block[from]].log_scale += scale;
      from = to;
    }
  }
  return information;
}

}  // namespace joulecast::gap

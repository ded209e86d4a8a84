#include "gap/design.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "base/median.h"

namespace joulecast::gap {
namespace {

constexpr double outlier = 3.5;  // in spreads; beyond it the weight falls
constexpr std::size_t fewest_rows = 20;
constexpr std::size_t block_rows = 20;  // over which slow correlation is judged

struct Autoregression {
  double one = 0, two = 0;
};

double spread_of(const Eigen::VectorXd& e) {
  std::vector<double> size(static_cast<std::size_t>(e.size()));
  for (Eigen::Index k = 0; k < e.size(); ++k) size[static_cast<std::size_t>(k)] = std::fabs(e[k]);
  return 1.4826 * upper_median(std::move(size));
}

// y minus the best fit of everything, with every coefficient held by what is expected of it.
Eigen::VectorXd left_over(const Eigen::MatrixXd& x, const Eigen::VectorXd& y, const Eigen::VectorXd& weight,
                          const Eigen::VectorXd& prior_precision, double variance) {
  const Eigen::MatrixXd weighted = weight.asDiagonal() * x;
  Eigen::MatrixXd normal = weighted.transpose() * x / variance;
  normal.diagonal() += prior_precision;
  const Eigen::VectorXd solution = normal.ldlt().solve(weighted.transpose() * y / variance);
  return y - x * solution;
}

void whiten(ChannelDesign& d, const std::vector<bool>& continues, const Eigen::VectorXd& prior_precision,
            bool whitening) {
  const Eigen::Index n = d.y.size();
  Eigen::VectorXd weight = Eigen::VectorXd::Ones(n);
  Eigen::VectorXd e = left_over(d.x, d.y, weight, prior_precision,
                                std::max(1e-12, d.y.squaredNorm() / static_cast<double>(n)));
  double sigma = std::max(spread_of(e), 1e-9);
  for (int pass = 0; pass < 2; ++pass) {
    for (Eigen::Index k = 0; k < n; ++k)
      weight[k] = std::min(1.0, outlier * sigma / std::max(std::fabs(e[k]), 1e-300));
    e = left_over(d.x, d.y, weight, prior_precision, sigma * sigma);
    sigma = std::max(spread_of(e), 1e-9);
  }
  d.sigma = sigma;
  if (!whitening) {
    d.x /= sigma;
    d.y /= sigma;
    return;
  }
  // Yule-Walker of order two from clipped leftovers within unbroken runs.
  const auto clipped = [&](Eigen::Index k) { return std::clamp(e[k], -outlier * sigma, outlier * sigma); };
  std::array<double, 3> product{};
  std::array<std::size_t, 3> count{};
  for (Eigen::Index k = 0; k < n; ++k) {
    for (Eigen::Index lag = 0; lag <= 2 && lag <= k; ++lag) {
      bool unbroken = true;
      for (Eigen::Index q = 0; q < lag; ++q)
        unbroken = unbroken && continues[static_cast<std::size_t>(k - q)];
      if (!unbroken) break;
      product[static_cast<std::size_t>(lag)] += clipped(k) * clipped(k - lag);
      ++count[static_cast<std::size_t>(lag)];
    }
  }
  Autoregression ar;
  if (count[2] > 30) {
    const double r0 = product[0] / static_cast<double>(count[0]);
    const double r1 = product[1] / static_cast<double>(count[1]) / r0,
                 r2 = product[2] / static_cast<double>(count[2]) / r0;
    ar.one = r1 * (1 - r2) / (1 - r1 * r1);
    ar.two = (r2 - r1 * r1) / (1 - r1 * r1);
    ar.two = std::clamp(ar.two, -0.6, 0.6);
    ar.one = std::clamp(ar.one, -(0.95 - std::fabs(ar.two)), 0.95 - std::fabs(ar.two));
  }
  const Eigen::MatrixXd raw = d.x;
  const Eigen::VectorXd raw_y = d.y, raw_e = e;
  Eigen::VectorXd filtered_e = e;
  for (Eigen::Index k = 0; k < n; ++k) {
    const bool one = k >= 1 && continues[static_cast<std::size_t>(k)];
    const bool two = one && k >= 2 && continues[static_cast<std::size_t>(k - 1)];
    if (two) {
      d.x.row(k) -= ar.one * raw.row(k - 1) + ar.two * raw.row(k - 2);
      d.y[k] -= ar.one * raw_y[k - 1] + ar.two * raw_y[k - 2];
      filtered_e[k] -= ar.one * raw_e[k - 1] + ar.two * raw_e[k - 2];
    } else {
      const double shrink = std::sqrt(std::max(0.05, 1 - ar.one * ar.one - ar.two * ar.two));
      d.x.row(k) *= shrink;
      d.y[k] *= shrink;
      filtered_e[k] *= shrink;
    }
  }
  const double spread = std::max(spread_of(filtered_e), 1e-9);
  for (Eigen::Index k = 0; k < n; ++k) {
    const double w =
        std::sqrt(std::min(1.0, outlier * spread / std::max(std::fabs(filtered_e[k]), 1e-300))) / spread;
    d.x.row(k) *= w;
    d.y[k] *= w;
    filtered_e[k] *= w;
  }
  // Sums over blocks of white leftovers have the variance of their count.
  double slow = 0;
  std::size_t blocks = 0;
  for (Eigen::Index k = 0; k + static_cast<Eigen::Index>(block_rows) <= n;
       k += static_cast<Eigen::Index>(block_rows)) {
    const double sum = filtered_e.segment(k, static_cast<Eigen::Index>(block_rows)).sum();
    slow += sum * sum / static_cast<double>(block_rows);
    ++blocks;
  }
  if (blocks > 3) d.inflation = std::max(1.0, slow / static_cast<double>(blocks));
  const double factor = 1 / std::sqrt(d.inflation);
  d.x *= factor;
  d.y *= factor;
}

}  // namespace

Design make_design(const ColumnSet& columns, std::span<const Window> windows, bool whitening) {
  Design design;
  const std::size_t p = columns.size();
  std::vector<double> rows(p * channel_count);
  ChannelValues<double> values;

  // Which columns speak in which channel, from a sample of the windows.
  std::array<std::vector<bool>, channel_count> speaks;
  for (auto& s : speaks) s.assign(p, false);
  const std::size_t stride = std::max<std::size_t>(1, windows.size() / 1500);
  for (std::size_t k = 0; k < windows.size(); k += stride) {
    columns.evaluate(windows[k], values, rows);
    for (std::size_t c = 0; c < channel_count; ++c) {
      if (!std::isfinite(values[c])) continue;
      for (std::size_t j = 0; j < p; ++j) speaks[c][j] = speaks[c][j] || rows[c * p + j] != 0;
    }
  }
  std::array<std::vector<bool>, channel_count> continues;
  std::array<std::size_t, channel_count> count{};
  for (std::size_t c = 0; c < channel_count; ++c) {
    ChannelDesign& d = design.channels[c];
    for (std::size_t j = 0; j < p; ++j) {
      if (speaks[c][j]) d.columns.push_back(j);
    }
    d.x.resize(static_cast<Eigen::Index>(windows.size()), static_cast<Eigen::Index>(d.columns.size()));
    d.y.resize(static_cast<Eigen::Index>(windows.size()));
  }
  for (std::size_t k = 0; k < windows.size(); ++k) {
    columns.evaluate(windows[k], values, rows);
    design.missions = std::max(design.missions, windows[k].mission + 1);
    for (std::size_t c = 0; c < channel_count; ++c) {
      if (!std::isfinite(values[c])) continue;
      ChannelDesign& d = design.channels[c];
      const auto row = static_cast<Eigen::Index>(count[c]++);
      d.y[row] = values[c];
      for (std::size_t j = 0; j < d.columns.size(); ++j) {
        d.x(row, static_cast<Eigen::Index>(j)) = rows[c * p + d.columns[j]];
      }
      const bool spans = c == index_of(Channel::travel) || c == index_of(Channel::turn);
      continues[c].push_back(windows[k].continues && !d.window.empty() && d.window.back() + 1 == k && !spans);
      d.window.push_back(k);
      d.mission.push_back(windows[k].mission);
    }
  }
  std::vector<double> expected(p, 0.0);
  for (const Hypothesis& h : columns.hypotheses()) {
    for (const std::size_t j : h.columns) expected[j] = std::max(h.expected, columns.columns()[j].tolerance);
  }
  for (std::size_t j = 0; j < p; ++j) {
    expected[j] = std::max({expected[j], columns.columns()[j].tolerance, columns.columns()[j].scatter, 1e-9});
  }
  for (std::size_t c = 0; c < channel_count; ++c) {
    ChannelDesign& d = design.channels[c];
    d.x.conservativeResize(static_cast<Eigen::Index>(count[c]), Eigen::NoChange);
    d.y.conservativeResize(static_cast<Eigen::Index>(count[c]));
    if (count[c] < fewest_rows) {
      d = {};
      d.x.resize(0, 0);
      d.y.resize(0);
      continue;
    }
    Eigen::VectorXd precision(static_cast<Eigen::Index>(d.columns.size()));
    for (std::size_t j = 0; j < d.columns.size(); ++j) {
      precision[static_cast<Eigen::Index>(j)] = 1 / (expected[d.columns[j]] * expected[d.columns[j]]);
    }
    whiten(d, continues[c], precision, whitening);
  }
  return design;
}

Information& Information::operator+=(const Information& other) {
  if (xx.size() == 0) return *this = other;
  xx += other.xx;
  xy += other.xy;
  yy += other.yy;
  return *this;
}

Information& Information::operator*=(double factor) {
  xx *= factor;
  xy *= factor;
  yy *= factor;
  return *this;
}

std::vector<Information> mission_information(const ColumnSet& columns, const Design& design) {
  const auto p = static_cast<Eigen::Index>(columns.size());
  std::vector<Information> missions(design.missions);
  for (Information& m : missions) {
    m.xx = Eigen::MatrixXd::Zero(p, p);
    m.xy = Eigen::VectorXd::Zero(p);
  }
  for (const ChannelDesign& d : design.channels) {
    std::size_t from = 0;
    while (from < d.mission.size()) {
      std::size_t to = from;
      while (to < d.mission.size() && d.mission[to] == d.mission[from]) ++to;
      const auto x = d.x.middleRows(static_cast<Eigen::Index>(from), static_cast<Eigen::Index>(to - from));
      const auto y = d.y.segment(static_cast<Eigen::Index>(from), static_cast<Eigen::Index>(to - from));
      Eigen::MatrixXd xx = Eigen::MatrixXd::Zero(d.x.cols(), d.x.cols());
      xx.selfadjointView<Eigen::Lower>().rankUpdate(x.transpose());
      const Eigen::VectorXd xy = x.transpose() * y;
      Information& m = missions[d.mission[from]];
      for (std::size_t a = 0; a < d.columns.size(); ++a) {
        const auto ga = static_cast<Eigen::Index>(d.columns[a]);
        m.xy[ga] += xy[static_cast<Eigen::Index>(a)];
        for (std::size_t b = 0; b <= a; ++b) {
          const auto gb = static_cast<Eigen::Index>(d.columns[b]);
          const double v = xx(static_cast<Eigen::Index>(a), static_cast<Eigen::Index>(b));
          m.xx(ga, gb) += v;
          if (ga != gb) m.xx(gb, ga) += v;
        }
      }
      m.yy += y.squaredNorm();
      from = to;
    }
  }
  std::vector<Eigen::Index> own;
  for (std::size_t j = 0; j < columns.size(); ++j) {
    if (columns.columns()[j].scatter > 0) own.push_back(static_cast<Eigen::Index>(j));
  }
  const auto k = static_cast<Eigen::Index>(own.size());
  Eigen::VectorXd sd(k);
  for (Eigen::Index a = 0; a < k; ++a)
    sd[a] = columns.columns()[static_cast<std::size_t>(own[static_cast<std::size_t>(a)])].scatter;
  for (Information& m : missions) {
    // In units of their sd, S = Z'Z + 1 is well conditioned.
    const Eigen::MatrixXd cross = sd.asDiagonal() * m.xx(own, Eigen::all);
    Eigen::MatrixXd s = cross(Eigen::all, own) * sd.asDiagonal();
    s.diagonal().array() += 1.0;
    const Eigen::LLT<Eigen::MatrixXd> factor(s);
    const Eigen::VectorXd zy = sd.asDiagonal() * m.xy(own);
    const Eigen::MatrixXd solved = factor.matrixL().solve(cross);
    const Eigen::VectorXd solved_y = factor.matrixL().solve(zy);
    m.xx -= solved.transpose() * solved;
    m.xy -= solved.transpose() * solved_y;
    m.yy -= solved_y.squaredNorm();
  }
  return missions;
}

}  // namespace joulecast::gap

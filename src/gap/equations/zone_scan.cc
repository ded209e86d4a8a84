#include "gap/equations/zone_scan.h"

#include <algorithm>
#include <cmath>

namespace joulecast::gap {
namespace {

constexpr double smallest_share = 0.02, largest_share = 0.85;  // of the rows that a zone may hold

struct ZoneRow {
  double x_m, y_m, square, product;
  Eigen::Index index;
};

// Scores of discs on the whitened rows.
class Scanner {
 public:
  Scanner(const ColumnSet& columns, const Rows& rows, const Noise& noise, std::span<const Window> windows,
          const Hypothesis& zone) {
    const std::size_t column = zone.candidate.columns[0];
    const auto p = static_cast<Eigen::Index>(columns.size());
    Eigen::VectorXd sd = Eigen::VectorXd::Zero(p);
    for (std::size_t k = 0; k < columns.size(); ++k)
      sd[static_cast<Eigen::Index>(k)] =
          std::hypot(columns.columns()[k].tolerance, columns.columns()[k].scatter);
    for (const Hypothesis& h : columns.hypotheses()) {
      if (h.outside()) continue;
      for (const std::size_t k : h.candidate.columns) sd[static_cast<Eigen::Index>(k)] = h.candidate.expected;
    }
    sd[static_cast<Eigen::Index>(column)] = 0;
    statistics::Information total(p);
    Eigen::Index count = 0;
    std::array<Eigen::MatrixXd, channel_count> wide;
    std::array<Eigen::VectorXd, channel_count> y, own;
    for (std::size_t c = 0; c < channel_count; ++c) {
      const ChannelRows& r = rows[c];
      const auto local = std::ranges::find(r.columns, column);
      if (!(noise[c].sigma > 0) || local == r.columns.end()) continue;
      const Eigen::VectorXd by_spread = noise[c].spread.cwiseInverse();
      Eigen::MatrixXd x = by_spread.asDiagonal() * r.x;
      y[c] = by_spread.cwiseProduct(r.y);
      x = noise[c].weight.asDiagonal() * x;
      y[c] = noise[c].weight.asDiagonal() * y[c];
      own[c] = x.col(local - r.columns.begin());
      wide[c] = Eigen::MatrixXd::Zero(x.rows(), p);
      for (std::size_t a = 0; a < r.columns.size(); ++a) {
        const auto g = static_cast<Eigen::Index>(r.columns[a]);
        wide[c].col(g) = x.col(static_cast<Eigen::Index>(a)) * sd[g];
      }
      total.add(wide[c], y[c]);
      count += x.rows();
    }
    total.xx.diagonal().array() += 1.0;
    const Eigen::LLT<Eigen::MatrixXd> factor(total.xx);
    const Eigen::VectorXd solution = factor.solve(total.xy);
    prior_precision_ = 1 / std::pow(zone.candidate.expected, 2);
    cross_.resize(p, count);
    Eigen::Index at = 0;
    for (std::size_t c = 0; c < channel_count; ++c) {
      for (Eigen::Index k = 0; k < own[c].size(); ++k) {
        const Window& w = windows[rows[c].window[static_cast<std::size_t>(k)]];
        const double x = own[c][k];
        if (!std::isfinite(w.x_m + w.y_m) || x == 0) continue;
        rows_.push_back({w.x_m, w.y_m, x * x, x * (y[c][k] - wide[c].row(k).dot(solution)), at});
        cross_.col(at++) = x * wide[c].row(k).transpose();
      }
    }
    cross_.conservativeResize(Eigen::NoChange, at);
    factor.matrixL().solveInPlace(cross_);
  }

  std::size_t rows() const { return rows_.size(); }

  // Half the drop of the sum of squares that a disc's coefficient brings; 0 where it would be negative.
  double score(double product, double square, const Eigen::VectorXd& cross) const {
    const double free = square - cross.squaredNorm() + prior_precision_;
    return product > 0 && free > 0 ? 0.5 * product * product / free : 0.0;
  }

  double score(const Zone& zone) const {
    double product = 0, square = 0;
    std::size_t count = 0;
    Eigen::VectorXd cross = Eigen::VectorXd::Zero(cross_.rows());
    for (const ZoneRow& r : rows_) {
      if (std::hypot(r.x_m - zone.x_m, r.y_m - zone.y_m) > zone.radius_m) continue;
      product += r.product;
      square += r.square;
      cross += cross_.col(r.index);
      ++count;
    }
    return plausible(count) ? score(product, square, cross) : 0.0;
  }

  Zone best_on_grid(const Ranges& ranges) const {
    const double extent = std::max(ranges.x_high_m - ranges.x_low_m, ranges.y_high_m - ranges.y_low_m);
    const double step = std::max(0.3, extent / 26), cell = 0.5 * step;
    const auto columns = static_cast<std::size_t>((ranges.x_high_m - ranges.x_low_m) / cell) + 1;
    const auto lines = static_cast<std::size_t>((ranges.y_high_m - ranges.y_low_m) / cell) + 1;
    struct Cell {
      double product = 0, square = 0;
      std::size_t count = 0;
      Eigen::VectorXd cross;
    };
    std::vector<Cell> cells(columns * lines);
    for (const ZoneRow& r : rows_) {
      const auto i = std::min(columns - 1, static_cast<std::size_t>((r.x_m - ranges.x_low_m) / cell));
      const auto j = std::min(lines - 1, static_cast<std::size_t>((r.y_m - ranges.y_low_m) / cell));
      Cell& c = cells[j * columns + i];
      c.product += r.product;
      c.square += r.square;
      if (c.count++ == 0) c.cross = Eigen::VectorXd::Zero(cross_.rows());
      c.cross += cross_.col(r.index);
    }
    Zone best;
    double best_score = 0;
    for (double radius = 2 * step; radius < 0.6 * extent + step; radius += step) {
      for (double x = ranges.x_low_m - step; x <= ranges.x_high_m + step; x += step) {
        for (double y = ranges.y_low_m - step; y <= ranges.y_high_m + step; y += step) {
          double product = 0, square = 0;
          std::size_t count = 0;
          const auto inside = [&](auto&& act) {
            for (std::size_t j = 0; j < lines; ++j) {
              const double dy = ranges.y_low_m + (static_cast<double>(j) + 0.5) * cell - y;
              if (std::fabs(dy) > radius) continue;
              for (std::size_t i = 0; i < columns; ++i) {
                const double dx = ranges.x_low_m + (static_cast<double>(i) + 0.5) * cell - x;
                const Cell& c = cells[j * columns + i];
                if (c.count > 0 && dx * dx + dy * dy <= radius * radius) act(c);
              }
            }
          };
          inside([&](const Cell& c) {
            product += c.product;
            square += c.square;
            count += c.count;
          });
          // Without what others share with it the disc cannot beat the best: spare the vectors.
          if (product <= 0 || !plausible(count)) continue;
          Eigen::VectorXd cross = Eigen::VectorXd::Zero(cross_.rows());
          inside([&](const Cell& c) { cross += c.cross; });
          const double s = score(product, square, cross);
          if (s > best_score) {
            best_score = s;
            best = {x, y, radius};
          }
        }
      }
    }
    return best;
  }

 private:
  bool plausible(std::size_t count) const {
    const double share = static_cast<double>(count) / static_cast<double>(rows_.size());
    return share > smallest_share && share < largest_share;
  }

  std::vector<ZoneRow> rows_;
  Eigen::MatrixXd cross_;  // by row: L^-1 of its products with all other columns
  double prior_precision_ = 0;
};

}  // namespace

std::optional<Zone> find_zone(const ColumnSet& columns, const Rows& rows, const Noise& noise,
                              std::span<const Window> windows) {
  const auto zone =
      std::ranges::find_if(columns.hypotheses(), [](const Hypothesis& h) { return h.id() == zone_effect; });
  if (zone == columns.hypotheses().end()) return std::nullopt;
  const Scanner scanner(columns, rows, noise, windows, *zone);
  if (scanner.rows() < 50) return std::nullopt;
  Zone best = scanner.best_on_grid(columns.ranges());
  if (best.radius_m <= 0) return std::nullopt;
  double score = scanner.score(best);
  for (double step = 0.3 * best.radius_m; step > 0.015 * best.radius_m;) {
    bool better = false;
    for (const auto& [dx, dy, dr] : {std::array{1.0, 0.0, 0.0},
                                     {-1.0, 0.0, 0.0},
                                     {0.0, 1.0, 0.0},
                                     {0.0, -1.0, 0.0},
                                     {0.0, 0.0, 1.0},
                                     {0.0, 0.0, -1.0}}) {
      const Zone next{best.x_m + step * dx, best.y_m + step * dy, best.radius_m + step * dr};
      if (next.radius_m <= 0.1) continue;
      const double s = scanner.score(next);
      if (s > score) {
        score = s;
        best = next;
        better = true;
      }
    }
    if (!better) step *= 0.5;
  }
  return best;
}

bool is_zone(const Cause& cause) {
  return !cause.by && cause.effect.effect->info().id == zone_effect;
}

}  // namespace joulecast::gap

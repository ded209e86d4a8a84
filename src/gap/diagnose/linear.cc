#include "gap/diagnose/linear.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <optional>

namespace joulecast::gap {
namespace {

// How well a robot keeps to its file, as a factor on tolerances and scatter, and how far formulas are off, as
// a part of the mean power. Both are averaged over; the factor is taken to lie near one.
constexpr std::array keeping{0.5, 1.0, 2.0};
constexpr std::array formulas{0.0, 0.001, 0.003};

// About zero, without sign; 0 where one of them is nothing.
double correlation(const Eigen::VectorXd& a, const Eigen::VectorXd& b) {
  const double size = a.norm() * b.norm();
  return a.size() == b.size() && size > 0 ? std::fabs(a.dot(b)) / size : 0;
}

// Mean change that hypotheses make, of each channel and of the power.
class Moved {
 public:
  Moved(const ColumnSet& columns, const Rows& rows) : columns_(columns.columns()) {
    constexpr Eigen::Index most = 400;
    for (std::size_t channel = 0; channel < channel_count; ++channel) {
      const ChannelRows& r = rows[channel];
      if (r.y.size() == 0) continue;
      Sampled sampled;
      sampled.level = channel == index_of(Channel::battery_voltage) || channel == index_of(Channel::gyro);
      sampled.place.assign(columns.size(), -1);
      for (std::size_t k = 0; k < r.columns.size(); ++k)
        sampled.place[r.columns[k]] = static_cast<Eigen::Index>(k);
      const Eigen::Index stride = std::max<Eigen::Index>(1, r.y.size() / most);
      sampled.x = r.x(Eigen::seq(0, r.y.size() - 1, stride), Eigen::all);
      sampled.size = std::max(r.y(Eigen::seq(0, r.y.size() - 1, stride)).cwiseAbs().mean(), 1e-12);
      channels_.push_back(std::move(sampled));
    }
  }

  double operator()(const Hypothesis& h, const Eigen::VectorXd& coefficients) const {
    const auto& own = h.candidate.columns;
    if (h.outside()) {
      // Of a pair of channels the right-hand one stands for both.
      for (const Sampled& c : channels_) {
        if (const Eigen::VectorXd moved = c.moved(own, coefficients); moved.size() > 0)
          return moved.cwiseAbs().mean() * columns_[own.front()].power_share;
      }
      return 0;
    }
    double square = 0;
    for (std::size_t k = 0; k < own.size(); ++k) {
      const double share = std::max(columns_[own[k]].power_share, columns_[own[k]].motor_share);
      square += std::pow(coefficients[static_cast<Eigen::Index>(k)] * share, 2);
    }
    return std::sqrt(square);
  }

  double likeness(const Hypothesis& a, const Hypothesis& b) const {
    std::optional<double> least;
    for (const Sampled& c : channels_) {
      const Eigen::VectorXd of_a = c.moved_by(a), of_b = c.moved_by(b);
      if (of_a.size() > 0 || of_b.size() > 0) least = std::min(least.value_or(1), correlation(of_a, of_b));
    }
    return least.value_or(0);
  }

  // The largest ratio, over channels in which they matter, of what members move one by one to what they move
  // together.
  double cancelling(const std::vector<Hypothesis>& hypotheses, const HypothesisSet& set,
                    const Eigen::VectorXd& coefficients) const {
    constexpr double matters = 0.1;  // of what the channel's response is
    double most = 1;
    for (const Sampled& c : channels_) {
      double apart = 0;
      Eigen::VectorXd together = Eigen::VectorXd::Zero(c.x.rows());
      Eigen::Index at = 0;
      for (const std::size_t h : set) {
        const auto& own = hypotheses[h].candidate.columns;
        const auto n = static_cast<Eigen::Index>(own.size());
        if (const Eigen::VectorXd moved = c.moved(own, coefficients.segment(at, n)); moved.size() > 0) {
          apart += moved.cwiseAbs().mean();
          together += moved;
        }
        at += n;
      }
      if (apart > matters * c.size)
        most = std::max(most, apart / std::max(together.cwiseAbs().mean(), 1e-12));
    }
    return most;
  }

 private:
  struct Sampled {
    Eigen::MatrixXd x;
    double size = 1;                  // mean |response|
    bool level = false;               // a constant in it is a nuisance
    std::vector<Eigen::Index> place;  // of each column, -1: does not speak here

    Eigen::VectorXd moved(const std::vector<std::size_t>& columns,
                          const Eigen::VectorXd& coefficients) const {
      const bool speaks = std::ranges::any_of(columns, [&](std::size_t k) { return place[k] >= 0; });
      Eigen::VectorXd sum = Eigen::VectorXd::Zero(speaks ? x.rows() : 0);
      for (std::size_t k = 0; k < columns.size(); ++k) {
        if (const Eigen::Index at = place[columns[k]]; at >= 0)
          sum += coefficients[static_cast<Eigen::Index>(k)] * x.col(at);
      }
      return sum;
    }
    // What says something of it; empty where nothing does.
    Eigen::VectorXd moved_by(const Hypothesis& h) const {
      constexpr double nothing = 1e-6;
      const auto n = static_cast<Eigen::Index>(h.candidate.columns.size());
      Eigen::VectorXd own = moved(h.candidate.columns, Eigen::VectorXd::Ones(n));
      const double whole = own.norm();
      if (level && own.size() > 0) own.array() -= own.mean();
      return own.norm() > nothing * whole ? own : Eigen::VectorXd();
    }
  };
  std::vector<Column> columns_;
  std::vector<Sampled> channels_;
};

}  // namespace

std::vector<Window> thinned(std::span<const Window> windows) {
  constexpr std::size_t enough = 1600, stretch = 40;
  const std::size_t every = (windows.size() + enough - 1) / enough;
  std::vector<Window> some;
  for (std::size_t k = 0; k < windows.size(); ++k) {
    if (k / stretch % every != 0) continue;
    some.push_back(windows[k]);
    if (k % stretch == 0) some.back().continues = false;
  }
  return some;
}

namespace {

Linear columns_around(const Material& m, const Shapes& shapes, std::span<const double> shares,
                      std::span<const Cause> around) {
  Linear linear;
  linear.columns = std::make_unique<ColumnSet>(m, shapes, shares);
  for (const Cause& cause : around) {
    if (auto c = linear.columns->coordinates_of(cause)) linear.around.push_back(std::move(*c));
  }
  if (!linear.around.empty()) linear.columns->linearise_around(linear.around);
  return linear;
}

}  // namespace

Linear linearise(const Material& m, const Shapes& shapes, std::span<const double> shares,
                 std::span<const Cause> around) {
  Linear linear = columns_around(m, shapes, shares, around);
  linear.rows = make_rows(*linear.columns, m.windows);
  linear.noise = learn_noise(*linear.columns, linear.rows);
  return linear;
}

Linear linearise(const Material& m, const Shapes& shapes, std::span<const double> shares,
                 std::span<const Cause> around, std::span<const std::string_view> effects, Noise noise) {
  Linear linear = columns_around(m, shapes, shares, around);
  linear.columns->differentiate_only(effects);
  linear.rows = make_rows(*linear.columns, m.windows);
  linear.noise = std::move(noise);
  return linear;
}

Problem make_problem(const ColumnSet& columns, const Rows& rows, const Noise& noise, std::size_t blocks,
                     const Responses* response) {
  Problem problem;
  problem.hypotheses = columns.hypotheses();
  const auto moved = std::make_shared<const Moved>(columns, rows);
  problem.moved = [moved](const Hypothesis& h, const Eigen::VectorXd& c) { return (*moved)(h, c); };
  problem.cancelling = [moved, &columns](const HypothesisSet& set, const Eigen::VectorXd& c) {
    return moved->cancelling(columns.hypotheses(), set, c);
  };
  problem.likeness = [moved](const Hypothesis& a, const Hypothesis& b) { return moved->likeness(a, b); };
  const auto plain = block_information(columns, rows, noise, blocks, response);
  const auto p = static_cast<Eigen::Index>(columns.size());
  Eigen::VectorXd tolerance(p), scatter(p), discrepancy(p);
  for (Eigen::Index k = 0; k < p; ++k) {
    const Column& c = columns.columns()[static_cast<std::size_t>(k)];
    tolerance[k] = c.tolerance;
    scatter[k] = c.scatter;
    discrepancy[k] = c.discrepancy;
  }
  for (const double factor : keeping) {
    problem.blocks.push_back(plain);
    for (statistics::Information& block : problem.blocks.back()) block.integrate_out(factor * scatter);
    if (factor == 1) {
      problem.plain.tolerance = tolerance;
      problem.plain.noise = problem.blocks.size() - 1;
    }
    for (const double off : formulas) {
      Circumstances c;
      c.log_prior = -0.5 * std::pow(std::log2(factor), 2);
      c.tolerance = ((factor * tolerance).array().square() + (off * discrepancy).array().square()).sqrt();
      c.noise = problem.blocks.size() - 1;
      problem.circumstances.push_back(std::move(c));
    }
  }
  for (const Hypothesis& h : problem.hypotheses) {
    for (const std::size_t k : h.candidate.columns) problem.plain.tolerance[static_cast<Eigen::Index>(k)] = 0;
  }
  return problem;
}

double misfit(const Linear& linear, const Noise& noise) {
  double sum = 0;
  for (std::size_t c = 0; c < channel_count; ++c) {
    const ChannelRows& rows = linear.rows[c];
    if (!(noise[c].sigma > 0) || rows.y.size() == 0) continue;
    Eigen::VectorXd residual = rows.y;
    for (const Chosen& chosen : linear.around) {
      const auto& own = linear.columns->hypotheses()[chosen.hypothesis].candidate.columns;
      for (std::size_t k = 0; k < own.size(); ++k) {
        const auto local = std::ranges::find(rows.columns, own[k]);
        if (local != rows.columns.end())
          residual -= chosen.coefficients[k] * rows.x.col(local - rows.columns.begin());
      }
    }
    sum += residual.cwiseAbs().sum() / noise[c].sigma;
  }
  return sum;
}

std::vector<Cause> half_way(std::span<const Cause> from, std::vector<Cause> to) {
  const auto halve = [](Cause& cause, const dynamics::EffectValues<double>& other) {
    const auto& parameters = cause.effect.effect->info().parameters;
    for (std::size_t k = 0; k < parameters.size(); ++k) {
      if (k == 0 || parameters[k].strength)
        cause.effect.values[k] = 0.5 * (cause.effect.values[k] + other[k]);
    }
  };
  const auto find = [](auto& among, const Cause& cause) {
    return std::ranges::find_if(among, [&](const Cause& other) { return other.same_kind(cause); });
  };
  const std::size_t named = to.size();
  for (const Cause& cause : from) {
    if (find(to, cause) != to.end()) continue;
    to.push_back(cause);
    halve(to.back(), {});
  }
  for (std::size_t k = 0; k < named; ++k) {
    const auto before = find(from, to[k]);
    halve(to[k], before == from.end() ? dynamics::EffectValues<double>{} : before->effect.values);
  }
  return to;
}

}  // namespace joulecast::gap

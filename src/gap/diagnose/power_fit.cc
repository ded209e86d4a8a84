#include "gap/diagnose/power_fit.h"

#include <algorithm>
#include <cmath>

#include "gap/traits.h"
#include "statistics/regression.h"
#include "statistics/robust.h"

namespace joulecast::gap {

bool power_speaks_alone(const Equations& e) {
  return e.columns.from_motion().alone() && e.rows[index_of(Channel::power)].y.size() > 0;
}

std::vector<std::size_t> columns_of(std::span<const Hypothesis> hypotheses, const HypothesisSet& set) {
  std::vector<std::size_t> columns;
  for (const std::size_t h : set) {
    const auto& own = hypotheses[h].candidate.columns;
    columns.insert(columns.end(), own.begin(), own.end());
  }
  return columns;
}

std::vector<Eigen::Index> places_of(const ChannelRows& r, std::span<const std::size_t> columns) {
  std::vector<Eigen::Index> places;
  for (const std::size_t k : columns) {
    const auto at = std::ranges::find(r.columns, k);
    places.push_back(at == r.columns.end() ? -1 : at - r.columns.begin());
  }
  return places;
}

bool shown_elsewhere(const Equations& e, const Hypothesis& hypothesis) {
  for (std::size_t c = 0; c < channel_count; ++c) {
    if (c == index_of(Channel::power) || !(e.noise[c].sigma > 0)) continue;
    if (std::ranges::any_of(places_of(e.rows[c], hypothesis.candidate.columns),
                            [](Eigen::Index k) { return k >= 0; }))
      return true;
  }
  return false;
}

Eigen::VectorXd moved_power(const Equations& e, const HypothesisSet& set,
                            const Eigen::VectorXd& coefficients) {
  const ChannelRows& r = e.rows[index_of(Channel::power)];
  const std::vector<Eigen::Index> places = places_of(r, columns_of(e.columns.hypotheses(), set));
  Eigen::VectorXd moved = Eigen::VectorXd::Zero(r.y.size());
  for (std::size_t k = 0; k < places.size(); ++k) {
    if (places[k] >= 0) moved += coefficients[static_cast<Eigen::Index>(k)] * r.x.col(places[k]);
  }
  return moved;
}

Eigen::VectorXd fitted_to_power(const Equations& e, const HypothesisSet& set, const Eigen::VectorXd& start) {
  constexpr int rounds = 12;
  const ChannelRows& r = e.rows[index_of(Channel::power)];
  const std::vector<std::size_t> columns = columns_of(e.columns.hypotheses(), set);
  std::vector<Eigen::Index> free;  // of the set's coefficients
  std::vector<const statistics::Candidate*> of;
  for (const std::size_t h : set) {
    const Hypothesis& hypothesis = e.columns.hypotheses()[h];
    const bool elsewhere =
        hypothesis.is_effect() && traits_of(hypothesis.id()).elsewhere && shown_elsewhere(e, hypothesis);
    for (std::size_t k = 0; k < hypothesis.candidate.columns.size(); ++k) {
      if (!elsewhere) free.push_back(static_cast<Eigen::Index>(of.size()));
      of.push_back(&hypothesis.candidate);
    }
  }
  const std::vector<Eigen::Index> places = places_of(r, columns);
  std::erase_if(free, [&](Eigen::Index k) { return places[static_cast<std::size_t>(k)] < 0; });
  std::vector<Eigen::Index> rows;
  for (std::size_t k = 0; k < r.block.size(); ++k) {
    if (!e.leaves_out(r.block[k])) rows.push_back(static_cast<Eigen::Index>(k));
  }
  if (free.empty() || rows.empty()) return start;
  Eigen::VectorXd fixed = start;
  for (const Eigen::Index k : free) fixed[k] = 0;
  const Eigen::VectorXd y = (r.y - moved_power(e, set, fixed))(rows);
  Eigen::MatrixXd x(y.size(), static_cast<Eigen::Index>(free.size()));
  Eigen::VectorXd hold(x.cols()), c(x.cols());
  for (std::size_t k = 0; k < free.size(); ++k) {
    const auto here = static_cast<Eigen::Index>(k);
    x.col(here) = r.x(rows, places[static_cast<std::size_t>(free[k])]);
    hold[here] = 1 / std::pow(of[static_cast<std::size_t>(free[k])]->expected, 2);
    c[here] = start[free[k]];
  }
  const Eigen::VectorXd before = c;
  const double inflation = e.noise[index_of(Channel::power)].inflation;
  for (int round = 0; round < rounds; ++round) {
    const Eigen::VectorXd left = y - x * c;
    const double spread = statistics::spread_about_zero({left.data(), static_cast<std::size_t>(left.size())});
    if (!(spread > 0)) break;
    const Eigen::VectorXd weight = statistics::huber_weights(left, spread) / (spread * spread * inflation);
    const Eigen::MatrixXd weighted = weight.asDiagonal() * x;
    const Eigen::MatrixXd information = weighted.transpose() * x + Eigen::MatrixXd(hold.asDiagonal());
    c = information.ldlt().solve(weighted.transpose() * y);
    for (std::size_t k = 0; k < free.size(); ++k) {
      const statistics::Candidate& candidate = *of[static_cast<std::size_t>(free[k])];
      double& value = c[static_cast<Eigen::Index>(k)];
      value = std::clamp(value, candidate.least, candidate.most);
    }
  }
  if (!((y - x * c).cwiseAbs().sum() < (y - x * before).cwiseAbs().sum())) return start;
  Eigen::VectorXd all = start;
  for (std::size_t k = 0; k < free.size(); ++k) all[free[k]] = c[static_cast<Eigen::Index>(k)];
  return all;
}

}  // namespace joulecast::gap

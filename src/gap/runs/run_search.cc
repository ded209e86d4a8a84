#include "gap/runs/run_search.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <numeric>
#include <random>
#include <set>

#include "gap/diagnose/naming.h"
#include "gap/diagnose/power_fit.h"

namespace joulecast::gap {
namespace {

constexpr int most_refits = 8;
constexpr double search_tolerance = 0.005;  // relative change of the strengths

ExplainSettings settings_for(std::size_t runs) {
  ExplainSettings settings;
  settings.most_members = std::min<std::size_t>(3, runs / 4 + 1);
  settings.most_families = 1;
  return settings;
}

std::vector<bool> blocks_left_out(std::span<const std::size_t> block, const std::vector<bool>& left_out) {
  if (left_out.empty()) return {};
  std::vector<bool> out(1 + *std::ranges::max_element(block), false);
  for (std::size_t k = 0; k < block.size(); ++k) out[block[k]] = out[block[k]] || left_out[k];
  return out;
}

Eigen::VectorXd strengths_of(const Problem& problem, const HypothesisSet& set,
                             const std::vector<bool>& left_out) {
  std::vector<std::size_t> own = columns_of(problem.hypotheses, set);
  std::ranges::sort(own);
  return set.empty() ? Eigen::VectorXd() : Mixture(problem, left_out, own).estimate(set).mean;
}

// The strengths of a set, fitted again around themselves: energies are linear in them only nearby.
std::vector<Cause> refit(const RunColumns& columns, const RunScatter& scatter,
                         std::span<const std::size_t> block, const HypothesisSet& set,
                         Eigen::VectorXd strengths, const std::vector<bool>& out) {
  if (set.empty()) return {};
  RunColumns around = columns;
  for (int round = 0; round < most_refits; ++round) {
    const Eigen::VectorXd before = strengths;
    around.linearise_around(columns.causes_of(set, strengths), set);
    strengths = strengths_of(make_problem(around, scatter, block), set, out);
    if ((strengths - before).norm() <= search_tolerance * before.norm()) break;
  }
  return columns.causes_of(set, strengths);
}

}  // namespace

RunFinding search_runs(const RunColumns& columns, std::span<const std::size_t> block,
                       const std::vector<bool>& left_out) {
  RunFinding f{learn_scatter(columns, left_out), {}, {}, {}, {}};
  const std::vector<bool> out = blocks_left_out(block, left_out);
  const auto runs =
      left_out.empty() ? block.size() : static_cast<std::size_t>(std::ranges::count(left_out, false));
  f.problem = make_problem(columns, f.scatter, block);
  f.explanation = explain(f.problem, out, settings_for(runs));
  f.named = likely_causes(f.problem, f.explanation);
  const auto error_with = [&](const HypothesisSet& set) {
    return columns.error(columns.causes_of(set, strengths_of(f.problem, set, out)), left_out);
  };
  const double least = least_necessary_part * columns.error({}, left_out);
  while (f.named.size() > 1) {
    const double all = error_with(f.named);
    double opened = least;
    std::size_t spare = 0;
    for (const std::size_t h : f.named) {
      HypothesisSet others = f.named;
      std::erase(others, h);
      if (const double o = error_with(others) - all; o < opened) opened = o, spare = h;
    }
    if (!(opened < least)) break;
    std::erase(f.named, spare);
  }
  f.causes = refit(columns, f.scatter, block, f.named, strengths_of(f.problem, f.named, out), out);
  return f;
}

std::optional<std::vector<Controls>> control_runs(const RunColumns& columns,
                                                  std::span<const std::size_t> block, const RunFinding& f,
                                                  std::size_t surrogates,
                                                  const std::function<bool(double)>& goes_on) {
  const auto& rows = columns.rows();
  const auto members = f.explanation.members.size();
  std::vector<Controls> controls(members, Controls{surrogates, 0});
  if (members == 0) return controls;
  // In J, as everything is predicted, by hypothesis of the whole set, and what is left, relative to the
  // scatter.
  const HypothesisSet& whole = f.explanation.whole;
  const Eigen::VectorXd coefficients = Mixture(f.problem).estimate(whole).mean;
  const auto n = static_cast<Eigen::Index>(rows.size());
  Eigen::MatrixXd part = Eigen::MatrixXd::Zero(n, static_cast<Eigen::Index>(whole.size()));
  Eigen::VectorXd left(n);
  const auto scale_of = [&](const RunRow& row) {
    return f.scatter.size_j[static_cast<Eigen::Index>(row.run)] *
           (row.difference ? f.scatter.difference : f.scatter.run);
  };
  for (Eigen::Index k = 0; k < n; ++k) {
    const RunRow& row = rows[static_cast<std::size_t>(k)];
    Eigen::Index at = 0;
    for (std::size_t m = 0; m < whole.size(); ++m) {
      for (const std::size_t c : f.problem.hypotheses[whole[m]].candidate.columns) {
        const double unit = columns.relative(c) ? f.scatter.size_j[static_cast<Eigen::Index>(row.run)] : 1;
        part(k, static_cast<Eigen::Index>(m)) +=
            coefficients[at++] * unit * row.x[static_cast<Eigen::Index>(c)];
      }
    }
    left[k] = (row.y - part.row(k).sum()) / scale_of(row);
  }
  std::vector<std::array<Eigen::Index, 2>> rows_of(columns.runs().size(), {-1, -1});
  for (Eigen::Index k = 0; k < n; ++k) {
    const RunRow& row = rows[static_cast<std::size_t>(k)];
    rows_of[row.run][row.difference ? 1 : 0] = k;
  }
  for (std::size_t m = 0; m < members; ++m) {
    const Member& member = f.explanation.members[m];
    const std::set<std::string> group = stated_ids(f.problem, member);
    const auto own = std::ranges::find(whole, member.hypothesis) - whole.begin();
    for (std::size_t s = 0; s < surrogates; ++s) {
      std::mt19937_64 random(s + 1);
      std::vector<std::size_t> from(columns.runs().size());
      std::iota(from.begin(), from.end(), 0u);
      std::ranges::shuffle(from, random);
      Eigen::VectorXd response = part.rowwise().sum() - part.col(own);
      for (Eigen::Index k = 0; k < n; ++k) {
        const RunRow& row = rows[static_cast<std::size_t>(k)];
        const Eigen::Index source = rows_of[from[row.run]][row.difference ? 1 : 0];
        response[k] += scale_of(row) * (source < 0 ? left[k] : left[source]);
      }
      const Problem surrogate = make_problem(columns, f.scatter, block, &response);
      const Explanation answer = explain(surrogate, {}, settings_for(columns.runs().size()));
      controls[m].named_in += finds(answer, surrogate, group) ? 1 : 0;
      if (!goes_on(static_cast<double>(m * surrogates + s + 1) / static_cast<double>(members * surrogates)))
        return std::nullopt;
    }
  }
  return controls;
}

}  // namespace joulecast::gap

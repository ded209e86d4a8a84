#include "gap/posterior/hold_out.h"

#include <algorithm>
#include <cmath>
#include <map>

#include "statistics/bootstrap.h"
#include "statistics/regression.h"

namespace joulecast::gap::posterior {
namespace {

constexpr double least_weight = 1e-3;  // of a model in a prediction, of the likeliest
constexpr double least_tested_rows = 0.25, least_trained_rows = 1.5;  // of the rows that a channel needs
constexpr std::size_t fewest_neighbours = 20;

// Coefficients of all columns for the prediction, from the posterior without some blocks.
struct Predictors {
  Eigen::VectorXd effects;  // models without a function
  Eigen::VectorXd all;      // every model
  // Of each requested effect: its model, its set without it, and the calibration alone.
  std::vector<std::array<Eigen::VectorXd, 3>> of_effect;
};

Predictors predictors(const Fit& fit, std::span<const double> weights, std::span<const Found> effects,
                      bool with_functions) {
  const Equations& e = fit.equations;
  const Reduced reduced = reduce(e, fit.grams, weights)[fit.factor];
  const View view(*fit.prior, reduced);
  std::vector<SetEvidence> strengths;
  const Eigen::VectorXd log_joint = log_posteriors(view, reduced, fit.models, &strengths);
  const Information blocks = weighted_sum(fit.grams.of_factor[fit.factor], weights);
  const Eigen::Index n = ix(e.effects + e.functions);
  const auto with_calibration = [&](const Eigen::VectorXd& of, const Eigen::VectorXd& own) {
    Eigen::VectorXd v = calibration(e, blocks, tolerance_factors[fit.factor], of);
    v.head(n) += own;
    return v;
  };
  const auto mean = [&](const auto& admits) {
    double most = -std::numeric_limits<double>::infinity(), total = 0;
    for (std::size_t k = 0; k < fit.models.size(); ++k)
      if (admits(fit.models[k])) most = std::max(most, log_joint[ix(k)]);
    Eigen::VectorXd own = Eigen::VectorXd::Zero(n);
    for (std::size_t k = 0; k < fit.models.size(); ++k) {
      const Model& m = fit.models[k];
      const double weight = admits(m) ? std::exp(log_joint[ix(k)] - most) : 0;
      if (weight < least_weight) continue;
      own += weight * view.coefficients(m.set, strengths[k].mean, m.configuration);
      total += weight;
    }
    own /= total;
    Eigen::VectorXd v = with_calibration(own, own);
    v.head(ix(e.effects)) = bounded(fit.catalogue, v.head(ix(e.effects)));
    return v;
  };
  const auto of_set = [&](const std::vector<std::size_t>& set, std::optional<std::size_t> configuration) {
    const SetEvidence s = view.evidence(set, configuration, slab_shares);
    return view.coefficients(set, s.mean, configuration);
  };
  Predictors out;
  out.effects = mean([](const Model& m) { return !m.configuration; });
  out.effects.segment(ix(e.effects), ix(e.functions)).setZero();  // nor the tolerances of functions
  out.all = with_functions ? mean([](const Model&) { return true; }) : out.effects;
  for (const Found& found : effects) {
    Model m = fit.models[found.model];
    const Eigen::VectorXd own = of_set(m.set, m.configuration);
    m.set.erase(m.set.begin() + static_cast<std::ptrdiff_t>(found.member));
    // The calibration is kept: tolerances of all columns together would explain any gap.
    out.of_effect.push_back({with_calibration(own, own),
                             with_calibration(own, of_set(m.set, m.configuration)),
                             with_calibration(own, Eigen::VectorXd::Zero(n))});
  }
  return out;
}

// Errors in one channel, summed over the rows left out so far.
struct Errors {
  double file = 0, effects = 0, all = 0, rows = 0;
  // As of Predictors: sum of |residual|, and that in spreads.
  std::vector<std::array<std::array<double, 2>, 3>> of_effect;
  Eigen::VectorXd left;         // residual of each row; NaN until it was left out
  std::vector<double> removed;  // of each fold, in the channel's unit
};

// Removes nuisances that differ from block to block from the rows of one channel: a held-out block has its
// own.
class Levels {
 public:
  Levels(const Equations& e, const ChannelRows& rows, const std::vector<Eigen::Index>& tested) {
    std::vector<Eigen::Index> columns;
    for (std::size_t k = 0; k < rows.columns.size(); ++k) {
      const Column& column = e.columns[ux(rows.columns[k])];
      if (column.unit == 0 && column.scatter > 0) columns.push_back(ix(k));
    }
    if (columns.empty()) return;
    std::map<std::size_t, std::vector<Eigen::Index>> blocks;
    for (std::size_t k = 0; k < tested.size(); ++k) blocks[rows.block[ux(tested[k])]].push_back(ix(k));
    for (auto& [block, at] : blocks) {
      std::vector<Eigen::Index> from;
      for (const Eigen::Index k : at) from.push_back(tested[ux(k)]);
      blocks_.push_back({std::move(at), rows.x(from, columns)});
    }
  }

  Eigen::VectorXd without(Eigen::VectorXd v) const {
    for (const auto& [at, z] : blocks_) {
      const Eigen::VectorXd own = v(at);
      v(at) = own - z * z.colPivHouseholderQr().solve(own);
    }
    return v;
  }

 private:
  std::vector<std::pair<std::vector<Eigen::Index>, Eigen::MatrixXd>> blocks_;
};

void add(const Equations& equations, const ChannelRows& rows, const Noise& noise,
         const std::vector<Eigen::Index>& tested, const Predictors& p, Errors& e) {
  const Levels levels(equations, rows, tested);
  const Eigen::MatrixXd x = rows.x(tested, Eigen::all);
  const Eigen::VectorXd measured = rows.y(tested), y = levels.without(measured),
                        root = noise.weight(tested).cwiseSqrt();
  const auto residual = [&](const Eigen::VectorXd& v) {
    return levels.without(measured - x * v(rows.columns));
  };
  const Eigen::VectorXd all = residual(p.all);
  e.left(tested) = all;
  e.removed.push_back((y.cwiseAbs().sum() - all.cwiseAbs().sum()) / static_cast<double>(tested.size()));
  e.rows += static_cast<double>(tested.size());
  e.file += y.cwiseAbs().sum();
  e.effects += residual(p.effects).cwiseAbs().sum();
  e.all += all.cwiseAbs().sum();
  e.of_effect.resize(p.of_effect.size());
  for (std::size_t q = 0; q < p.of_effect.size(); ++q) {
    for (std::size_t m = 0; m < p.of_effect[q].size(); ++m) {
      const Eigen::VectorXd left = residual(p.of_effect[q][m]).cwiseAbs();
      e.of_effect[q][m][0] += left.sum();
      e.of_effect[q][m][1] += root.dot(left);
    }
  }
}

double removed_part(std::span<const HeldOut::Block> blocks, std::span<const int> draw) {
  double before = 0, after = 0;
  for (std::size_t k = 0; k < draw.size(); ++k)
    before += draw[k] * blocks[k].file, after += draw[k] * blocks[k].explanation;
  return 1 - after / before;
}

}  // namespace

double chance_of_benefit(std::span<const HeldOut::Block> blocks) {
  const auto draws = statistics::bootstrap_counts(blocks.size());
  const auto falls = [&](const std::vector<int>& draw) { return removed_part(blocks, draw) > 0; };
  return static_cast<double>(std::ranges::count_if(draws, falls)) / static_cast<double>(draws.size());
}

std::array<double, 2> removed_interval(std::span<const HeldOut::Block> blocks) {
  return statistics::bootstrap_interval(
      blocks.size(), [&](std::span<const int> draw) { return removed_part(blocks, draw); });
}

Eigen::VectorXd plain_regression(const Data& d, const TermColumns& terms, std::span<const double> weights) {
  const std::vector<std::size_t> of_row = d.rows.blocks();
  std::vector<Eigen::Index> trained;
  std::vector<std::size_t> block;
  for (std::size_t r = 0; r < of_row.size(); ++r)
    if (weights[of_row[r]] != 0) trained.push_back(ix(r)), block.push_back(of_row[r]);
  const Eigen::VectorXd measured = d.rows.measured_w();
  Eigen::MatrixXd x = terms.x(trained, Eigen::all);
  // A term that these rows contain by rounding alone has no coefficient.
  for (Eigen::Index k = 0; k < x.cols(); ++k)
    if (x.col(k).norm() < rounding * terms.x.col(k).norm()) x.col(k).setZero();
  return terms.x * statistics::robust_regression(x, measured(trained), block, terms.nonnegative).coefficients;
}

HeldOut hold_out(const Fit& fit, std::span<const Found> effects, std::optional<std::size_t> function,
                 bool with_functions) {
  const Data& d = fit.data;
  const Equations& e = fit.equations;
  HeldOut out;
  const auto fold_of = [&](std::size_t block) { return static_cast<int>(block * folds / d.blocks); };
  const std::size_t n = d.rows.size();
  const Eigen::VectorXd measured = d.rows.measured_w();
  Eigen::VectorXd before;
  TermColumns terms;
  if (d.power) {
    before = measured - fit.unchanged_w;
    terms = term_columns(d);
  }
  std::vector<Errors> errors(e.channels.size());
  for (std::size_t c = 0; c < errors.size(); ++c)
    errors[c].left = Eigen::VectorXd::Constant(e.channels[c].y.size(), missing);
  std::vector<HeldOut::Block> blocks(d.blocks);
  out.explained_w = Eigen::VectorXd::Constant(ix(n), missing);
  for (int k = 0; k < static_cast<int>(folds); ++k) {
    std::vector<double> weights(d.blocks);
    for (std::size_t b = 0; b < d.blocks; ++b) weights[b] = fold_of(b) == k ? 0 : 1;
    if (std::ranges::count(weights, 0.0) == 0 || std::ranges::count(weights, 1.0) == 0) continue;
    const Predictors p = predictors(fit, weights, effects, with_functions);
    for (std::size_t c = 0; c < e.channels.size(); ++c) {
      std::vector<Eigen::Index> own;
      for (std::size_t row = 0; row < e.channels[c].block.size(); ++row)
        if (fold_of(e.channels[c].block[row]) == k) own.push_back(ix(row));
      if (fit.noise[c].sigma > 0 && !own.empty()) add(e, e.channels[c], fit.noise[c], own, p, errors[c]);
    }
    std::vector<Eigen::Index> tested;
    for (std::size_t r = 0; r < n; ++r)
      if (fold_of(d.rows.window(r).block) == k) tested.push_back(ix(r));
    if (tested.empty()) continue;
    // A step from the point of the walk, as far as the power of the other parts improves.
    const Eigen::VectorXd power_w = damped_step(fit, p.effects.head(ix(e.effects)), weights).power_w;
    out.explained_w(tested) = power_w(tested);
    const double few = static_cast<double>(d.fewest);
    if (static_cast<double>(tested.size()) < least_tested_rows * few ||
        static_cast<double>(n - tested.size()) < least_trained_rows * few)
      continue;
    const Eigen::VectorXd explained = measured - power_w;
    const Eigen::VectorXd by_terms = measured - plain_regression(d, terms, weights);
    for (const Eigen::Index r : tested) {
      HeldOut::Block& own = blocks[d.rows.window(ux(r)).block];
      own.file += std::fabs(before[r]);
      own.explanation += std::fabs(explained[r]);
      own.regression += std::fabs(by_terms[r]);
      own.size += std::fabs(measured[r]);
    }
  }
  double size = 0;
  for (const HeldOut::Block& own : blocks) {
    if (!(own.size > 0)) continue;
    out.blocks.push_back(own);
    out.file += own.file;
    out.explanation += own.explanation;
    out.regression += own.regression;
    size += own.size;
  }
  out.known = size > 0;
  if (out.known) out.file /= size, out.explanation /= size, out.regression /= size;
  for (std::size_t q = 0; q < effects.size(); ++q) {
    double most = 0, share = missing;
    for (std::size_t k = 0; k < errors.size(); ++k) {
      const Errors& c = errors[k];
      if (c.rows == 0 || (d.at_readings() && e.channels[k].channel != Channel::power)) continue;
      if (!std::isfinite(share)) share = 0;
      const auto& [with, without, calibrated] = c.of_effect[q];
      const double lost = without[1] - with[1], removed = std::max(c.file, calibrated[0]) - with[0];
      // Skips a channel in which the model removes nothing.
      if (lost <= most || removed <= 0) continue;
      most = lost;
      share = (without[0] - with[0]) / removed;
    }
    out.share.push_back(share);
  }
  for (std::size_t c = 0; function && c < errors.size(); ++c) {
    if (e.channels[c].channel != fit.functions[*function].channel || errors[c].rows == 0) continue;
    const double unit = errors[c].rows * fit.functions[*function].unit;
    out.function_file = errors[c].file / unit;
    out.function_effects = errors[c].effects / unit;
    out.function_all = errors[c].all / unit;
  }
  double channels = 0;
  for (std::size_t c = 0; c < errors.size(); ++c) {
    if (e.channels[c].channel == Channel::power && errors[c].left.size() == ix(n))
      out.repeats_left = repeated_part(d, errors[c].left);
    const auto same = std::ranges::find(fit.functions, e.channels[c].channel, &Function::channel);
    if (errors[c].rows == 0 || same == fit.functions.end()) continue;
    const double unit = same->unit;  // the residual that corresponds to all of the mean power
    const double removed = (errors[c].file - errors[c].all) / (errors[c].rows * unit);
    if (channels++ > 0 && removed <= out.removed) continue;
    out.removed = removed;
    const auto little =
        std::ranges::count_if(errors[c].removed, [&](double w) { return w < clear_gain * unit; });
    out.too_little = static_cast<double>(little) / static_cast<double>(errors[c].removed.size());
  }
  return out;
}

Eigen::VectorXd mean_strengths(const Fit& fit, std::span<const double> weights) {
  return predictors(fit, weights, {}, false).effects.head(ix(fit.equations.effects));
}

double repeated_part(const Data& d, const Eigen::VectorXd& residual_w) {
  struct Mean {
    double sum = 0, count = 0;
  };
  std::map<std::pair<std::size_t, long>, Mean> means;
  for (std::size_t r = 0; r < d.rows.size(); ++r) {
    if (!std::isfinite(residual_w[ix(r)])) continue;
    const Window& w = d.rows.window(r);
    Mean& m = means[{w.mission, static_cast<long>(w.t_s / repeats_s)}];
    m.sum += residual_w[ix(r)];
    m.count += 1;
  }
  double products = 0;
  std::size_t pairs = 0;
  for (auto at = means.begin(); at != means.end(); ++at) {
    const auto next = std::next(at);
    if (next == means.end() || next->first.first != at->first.first ||
        next->first.second != at->first.second + 1)
      continue;
    products += at->second.sum / at->second.count * next->second.sum / next->second.count;
    ++pairs;
  }
  if (pairs < fewest_neighbours) return missing;
  return std::sqrt(std::max(0.0, products / static_cast<double>(pairs))) / d.mean_power_w;
}

}  // namespace joulecast::gap::posterior

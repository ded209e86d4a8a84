#include "gap/posterior/hold_out.h"

#include <algorithm>
#include <cmath>
#include <map>

#include "statistics/regression.h"

namespace joulecast::gap::posterior {
namespace {

constexpr double least_weight = 1e-3;  // of a model in a prediction
constexpr std::size_t fewest_tested = 5, fewest_trained = 30, fewest_neighbours = 20;

// What the posterior without some blocks predicts with: coefficients of all columns.
struct Predictors {
  Eigen::VectorXd effects;               // models without a function
  Eigen::VectorXd all;                   // every model
  std::vector<Eigen::VectorXd> without;  // all, each effect asked for taken away
};

Predictors predictors(const Fit& fit, std::span<const double> weights, const std::vector<std::string>& ids) {
  const Equations& e = fit.equations;
  const ReducedByFactor reduced = reduce(e, fit.grams, weights);
  const Eigen::VectorXd p = probabilities(*fit.prior, reduced, fit.models).model;
  const View view(*fit.prior, reduced[fit.factor]);
  const Eigen::Index n = ix(e.effects + e.functions);
  Eigen::VectorXd plain = Eigen::VectorXd::Zero(n), full = plain;
  double plain_weight = 0;
  for (std::size_t k = 0; k < fit.models.size(); ++k) {
    const Model& m = fit.models[k];
    if (!m.configuration) plain_weight += p[ix(k)];
  }
  for (std::size_t k = 0; k < fit.models.size(); ++k) {
    const Model& m = fit.models[k];
    const bool counts = p[ix(k)] > least_weight;
    const bool counts_alone = !m.configuration && p[ix(k)] > least_weight * plain_weight;
    if (!counts && !counts_alone) continue;
    const Eigen::VectorXd own =
        view.coefficients(m.set, view.evidence(m.set, m.configuration, slab_shares).mean, m.configuration);
    if (counts) full += p[ix(k)] * own;
    if (counts_alone) plain += p[ix(k)] / plain_weight * own;
  }
  const double factor = tolerance_factors[fit.factor];
  const Information blocks = weighted_sum(fit.grams.of_factor[fit.factor], weights);
  const auto calibrated = [&](const Eigen::VectorXd& own) {
    Eigen::VectorXd v = calibration(e, blocks, factor, own);
    v.head(n) += own;
    return v;
  };
  Predictors out{calibrated(plain), calibrated(full), {}};
  for (const std::string& id : ids) {
    out.without.push_back(out.all);
    for (std::size_t k = 0; k < e.effects; ++k) {
      if (fit.catalogue.hypotheses[fit.catalogue.columns[k].hypothesis].id() == id)
        out.without.back()[ix(k)] -= full[ix(k)];
    }
  }
  return out;
}

// Terms of the plain regression, by row of power.
Eigen::MatrixXd plain_terms(const Data& d) {
  const double r = d.robot.kinematics.wheel_radius_m;
  const std::vector<Modulation> by = modulations_of(d.rows.instants);
  Eigen::MatrixXd x(ix(d.rows.size()), 5 + ix(by.size()));
  for (Eigen::Index k = 0; k < 5; ++k)
    x.col(k) = d.rows.mean([&](const Window& w) { return windows::plain_terms(w, r)[ux(k)]; });
  for (std::size_t k = 0; k < by.size(); ++k)
    x.col(5 + ix(k)) = d.rows.mean([&](const Window& w) { return by[k].of(w); });
  return x;
}

// Errors in one channel, summed over the rows of a fold.
struct Errors {
  double file = 0, effects = 0, all = 0, rows = 0;
  std::vector<double> without;
  double weighted = 0;  // |residual| in spreads
  std::vector<double> weighted_without;
};

void add(const ChannelRows& rows, const Noise& noise, const Eigen::VectorXi& fold, int k, const Predictors& p,
         Errors& e) {
  std::vector<Eigen::Index> tested;
  for (Eigen::Index row = 0; row < fold.size(); ++row) {
    if (fold[row] == k) tested.push_back(row);
  }
  if (tested.empty()) return;
  const Eigen::MatrixXd x = rows.x(tested, Eigen::all);
  const Eigen::VectorXd y = rows.y(tested), root = noise.weight(tested).cwiseSqrt();
  const auto residual = [&](const Eigen::VectorXd& v) { return Eigen::VectorXd(y - x * v(rows.columns)); };
  e.rows += static_cast<double>(tested.size());
  e.file += y.cwiseAbs().sum();
  e.effects += residual(p.effects).cwiseAbs().sum();
  const Eigen::VectorXd all = residual(p.all).cwiseAbs();
  e.all += all.sum();
  e.weighted += root.dot(all);
  e.without.resize(p.without.size());
  e.weighted_without.resize(p.without.size());
  for (std::size_t q = 0; q < p.without.size(); ++q) {
    const Eigen::VectorXd without = residual(p.without[q]).cwiseAbs();
    e.without[q] += without.sum();
    e.weighted_without[q] += root.dot(without);
  }
}

}  // namespace

HeldOut hold_out(const Fit& fit, const std::vector<std::string>& effects,
                 std::optional<std::size_t> function) {
  const Data& d = fit.data;
  const Equations& e = fit.equations;
  HeldOut out;
  const auto fold_of = [&](std::size_t block) { return static_cast<int>(block * folds / d.blocks); };
  std::vector<Eigen::VectorXi> fold;
  for (const ChannelRows& rows : e.channels) {
    fold.emplace_back(rows.y.size());
    for (std::size_t k = 0; k < rows.block.size(); ++k) fold.back()[ix(k)] = fold_of(rows.block[k]);
  }
  const std::size_t n = d.rows.size();
  const Eigen::VectorXd measured = Eigen::Map<const Eigen::VectorXd>(d.rows.power_w.data(), ix(n));
  Eigen::VectorXd before, left;
  Eigen::MatrixXd terms;
  if (d.power) {
    before = measured - predicted_power(d, d.in_file);
    left = measured - e.modelled_w;
    terms = plain_terms(d);
  }
  std::vector<Errors> errors(e.channels.size());
  double file = 0, explanation = 0, regression = 0, size = 0;
  for (int k = 0; k < static_cast<int>(folds); ++k) {
    std::vector<double> weights(d.blocks);
    for (std::size_t b = 0; b < d.blocks; ++b) weights[b] = fold_of(b) == k ? 0 : 1;
    if (std::ranges::count(weights, 0.0) == 0 || std::ranges::count(weights, 1.0) == 0) continue;
    const Predictors p = predictors(fit, weights, effects);
    for (std::size_t c = 0; c < e.channels.size(); ++c) {
      if (fit.noise[c].sigma > 0) add(e.channels[c], fit.noise[c], fold[c], k, p, errors[c]);
    }
    std::vector<Eigen::Index> tested, trained;
    std::vector<std::size_t> block;
    for (std::size_t r = 0; r < n; ++r) {
      const bool test = fold_of(d.rows.window(r).block) == k;
      (test ? tested : trained).push_back(ix(r));
      if (!test) block.push_back(d.rows.window(r).block);
    }
    if (tested.size() < fewest_tested || trained.size() < fewest_trained) continue;
    const statistics::Regression fitted =
        statistics::robust_regression(terms(trained, Eigen::all), measured(trained), block);
    const Eigen::VectorXd change = p.effects.head(ix(e.effects)) - e.point;
    file += before(tested).cwiseAbs().sum();
    explanation += (left(tested) - e.moved(tested, Eigen::all) * change).cwiseAbs().sum();
    regression += (measured(tested) - terms(tested, Eigen::all) * fitted.coefficients).cwiseAbs().sum();
    size += measured(tested).cwiseAbs().sum();
  }
  if (size > 0) {
    out.known = true;
    out.file = file / size;
    out.explanation = explanation / size;
    out.regression = regression / size;
  }
  for (std::size_t q = 0; q < effects.size(); ++q) {
    double most = 0, share = 0;
    for (const Errors& c : errors) {
      if (c.rows == 0 || c.weighted_without[q] - c.weighted <= most) continue;
      most = c.weighted_without[q] - c.weighted;
      share = c.file > c.all ? (c.without[q] - c.all) / (c.file - c.all) : 0;
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
  return out;
}

double repeated_part(const Data& d, const Eigen::VectorXd& residual_w) {
  struct Mean {
    double sum = 0, count = 0;
  };
  std::map<std::pair<std::size_t, long>, Mean> means;
  for (std::size_t r = 0; r < d.rows.size(); ++r) {
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

#include "gap/posterior/hold_out.h"

#include <algorithm>
#include <cmath>
#include <map>

#include "gap/posterior/terms.h"
#include "statistics/regression.h"

namespace joulecast::gap::posterior {
namespace {

constexpr double least_weight = 1e-3;  // of a model in a prediction, of the likeliest
constexpr std::size_t fewest_tested = 5, fewest_trained = 30, fewest_neighbours = 20;

// What the posterior without some blocks predicts with: coefficients of all columns.
struct Predictors {
  Eigen::VectorXd effects;                     // models without a function
  Eigen::VectorXd all;                         // every model
  std::vector<Eigen::VectorXd> with, without;  // the model of each effect asked for, and its set without it
};

Predictors predictors(const Fit& fit, std::span<const double> weights, std::span<const Found> effects) {
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
    for (std::size_t k = 0; k < fit.models.size(); ++k) {
      if (admits(fit.models[k])) most = std::max(most, log_joint[ix(k)]);
    }
    Eigen::VectorXd own = Eigen::VectorXd::Zero(n);
    for (std::size_t k = 0; k < fit.models.size(); ++k) {
      const Model& m = fit.models[k];
      const double weight = admits(m) ? std::exp(log_joint[ix(k)] - most) : 0;
      if (weight < least_weight) continue;
      own += weight * view.coefficients(m.set, strengths[k].mean, m.configuration);
      total += weight;
    }
    own /= total;
    return with_calibration(own, own);
  };
  const auto of_set = [&](const std::vector<std::size_t>& set, std::optional<std::size_t> configuration) {
    const SetEvidence s = view.evidence(set, configuration, slab_shares);
    return view.coefficients(set, s.mean, configuration);
  };
  Predictors out;
  out.effects = mean([](const Model& m) { return !m.configuration; });
  out.all = mean([](const Model&) { return true; });
  for (const Found& found : effects) {
    Model m = fit.models[found.model];
    const Eigen::VectorXd own = of_set(m.set, m.configuration);
    m.set.erase(m.set.begin() + static_cast<std::ptrdiff_t>(found.member));
    out.with.push_back(with_calibration(own, own));
    // The calibration stays: tolerances of all columns together take any gap.
    out.without.push_back(with_calibration(own, of_set(m.set, m.configuration)));
  }
  return out;
}

// Errors in one channel, summed over the rows left out so far.
struct Errors {
  double file = 0, effects = 0, all = 0, rows = 0;
  // Of each effect asked for, its model with it and without it: sum of |residual|, and that in spreads.
  std::vector<std::array<double, 2>> with, without;
  Eigen::VectorXd left;         // residual of each row; NaN until it was left out
  std::vector<double> removed;  // of each fold, in the channel's unit
};

void add(const ChannelRows& rows, const Noise& noise, const std::vector<Eigen::Index>& tested,
         const Predictors& p, Errors& e) {
  const Eigen::MatrixXd x = rows.x(tested, Eigen::all);
  const Eigen::VectorXd y = rows.y(tested), root = noise.weight(tested).cwiseSqrt();
  const auto residual = [&](const Eigen::VectorXd& v) { return Eigen::VectorXd(y - x * v(rows.columns)); };
  const Eigen::VectorXd all = residual(p.all);
  e.left(tested) = all;
  e.removed.push_back((y.cwiseAbs().sum() - all.cwiseAbs().sum()) / static_cast<double>(tested.size()));
  e.rows += static_cast<double>(tested.size());
  e.file += y.cwiseAbs().sum();
  e.effects += residual(p.effects).cwiseAbs().sum();
  e.all += all.cwiseAbs().sum();
  const auto add_both = [&](const Eigen::VectorXd& left, std::array<double, 2>& sums) {
    sums[0] += left.cwiseAbs().sum();
    sums[1] += root.dot(left.cwiseAbs());
  };
  e.with.resize(p.with.size());
  e.without.resize(p.with.size());
  for (std::size_t q = 0; q < p.with.size(); ++q) {
    add_both(residual(p.with[q]), e.with[q]);
    add_both(residual(p.without[q]), e.without[q]);
  }
}

// The residual of a channel that stands for all of the mean power; 0: none does.
double power_unit(const Fit& fit, Channel channel) {
  if (channel == Channel::gyro || channel == Channel::travel) return 0;
  const auto same = std::ranges::find(fit.functions, channel, &Function::channel);
  return same == fit.functions.end() ? 0 : same->unit;
}

}  // namespace

HeldOut hold_out(const Fit& fit, std::span<const Found> effects, std::optional<std::size_t> function) {
  const Data& d = fit.data;
  const Equations& e = fit.equations;
  HeldOut out;
  const auto fold_of = [&](std::size_t block) { return static_cast<int>(block * folds / d.blocks); };
  const std::size_t n = d.rows.size();
  const Eigen::VectorXd measured = Eigen::Map<const Eigen::VectorXd>(d.rows.power_w.data(), ix(n));
  Eigen::VectorXd before, left;
  TermColumns terms;
  if (d.power) {
    before = measured - predicted_power(d, d.in_file);
    left = measured - e.modelled_w;
    terms = term_columns(d);
  }
  std::vector<Errors> errors(e.channels.size());
  for (std::size_t c = 0; c < errors.size(); ++c)
    errors[c].left = Eigen::VectorXd::Constant(e.channels[c].y.size(), missing);
  double file = 0, explanation = 0, regression = 0, size = 0;
  for (int k = 0; k < static_cast<int>(folds); ++k) {
    std::vector<double> weights(d.blocks);
    for (std::size_t b = 0; b < d.blocks; ++b) weights[b] = fold_of(b) == k ? 0 : 1;
    if (std::ranges::count(weights, 0.0) == 0 || std::ranges::count(weights, 1.0) == 0) continue;
    const Predictors p = predictors(fit, weights, effects);
    for (std::size_t c = 0; c < e.channels.size(); ++c) {
      std::vector<Eigen::Index> own;
      for (std::size_t row = 0; row < e.channels[c].block.size(); ++row) {
        if (fold_of(e.channels[c].block[row]) == k) own.push_back(ix(row));
      }
      if (fit.noise[c].sigma > 0 && !own.empty()) add(e.channels[c], fit.noise[c], own, p, errors[c]);
    }
    std::vector<Eigen::Index> tested, trained;
    std::vector<std::size_t> block;
    for (std::size_t r = 0; r < n; ++r) {
      const bool test = fold_of(d.rows.window(r).block) == k;
      (test ? tested : trained).push_back(ix(r));
      if (!test) block.push_back(d.rows.window(r).block);
    }
    if (tested.size() < fewest_tested || trained.size() < fewest_trained) continue;
    const statistics::Regression fitted = statistics::robust_regression(
        terms.x(trained, Eigen::all), measured(trained), block, terms.nonnegative);
    const Eigen::VectorXd change = p.effects.head(ix(e.effects)) - e.point;
    file += before(tested).cwiseAbs().sum();
    explanation += (left(tested) - e.moved(tested, Eigen::all) * change).cwiseAbs().sum();
    regression += (measured(tested) - terms.x(tested, Eigen::all) * fitted.coefficients).cwiseAbs().sum();
    size += measured(tested).cwiseAbs().sum();
  }
  if (size > 0) {
    out.known = true;
    out.file = file / size;
    out.explanation = explanation / size;
    out.regression = regression / size;
  }
  for (std::size_t q = 0; q < effects.size(); ++q) {
    double most = 0, share = missing;
    for (const Errors& c : errors) {
      if (c.rows == 0) continue;
      if (!std::isfinite(share)) share = 0;
      const double lost = c.without[q][1] - c.with[q][1];
      // A channel in which the model removes nothing shows no part of it.
      if (lost <= most || c.file <= c.with[q][0]) continue;
      most = lost;
      share = (c.without[q][0] - c.with[q][0]) / (c.file - c.with[q][0]);
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
    const double unit = power_unit(fit, e.channels[c].channel);
    if (errors[c].rows == 0 || unit == 0) continue;
    const double removed = (errors[c].file - errors[c].all) / (errors[c].rows * unit);
    if (channels++ > 0 && removed <= out.removed) continue;
    out.removed = removed;
    const auto little =
        std::ranges::count_if(errors[c].removed, [&](double w) { return w < clear_gain * unit; });
    out.too_little = static_cast<double>(little) / static_cast<double>(errors[c].removed.size());
  }
  for (std::size_t c = 0; c < errors.size(); ++c) {
    if (e.channels[c].channel == Channel::power) out.repeats_left = repeated_part(d, errors[c].left);
  }
  return out;
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

#include "gap/posterior/hold_out.h"

#include <algorithm>
#include <cmath>
#include <map>

#include "gap/posterior/bagging.h"
#include "statistics/regression.h"

namespace joulecast::gap::posterior {
namespace {

constexpr double least_weight = 1e-3;                                 // of a model in a prediction
constexpr double least_tested_rows = 0.25, least_trained_rows = 1.5;  // of the rows that a channel needs
constexpr std::size_t fewest_neighbours = 20;
constexpr double rounding = 1e-9;  // of |v|: a term that is smaller in all rows is zero

// What the posterior without some blocks predicts with: coefficients of all columns.
struct Predictors {
  Eigen::VectorXd effects;               // models without a function
  Eigen::VectorXd all;                   // every model
  std::vector<Eigen::VectorXd> without;  // all, each effect asked for taken away
  Eigen::VectorXd probability;           // of each model
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
  Predictors out{calibrated(plain), calibrated(full), {}, p};
  for (const std::string& id : ids) {
    out.without.push_back(out.all);
    for (std::size_t k = 0; k < e.effects; ++k) {
      if (fit.catalogue.hypotheses[fit.catalogue.columns[k].hypothesis].id() == id)
        out.without.back()[ix(k)] -= full[ix(k)];
    }
  }
  return out;
}

Eigen::VectorXd measured_power(const Data& d) {
  return Eigen::Map<const Eigen::VectorXd>(d.rows.power_w.data(), ix(d.rows.size()));
}

// By the rows of blocks in use, of all rows.
Eigen::VectorXd regressed(const Data& d, const Eigen::MatrixXd& terms, std::span<const double> weights) {
  std::vector<Eigen::Index> trained;
  std::vector<std::size_t> block;
  for (std::size_t r = 0; r < d.rows.size(); ++r) {
    if (weights[d.rows.window(r).block] == 0) continue;
    trained.push_back(ix(r));
    block.push_back(d.rows.window(r).block);
  }
  const Eigen::VectorXd measured = measured_power(d);
  return terms *
         statistics::robust_regression(terms(trained, Eigen::all), measured(trained), block).coefficients;
}

// By effects and calibration, of all rows of power.
Eigen::VectorXd explained_power(const Fit& fit, const Predictors& p) {
  return power_of(fit, bounded(fit.catalogue, p.effects.head(ix(fit.equations.effects))));
}

// Errors in one channel, summed over the rows left out so far.
struct Errors {
  double file = 0, effects = 0, all = 0, rows = 0;
  double weighted = 0;  // |residual| in spreads
  std::vector<double> without, weighted_without;
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
  e.weighted += root.dot(all.cwiseAbs());
  e.without.resize(p.without.size());
  e.weighted_without.resize(p.without.size());
  for (std::size_t q = 0; q < p.without.size(); ++q) {
    const Eigen::VectorXd without = residual(p.without[q]).cwiseAbs();
    e.without[q] += without.sum();
    e.weighted_without[q] += root.dot(without);
  }
}

// The residual of a channel that stands for all of the mean power; 0: none does.
double power_unit(const Fit& fit, Channel channel) {
  if (channel == Channel::gyro || channel == Channel::travel) return 0;
  const auto same = std::ranges::find(fit.functions, channel, &Function::channel);
  return same == fit.functions.end() ? 0 : same->unit;
}

}  // namespace

PlainTerms plain_terms(const Data& d) {
  const double r = d.robot.kinematics.wheel_radius_m;
  const std::vector<Modulation> by = modulations_of(d.rows.instants);
  PlainTerms out{{"constant", "|v|", "turning", "v a", "climb", "payload"},
                 {"W", "J/m", "J/m", "W s^3/m^2", "J/m", "J/(kg m)"},
                 Eigen::MatrixXd(ix(d.rows.size()), 6 + ix(by.size()))};
  for (Eigen::Index k = 0; k < 5; ++k)
    out.x.col(k) = d.rows.mean([&](const Window& w) { return windows::plain_terms(w, r)[ux(k)]; });
  out.x.col(5) = d.rows.mean([&](const Window& w) { return w.payload_kg * windows::plain_terms(w, r)[1]; });
  for (std::size_t k = 0; k < by.size(); ++k) {
    out.x.col(6 + ix(k)) = d.rows.mean([&](const Window& w) { return by[k].of(w); });
    out.names.push_back("covariate:" + d.covariates[by[k].covariate]);
    out.units.emplace_back("W/unit");
  }
  // From rest to rest v a is nothing but rounding.
  for (Eigen::Index k = 2; k < 5; ++k) {
    if (out.x.col(k).cwiseAbs().maxCoeff() < rounding * out.x.col(1).cwiseAbs().maxCoeff())
      out.x.col(k).setZero();
  }
  if (d.group.empty()) return out;
  // Groups may have nothing in common.
  const Eigen::MatrixXd all = out.x;
  const std::size_t groups = 1 + *std::ranges::max_element(d.group);
  out.x.setZero(all.rows(), all.cols() * ix(groups));
  for (Eigen::Index row = 0; row < all.rows(); ++row)
    out.x.row(row).segment(all.cols() * ix(d.group[d.rows.window(ux(row)).mission]), all.cols()) =
        all.row(row);
  return out;
}

Eigen::VectorXd plain_regression(const Data& data, std::span<const double> weights) {
  return regressed(data, plain_terms(data).x, weights);
}

HeldOut hold_out(const Fit& fit, const std::vector<std::string>& effects,
                 std::optional<std::size_t> function) {
  const Data& d = fit.data;
  const Equations& e = fit.equations;
  HeldOut out;
  const auto fold_of = [&](std::size_t block) { return static_cast<int>(block * folds / d.blocks); };
  const std::size_t n = d.rows.size();
  const Eigen::VectorXd measured = measured_power(d);
  Eigen::VectorXd before;
  Eigen::MatrixXd terms;
  if (d.power) {
    before = measured - fit.unchanged_w;
    terms = plain_terms(d).x;
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
    std::vector<Eigen::Index> tested;
    for (std::size_t r = 0; r < n; ++r) {
      if (fold_of(d.rows.window(r).block) == k) tested.push_back(ix(r));
    }
    const double few = static_cast<double>(d.fewest);
    if (static_cast<double>(tested.size()) < least_tested_rows * few ||
        static_cast<double>(n - tested.size()) < least_trained_rows * few)
      continue;
    const Eigen::VectorXd explained = measured - explained_power(fit, p);
    const Eigen::VectorXd by_terms = measured - regressed(d, terms, weights);
    file += before(tested).cwiseAbs().sum();
    explanation += explained(tested).cwiseAbs().sum();
    regression += by_terms(tested).cwiseAbs().sum();
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
      if (c.weighted_without[q] - c.weighted <= most) continue;
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
    if (e.channels[c].channel == Channel::power && errors[c].left.size() == ix(n))
      out.repeats_left = repeated_part(d, errors[c].left);
  }
  return out;
}

Without predict_without(const Fit& fit, std::span<const double> weights) {
  const Predictors p = predictors(fit, weights, {});
  Without out{explained_power(fit, p), plain_regression(fit.data, weights), {}};
  for (const Found& found : summarise(fit, p.probability).effects) {
    if (found.group >= named) out.named.push_back(found.id);
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

#include "gap/posterior/evidence.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <map>
#include <set>

#include "statistics/distributions.h"

namespace joulecast::gap::posterior {
namespace {

double log_sum(std::span<const double> values) {
  const double most = *std::ranges::max_element(values);
  double sum = 0;
  for (const double v : values) sum += std::exp(v - most);
  return most + std::log(sum);
}

// An ascending set with one member more.
std::vector<std::size_t> with(std::vector<std::size_t> set, std::size_t h) {
  set.insert(std::ranges::lower_bound(set, h), h);
  return set;
}

// A smaller wheel and slip roll less far alike.
bool rolls_less(const std::string& id) {
  return id == "wheel_slip" || id == "wheel_radius_error";
}

struct Ranked {
  double log_joint;
  Model model;
};

void sort_best(std::vector<Ranked>& models) {
  std::ranges::stable_sort(models, std::greater(), &Ranked::log_joint);
}

// The best sets with one configuration.
std::vector<Ranked> search(const Prior& prior, const View& view, std::optional<std::size_t> configuration,
                           std::span<const std::size_t> live, double to_beat) {
  const double base = view.log_evidence(configuration);
  const auto score = [&](std::vector<std::size_t> set, std::span<const double> shares) {
    return Ranked{view.evidence(set, configuration, shares).log_evidence + base,
                  {std::move(set), configuration}};
  };
  std::vector<Ranked> all{{base, {{}, configuration}}}, best;
  const auto keep_best = [&](std::size_t count) {
    sort_best(best);
    if (best.size() > count) best.resize(count);
    all.insert(all.end(), best.begin(), best.end());
  };
  double most = base;
  for (const std::size_t h : live) {
    all.push_back(score({h}, std::array{usual_slab}));
    most = std::max(most, all.back().log_joint);
  }
  if (configuration && most < to_beat - hopeless_nats) return all;
  const std::array one{usual_slab};
  const std::span<const double> shares = configuration ? std::span<const double>(one) : slab_shares;
  for (std::size_t i = 0; i < live.size(); ++i) {
    for (std::size_t j = i + 1; j < live.size(); ++j)
      if (!prior.excludes(live[i], live[j])) best.push_back(score({live[i], live[j]}, shares));
  }
  keep_best(kept_pairs);
  const std::size_t largest = configuration ? most_effects - 1 : most_effects;
  const std::size_t extended = configuration ? extended_with_function : extended_sets;
  for (std::size_t size = 3; size <= largest && !best.empty(); ++size) {
    std::set<std::vector<std::size_t>> next;
    for (std::size_t k = 0; k < std::min(extended, best.size()); ++k) {
      for (const std::size_t h : live) {
        const std::vector<std::size_t>& set = best[k].model.set;
        if (std::ranges::none_of(set, [&](std::size_t q) { return prior.excludes(h, q); }))
          next.insert(with(set, h));
      }
    }
    best.clear();
    for (const auto& set : next) best.push_back(score(set, shares));
    keep_best(kept_larger);
  }
  return all;
}

}  // namespace

SetEvidence evidence_of(const Eigen::MatrixXd& g, const Eigen::VectorXd& b, const Eigen::VectorXd& sd,
                        const Eigen::VectorXd& least, const Eigen::VectorXd& most) {
  const Eigen::Index n = b.size();
  Eigen::MatrixXd h = sd.asDiagonal() * g * sd.asDiagonal();
  h.diagonal().array() += 1;
  const Eigen::LLT<Eigen::MatrixXd> factor(h);
  const Eigen::VectorXd c = sd.cwiseProduct(b), z = factor.solve(c);
  const Eigen::MatrixXd inverse = factor.solve(Eigen::MatrixXd::Identity(n, n));
  SetEvidence out;
  out.mean = z.cwiseProduct(sd);
  out.sd = inverse.diagonal().cwiseMax(1e-300).cwiseSqrt().cwiseProduct(sd);
  out.log_evidence = 0.5 * z.dot(c) - factor.matrixLLT().diagonal().array().log().sum();
  for (Eigen::Index k = 0; k < n; ++k)
    out.log_evidence += statistics::log_normal_within(out.mean[k], out.sd[k], least[k], most[k]) -
                        statistics::log_normal_within(0, sd[k], least[k], most[k]);
  return out;
}

Prior::Prior(const Catalogue& catalogue, const Equations& equations, const std::vector<Function>& functions,
             double gap, bool power_alone, const Eigen::MatrixXd& raw)
    : c_(catalogue), e_(equations), widest_(std::max(gap, least_gap)) {
  std::map<std::string, double> shapes;
  for (const Hypothesis& h : c_.hypotheses) ++shapes[h.id()];
  const std::size_t ids = std::max(shapes.size(), c_.ids);
  for (const Hypothesis& h : c_.hypotheses) {
    const std::string id = h.id();
    const double against = id == "floor_resistance_zone"                ? searched_zones
                           : power_alone && id == "current_sensor_bias" ? bias_alone
                                                                        : 1;
    log_prior_.push_back(std::log(expected_effects / static_cast<double>(ids) / shapes[id] / against));
  }
  for (std::size_t f = 0; f < functions.size(); ++f)
    for (const double share : function_shares) configurations_.push_back({f, share});
  if (!configurations_.empty())
    log_configuration_ = std::log(expected_function / static_cast<double>(configurations_.size()));
  excludes_.assign(size() * size(), false);
  for (std::size_t a = 0; a < size(); ++a) {
    const Hypothesis& ha = c_.hypotheses[a];
    const auto i = ix(c_.first_column(a));
    for (std::size_t b = 0; b < size(); ++b) {
      const Hypothesis& hb = c_.hypotheses[b];
      const auto j = ix(c_.first_column(b));
      const bool single = ha.columns.size() == 1 && hb.columns.size() == 1;
      excludes_[a * size() + b] = ha.id() == hb.id() || (rolls_less(ha.id()) && rolls_less(hb.id())) ||
                                  (single && std::fabs(raw(i, j)) > alike * std::sqrt(raw(i, i) * raw(j, j)));
    }
  }
}

double Prior::slab(std::size_t hypothesis, double share) const {
  const std::size_t first = c_.first_column(hypothesis);
  const Column& c = e_.columns[first];
  // The gap of battery power limits effects that are visible mainly in it.
  if (e_.share[ix(first)] * c.unit > 0.5) share = std::min(share, widest_);
  if (c.usual == 0) return share * c.unit;
  return c.unit != c.usual ? std::min(share * c.unit, c.usual) : c.usual * share / usual_slab_of;
}

View::View(const Prior& prior, const Reduced& reduced)
    : prior_(prior),
      all_(reduced.information),
      cost_(prior.size(), 0.0),
      direction_(prior.size(), {1, 0}),
      unders_(prior.configurations().size() + 1) {
  for (std::size_t h = 0; h < prior.size(); ++h) {
    const auto& own = prior.catalogue().hypotheses[h].columns;
    if (own.size() != 2) continue;
    const std::array<Eigen::Index, 2> at{ix(own[0]), ix(own[1])};
    Eigen::Matrix2d g = all_.xx(at, at);
    const Eigen::Vector2d b = all_.xy(at);
    Eigen::Matrix2d damped = g;
    damped.diagonal().array() += 1e-9 * g.trace() + 1e-300;
    Eigen::Vector2d t = damped.inverse() * b;
    t = t.norm() > 0 ? Eigen::Vector2d(t / t.norm()) : Eigen::Vector2d(1, 0);
    direction_[h] = {t[0], t[1]};
    Eigen::Matrix2d turn;
    turn << t[0], -t[1], t[1], t[0];
    const double sd = prior.slab(h, usual_slab);
    cost_[h] = -0.5 * std::log1p(sd * sd * std::max(0.0, (turn.transpose() * g * turn)(1, 1)));
    const Eigen::MatrixXd columns = all_.xx(Eigen::all, at) * turn;
    all_.xx(Eigen::all, at) = columns;
    const Eigen::MatrixXd rows = turn.transpose() * all_.xx(at, Eigen::all);
    all_.xx(at, Eigen::all) = rows;
    all_.xy(at) = (turn.transpose() * b).eval();
  }
}

const View::Under& View::under(std::optional<std::size_t> configuration) const {
  auto& own = unders_[configuration ? *configuration + 1 : 0];
  if (own) return *own;
  own.emplace();
  const Equations& e = prior_.equations();
  std::vector<Eigen::Index> keep;
  for (std::size_t k = 0; k < e.effects; ++k) keep.push_back(ix(k));
  if (!configuration) {
    own->information = subset(all_, keep);
    return *own;
  }
  const Configuration& c = prior_.configurations()[*configuration];
  Eigen::VectorXd sd = Eigen::VectorXd::Zero(ix(e.effects + e.function_columns[c.function].size()));
  for (const std::size_t k : e.function_columns[c.function]) {
    sd[ix(keep.size())] = c.share * e.columns[k].unit;
    keep.push_back(ix(k));
  }
  Information part = subset(all_, keep);
  part.integrate_out(sd);
  own->log_evidence = part.log_scale - all_.log_scale + 0.5 * (all_.yy - part.yy);
  keep.resize(e.effects);
  own->information = subset(part, keep);
  return *own;
}

double View::log_evidence(std::optional<std::size_t> configuration) const {
  return configuration ? under(configuration).log_evidence + prior_.log_configuration() : 0;
}

SetEvidence View::evidence(std::span<const std::size_t> set, std::optional<std::size_t> configuration,
                           std::span<const double> shares) const {
  SetEvidence out;
  const Eigen::Index n = ix(set.size());
  out.mean = out.sd = Eigen::VectorXd::Zero(n);
  if (set.empty()) return out;
  const Information& info = under(configuration).information;
  std::vector<Eigen::Index> at;
  Eigen::VectorXd least(n), most(n), sd(n);
  double prior = 0;
  for (const std::size_t h : set) {
    const Hypothesis& own = prior_.catalogue().hypotheses[h];
    least[ix(at.size())] = own.least;
    most[ix(at.size())] = own.most;
    at.push_back(ix(own.columns[0]));
    prior += prior_.log_prior(h) + cost_[h];
  }
  const Eigen::MatrixXd g = info.xx(at, at);
  const Eigen::VectorXd b = info.xy(at);
  std::vector<SetEvidence> by_share;
  std::vector<double> logs;
  for (const double share : shares) {
    for (std::size_t k = 0; k < set.size(); ++k) sd[ix(k)] = prior_.slab(set[k], share);
    by_share.push_back(evidence_of(g, b, sd, least, most));
    logs.push_back(by_share.back().log_evidence);
  }
  const double total = log_sum(logs);
  for (const SetEvidence& one : by_share) {
    const double weight = std::exp(one.log_evidence - total);
    out.mean += weight * one.mean;
    out.sd += weight * one.sd;
  }
  out.log_evidence = total - std::log(static_cast<double>(shares.size())) + prior;
  return out;
}

Eigen::VectorXd View::coefficients(std::span<const std::size_t> set, const Eigen::VectorXd& t,
                                   std::optional<std::size_t> configuration) const {
  const Equations& e = prior_.equations();
  Eigen::VectorXd out = Eigen::VectorXd::Zero(ix(e.effects + e.functions));
  if (configuration) {
    const Configuration& c = prior_.configurations()[*configuration];
    std::vector<Eigen::Index> own;
    for (const std::size_t k : e.function_columns[c.function]) own.push_back(ix(k));
    Eigen::VectorXd rest = all_.xy(own), sd(ix(own.size()));
    for (std::size_t k = 0; k < own.size(); ++k) sd[ix(k)] = c.share * e.columns[ux(own[k])].unit;
    for (std::size_t k = 0; k < set.size(); ++k)
      rest -= t[ix(k)] * all_.xx(own, ix(prior_.catalogue().first_column(set[k])));
    Eigen::MatrixXd m = sd.asDiagonal() * all_.xx(own, own) * sd.asDiagonal();
    m.diagonal().array() += 1;
    out(own) = sd.cwiseProduct(m.llt().solve(sd.cwiseProduct(rest)));
  }
  for (std::size_t k = 0; k < set.size(); ++k) {
    const Hypothesis& own = prior_.catalogue().hypotheses[set[k]];
    const double strength = std::clamp(t[ix(k)], own.least, own.most);
    for (std::size_t d = 0; d < own.columns.size(); ++d)
      out[ix(own.columns[d])] = strength * direction_[set[k]][d];
  }
  return out;
}

double View::precision(std::size_t hypothesis) const {
  const Eigen::Index at = ix(prior_.catalogue().first_column(hypothesis));
  return all_.xx(at, at);
}

std::vector<Model> enumerate(const Prior& prior, const Reduced& reduced) {
  const View view(prior, reduced);
  std::vector<std::size_t> live;
  for (std::size_t h = 0; h < prior.size(); ++h) {
    const double sd = prior.slab(h, usual_slab_of);
    if (view.precision(h) * sd * sd > not_seen) live.push_back(h);
  }
  double to_beat = 0;
  std::vector<Ranked> found = search(prior, view, std::nullopt, live, to_beat);
  for (const Ranked& f : found) to_beat = std::max(to_beat, f.model.set.size() <= 1 ? f.log_joint : 0.0);
  for (std::size_t c = 0; c < prior.configurations().size(); ++c)
    std::ranges::move(search(prior, view, c, live, to_beat), std::back_inserter(found));
  sort_best(found);
  std::set<Model> have;
  std::vector<Model> models;
  // Functions of the best configurations only.
  std::vector<std::optional<std::size_t>> configurations;
  for (std::size_t k = 0; k < std::min(found.size(), kept_models); ++k) {
    const auto& c = found[k].model.configuration;
    if (std::ranges::find(configurations, c) == configurations.end()) configurations.push_back(c);
  }
  if (configurations.size() > kept_configurations) configurations.resize(kept_configurations);
  for (std::size_t k = 0; k < found.size(); ++k) {
    const Model& m = found[k].model;
    const bool single = m.set.size() <= 1 && !m.configuration;
    const bool good =
        k < kept_models &&
        (!m.configuration || std::ranges::find(configurations, m.configuration) != configurations.end());
    if ((single || good) && have.insert(m).second) models.push_back(m);
  }
  const std::size_t whole = std::min(models_with_subsets, models.size());
  for (std::size_t k = 0; k < whole; ++k) {
    const std::vector<std::size_t> set = models[k].set;
    for (std::size_t bits = 0; bits + 1 < (std::size_t{1} << set.size()); ++bits) {
      Model part{{}, models[k].configuration};
      for (std::size_t q = 0; q < set.size(); ++q)
        if ((bits >> q & 1) != 0) part.set.push_back(set[q]);
      if (have.insert(part).second) models.push_back(std::move(part));
    }
  }
  return models;
}

Eigen::VectorXd log_posteriors(const View& view, const Reduced& reduced, std::span<const Model> models,
                               std::vector<SetEvidence>* strengths) {
  Eigen::VectorXd out(ix(models.size()));
  if (strengths != nullptr) strengths->clear();
  for (std::size_t k = 0; k < models.size(); ++k) {
    SetEvidence s = view.evidence(models[k].set, models[k].configuration, slab_shares);
    out[ix(k)] = s.log_evidence + view.log_evidence(models[k].configuration) + reduced.log_evidence;
    if (strengths != nullptr) strengths->push_back(std::move(s));
  }
  return out;
}

Probabilities probabilities(const Prior& prior, const ReducedByFactor& reduced,
                            std::span<const Model> models) {
  Eigen::MatrixXd log_joint(ix(models.size()), ix(factor_count));
  for (std::size_t f = 0; f < factor_count; ++f)
    log_joint.col(ix(f)) = log_posteriors(View(prior, reduced[f]), reduced[f], models);
  Eigen::Index row = 0, factor = 0;
  const double most = log_joint.maxCoeff(&row, &factor);
  const Eigen::MatrixXd p = (log_joint.array() - most).exp();
  Probabilities out;
  out.model = p.rowwise().sum() / p.sum();
  out.factor = p.colwise().sum().transpose() / p.sum();
  out.best_factor = ux(factor);
  out.log_joint = p.rowwise().sum().array().log() + most;
  return out;
}

}  // namespace joulecast::gap::posterior

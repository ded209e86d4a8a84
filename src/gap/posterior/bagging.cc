#include "gap/posterior/bagging.h"

#include <algorithm>
#include <cmath>
#include <map>

#include "gap/traits.h"
#include "statistics/bootstrap.h"

namespace joulecast::gap::posterior {

bool shows_elsewhere(const Fit& fit, const Hypothesis& h) {
  if (!h.is_effect()) return false;
  const dynamics::ActsOn acts_on = h.effect.effect->info().acts_on;
  const bool motor = acts_on == dynamics::ActsOn::motor && fit.data.motors;
  const bool sensor = acts_on == dynamics::ActsOn::sensors;
  return traits_of(h.id()).elsewhere || motor ||
         (sensor && h.id() != "sensor_delay" && h.effect.values[2] == 0);  // the motors' sensors alone
}

Eigen::VectorXd bagged(const Prior& prior, const Grams& grams, std::span<const Model> models, int draws) {
  Eigen::VectorXd sum = Eigen::VectorXd::Zero(ix(models.size()));
  double count = 0;
  for (const std::vector<int>& draw : statistics::bootstrap_counts(grams.blocks(), draws)) {
    const std::vector<double> weights(draw.begin(), draw.end());
    const Eigen::VectorXd p = probabilities(prior, reduce(prior.equations(), grams, weights), models).model;
    if (!p.allFinite()) continue;
    sum += p;
    count += 1;
  }
  return sum / std::max(count, 1.0);
}

std::vector<Content> contents(const Fit& fit) {
  const View view(*fit.prior, fit.reduced[fit.factor]);
  const double power = fit.data.mean_power_w;
  const Equations& e = fit.equations;
  const bool own_channels = fit.data.motors || fit.data.witness != Witness::power;
  std::vector<Content> out;
  for (std::size_t k = 0; k < fit.models.size(); ++k) {
    const Model& model = fit.models[k];
    const Eigen::VectorXd own = view.coefficients(model.set, fit.strengths[k].mean, model.configuration);
    Content content;
    for (const std::size_t h : model.set) {
      const Hypothesis& hypothesis = fit.catalogue.hypotheses[h];
      const auto& columns = hypothesis.columns;
      // Without motor channels kinematics are checks of the data, not causes of a gap in power.
      const Eigen::VectorXd& size =
          shows_elsewhere(fit, hypothesis) && !fit.data.at_readings() ? e.moves : e.share;
      double share = std::fabs(own[ix(columns[0])]) * size[ix(columns[0])];
      if (columns.size() == 2 && fit.data.power)
        share = (e.moved.col(ix(columns[0])) * own[ix(columns[0])] +
                 e.moved.col(ix(columns[1])) * own[ix(columns[1])])
                    .cwiseAbs()
                    .mean() /
                power;
      if (share > least_effect) content.ids.push_back(hypothesis.id());
    }
    std::ranges::sort(content.ids);
    if (model.configuration) {
      const std::size_t f = fit.prior->configurations()[*model.configuration].function;
      Eigen::VectorXd beta(ix(e.function_columns[f].size()));
      for (std::size_t j = 0; j < e.function_columns[f].size(); ++j)
        beta[ix(j)] = own[ix(e.function_columns[f][j])];
      // The mean size of a normal variable is 0.8 standard deviations.
      content.function_share = 0.8 * std::sqrt(std::max(0.0, beta.dot(e.function_power[f] * beta)));
      const bool of_power = own_channels || fit.functions[f].channel == Channel::power;
      if (of_power && content.function_share > least_function) content.function = f;
    }
    out.push_back(std::move(content));
  }
  return out;
}

Summary summarise(const Fit& fit, const Eigen::VectorXd& probability) {
  const std::vector<Content> content = contents(fit);
  Summary out;
  std::map<std::string, double> of_effect;
  std::map<std::size_t, double> of_function;
  std::map<std::vector<std::string>, double> of_set;
  for (std::size_t k = 0; k < content.size(); ++k) {
    const double p = probability[ix(k)];
    for (const std::string& id : content[k].ids) of_effect[id] += p;
    of_set[content[k].ids] += p;
    if (content[k].function) {
      of_function[*content[k].function] += p;
      out.outside += p;
    }
    out.function_share += p * content[k].function_share;
    if (content[k].ids.empty() && !content[k].function) out.none += p;
  }
  const auto likelier = [](const auto& a, const auto& b) { return a.second < b.second; };
  const auto function = std::ranges::max_element(of_function, likelier);
  if (function != of_function.end()) out.function = function->first;
  auto set = std::ranges::max_element(of_set, likelier);
  if (set->first.empty() && out.none < named && out.outside < named) {
    std::erase_if(of_set, [](const auto& s) { return s.first.empty(); });
    set = std::ranges::max_element(of_set, likelier);
    if (set == of_set.end()) return out;
  }
  for (const std::string& id : set->first) {
    Found found;
    found.id = id;
    found.probability = std::min(1.0, of_effect[id]);
    std::map<std::string, double> instead;
    struct Shape {
      double probability = 0, most = -1;  // of all models with it, of the likeliest of them
      std::size_t model = 0;
    };
    std::map<std::size_t, Shape> shapes;  // by hypothesis
    const auto place = [&](std::size_t model) {
      const auto& members = fit.models[model].set;
      return std::ranges::find(members, id, [&](std::size_t h) { return fit.catalogue.hypotheses[h].id(); }) -
             members.begin();
    };
    for (std::size_t k = 0; k < content.size(); ++k) {
      const auto& ids = content[k].ids;
      if (std::ranges::find(ids, id) == ids.end()) {
        for (const std::string& other : ids)
          if (std::ranges::find(set->first, other) == set->first.end()) instead[other] += probability[ix(k)];
        continue;
      }
      Shape& shape = shapes[fit.models[k].set[ux(place(k))]];
      shape.probability += probability[ix(k)];
      if (!(probability[ix(k)] > shape.most)) continue;
      shape.most = probability[ix(k)];
      shape.model = k;
    }
    const auto shape = std::ranges::max_element(
        shapes, {}, [](const std::pair<const std::size_t, Shape>& s) { return s.second.probability; });
    found.model = shape->second.model;
    found.member = ux(place(found.model));
    found.group = found.probability;
    for (std::size_t n = 0; n < most_alternatives && !instead.empty(); ++n) {
      const auto next = std::ranges::max_element(instead, likelier);
      if (next->second < least_listed) break;
      found.alternatives.push_back(next->first);
      found.group = std::min(1.0, found.group + next->second);
      instead.erase(next);
    }
    out.effects.push_back(std::move(found));
  }
  std::ranges::stable_sort(out.effects, std::greater(), &Found::probability);
  return out;
}

Constancy constancy(const Fit& fit, std::span<const std::size_t> set, std::size_t member) {
  const Equations& e = fit.equations;
  const std::vector<Eigen::Index> keep = without_functions(e);
  std::vector<Information> blocks;
  for (const Information& block : fit.grams.raw) blocks.push_back(subset(block, keep));
  const Eigen::VectorXd tolerance = tolerances(e, tolerance_factors[0])(keep);
  Eigen::VectorXd scatter(ix(e.size()));
  for (std::size_t k = 0; k < e.size(); ++k) scatter[ix(k)] = e.columns[k].scatter;
  const double strength = std::fabs(
      View(*fit.prior, fit.reduced[fit.factor]).evidence(set, std::nullopt, slab_shares).mean[ix(member)]);
  std::array<double, wander_scales.size()> log_joint{};
  for (std::size_t r = 0; r < wander_scales.size(); ++r) {
    Eigen::VectorXd own = scatter;
    for (const std::size_t k : fit.catalogue.hypotheses[set[member]].columns)
      own[ix(k)] = std::hypot(own[ix(k)], wander_scales[r] * strength);
    Information sum;
    for (Information block : blocks) {
      block.integrate_out(own(keep));
      sum += block;
    }
    sum.integrate_out(tolerance);
    const Reduced reduced{std::move(sum), 0};
    const double prior =
        r == 0 ? constant_prior : (1 - constant_prior) / static_cast<double>(wander_scales.size() - 1);
    log_joint[r] = reduced.information.log_scale - 0.5 * reduced.information.yy + std::log(prior) +
                   View(*fit.prior, reduced).evidence(set, std::nullopt, slab_shares).log_evidence;
  }
  const double most = *std::ranges::max_element(log_joint);
  double all = 0, constant = 0, scattered = 0;
  for (std::size_t r = 0; r < wander_scales.size(); ++r) {
    const double weight = std::exp(log_joint[r] - most);
    all += weight;
    scattered += wander_scales[r] * weight;
    if (wander_scales[r] <= most_wander) constant += weight;
  }
  return {constant / all, scattered / all};
}

}  // namespace joulecast::gap::posterior

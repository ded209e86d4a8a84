#include "gap/posterior/explain_recordings.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <optional>

#include "gap/traits.h"
#include "gap/verdict/words.h"
#include "statistics/robust.h"

namespace joulecast::gap::posterior {
namespace {

std::vector<DiagnosedParameter> parameters_of(const Hypothesis& h, const Eigen::VectorXd& strength,
                                              double sd) {
  if (!h.covariate.empty()) return {{"coefficient", h.unit, strength[0], sd}};
  std::vector<DiagnosedParameter> out;
  for (std::size_t k = 0; k < h.effect.effect->info().parameters.size(); ++k) {
    const auto& p = h.effect.effect->info().parameters[k];
    double value = h.effect.values[k];
    if (strength.size() == 2)
      value = k == 0 ? strength.norm() : std::atan2(strength[1], strength[0]);
    else if (k == h.parameter)
      value = strength[0];
    out.push_back({std::string(p.name), std::string(p.unit), value, k == h.parameter ? sd : missing});
  }
  return out;
}

// Smallest share of power at which these data show `detected_part` of the effects, at `detected_sd` of their
// estimates; infinite above the whole power.
double detectable_share(const Fit& fit, const View& view) {
  std::vector<double> shares;
  for (std::size_t h = 0; h < fit.prior->size(); ++h) {
    const double share = fit.equations.share[ix(fit.catalogue.first_column(h))];
    if (share > 0) shares.push_back(detected_sd * share / std::sqrt(std::max(view.precision(h), 1e-300)));
  }
  constexpr double no_limit = std::numeric_limits<double>::infinity();
  const double share = shares.empty() ? no_limit : statistics::quantile(shares, detected_part);
  return share > 1 ? no_limit : share;
}

// The strengths of one effect in one shape, and the parts of a slope along two headings, as one.
void join_same(std::vector<dynamics::ActiveEffect>& effects) {
  for (std::size_t a = 0; a < effects.size(); ++a) {
    const auto& parameters = effects[a].effect->info().parameters;
    for (std::size_t b = effects.size() - 1; b > a; --b) {
      bool same = effects[b].effect == effects[a].effect;
      for (std::size_t k = 1; same && k < parameters.size(); ++k)
        same = parameters[k].strength || effects[b].values[k] == effects[a].values[k];
      if (!same) continue;
      for (std::size_t k = 0; k < parameters.size(); ++k)
        if (k == 0 || parameters[k].strength) effects[a].values[k] += effects[b].values[k];
      effects.erase(effects.begin() + static_cast<std::ptrdiff_t>(b));
    }
  }
  const auto is_slope = [](const dynamics::ActiveEffect& e) { return e.effect->info().id == "slope"; };
  const auto first = std::ranges::find_if(effects, is_slope);
  if (first == effects.end()) return;
  double x = 0, y = 0;
  for (const dynamics::ActiveEffect& e : effects) {
    if (!is_slope(e)) continue;
    x += e.values[0] * std::cos(e.values[1]);
    y += e.values[0] * std::sin(e.values[1]);
  }
  dynamics::ActiveEffect joined = *first;
  joined.values[0] = std::hypot(x, y);
  joined.values[1] = std::atan2(y, x);
  std::erase_if(effects, is_slope);
  effects.push_back(joined);
}

class Explainer {
 public:
  explicit Explainer(const Fit& fit) : fit_(fit), view_(*fit.prior, fit.reduced[fit.factor]) {}

  Explained explain() {
    Eigen::VectorXd p = bagged(*fit_.prior, fit_.grams, fit_.models);
    predict(p);
    const bool any_named =
        std::ranges::any_of(summary_.effects, [](const Found& f) { return f.group >= named; });
    if (!any_named && summary_.outside >= named && a_.held_out.known && !function_helps()) {
      state_useless_function();
      predict(p = without_functions(p), false);
    }
    a_.none = summary_.none;
    for (std::size_t f = 0; f < factor_count; ++f) a_.factors[f] = fit_.plain.factor[ix(f)];
    a_.detectable = detectable_share(fit_, view_);
    for (std::size_t c = 0; c < fit_.noise.size(); ++c) {
      const Channel channel = fit_.equations.channels[c].channel;
      if (channel == Channel::power || channel == Channel::bus)
        a_.noise = fit_.noise[c].sigma / fit_.data.mean_power_w;
    }
    for (std::size_t k = 0; k < summary_.effects.size(); ++k)
      add_effect(summary_.effects[k], a_.held_out.share[k]);
    std::ranges::stable_sort(a_.effects, std::greater(), &ExplainedBy::probability);
    add_outside();
    share_with_function();
    choose_model();
    judge();
    return std::move(a_);
  }

 private:
  void predict(const Eigen::VectorXd& p, bool with_functions = true) {
    summary_ = summarise(fit_, p);
    a_.held_out = hold_out(fit_, summary_.effects, summary_.function, with_functions);
  }

  // A function outside the catalogue must improve the prediction of held-out data.
  bool function_helps() const {
    const HeldOut& h = a_.held_out;
    return h.function_all < std::min(h.function_effects, h.function_file) - clear_gain;
  }

  void state_useless_function() {
    a_.reasons.push_back(fmt::format(
        "a dependence on {} is not the verdict: it reduces the error on held-out data by less than {:.0f} % "
        "of the power ({:.1f} % with it, {:.1f} % without)",
        words_of(fit_.functions[*summary_.function].variable), 100 * clear_gain,
        100 * a_.held_out.function_all,
        100 * std::min(a_.held_out.function_effects, a_.held_out.function_file)));
  }

  // The posterior given that no function is present.
  Eigen::VectorXd without_functions(Eigen::VectorXd p) const {
    for (std::size_t k = 0; k < fit_.models.size(); ++k)
      if (fit_.models[k].configuration) p[ix(k)] = 0;
    return p / std::max(p.sum(), 1e-300);
  }

  // The strength of a hypothesis in a model, by column.
  Eigen::VectorXd strength_of(std::size_t model, std::size_t hypothesis) const {
    const Model& m = fit_.models[model];
    return view_.coefficients(m.set, fit_.strengths[model].mean,
                              m.configuration)(fit_.catalogue.hypotheses[hypothesis].columns);
  }

  void add_effect(const Found& found, double held_out_share) {
    const Model& model = fit_.models[found.model];
    const std::size_t h = model.set[found.member];
    const Hypothesis& hypothesis = fit_.catalogue.hypotheses[h];
    const Eigen::VectorXd own = strength_of(found.model, h);
    ExplainedBy e;
    e.id = found.id;
    if (hypothesis.is_effect()) e.calibrates = traits_of(e.id).calibrates;
    for (const std::string& other : found.alternatives) add_instead(e, other);
    e.hypothesis = h;
    e.bagged = found.probability;
    const Constancy own_constancy =
        found.probability > least_listed ? constancy(fit_, model.set, found.member) : Constancy{};
    e.constant = own_constancy.probability;
    e.varies = own_constancy.scatter;
    e.probability = e.bagged * e.constant;
    e.share = held_out_share;
    e.alternatives = found.alternatives;
    e.group = found.group * e.constant;
    e.power_share = own.norm() * fit_.equations.share[ix(hypothesis.columns[0])];
    e.parameters = parameters_of(hypothesis, own, fit_.strengths[found.model].sd[ix(found.member)]);
    if (e.group >= named && (e.share < least_gap_share || e.share > most_gap_share))
      withhold(
          e,
          fmt::format(
              "the effect {} is not named: its share of the explained gap on held-out data is {:.1f}\u00a0%, "
              "must be {:.0f} to {:.0f}\u00a0%",
              words_of(e.id), 100 * e.share, 100 * least_gap_share, 100 * most_gap_share));
    e.at_bound = own.size() == 1 && at_bound(hypothesis, own[0]);
    if (e.group >= named && e.at_bound)
      withhold(e, fmt::format("the effect {} is not named: its estimate is at its bound", words_of(e.id)));
    a_.effects.push_back(std::move(e));
  }

  // Adds an alternative with its strength in the likeliest model without the effect.
  void add_instead(ExplainedBy& e, const std::string& other) const {
    const auto has = [&](const Model& m, const std::string& id) {
      return std::ranges::find(m.set, id, [&](std::size_t h) { return fit_.catalogue.hypotheses[h].id(); }) !=
             m.set.end();
    };
    std::optional<std::size_t> best;
    for (std::size_t k = 0; k < fit_.models.size(); ++k) {
      if (!has(fit_.models[k], other) || has(fit_.models[k], e.id)) continue;
      if (!best || fit_.plain.log_joint[ix(k)] > fit_.plain.log_joint[ix(*best)]) best = k;
    }
    if (!best) return;
    for (const std::size_t h : fit_.models[*best].set) {
      const Hypothesis& hypothesis = fit_.catalogue.hypotheses[h];
      if (hypothesis.id() != other || !hypothesis.is_effect()) continue;
      robot::AdoptedEffect& adopted = e.instead.emplace_back(other);
      for (const DiagnosedParameter& p : parameters_of(hypothesis, strength_of(*best, h), missing))
        adopted.parameters.emplace_back(p.name, p.value);
    }
  }

  void withhold(ExplainedBy& e, std::string reason) {
    e.probability = std::min(e.probability, withheld);
    e.group = withheld;
    a_.reasons.push_back(std::move(reason));
  }

  void add_outside() {
    a_.outside.probability = summary_.outside;
    a_.outside_share = summary_.function_share;
    if (!summary_.function) return;
    a_.outside.channel = name_of(fit_.functions[*summary_.function].channel);
    a_.outside.follows = fit_.functions[*summary_.function].variable;
  }

  // A function outside the catalogue that predicts takes its share of the power that it and an effect move.
  void share_with_function() {
    const bool helps = summary_.outside >= named && a_.held_out.known && function_helps();
    if (!helps || !fit_.data.group.empty()) return;
    for (ExplainedBy& e : a_.effects) {
      const double part = e.power_share / std::max(e.power_share + a_.outside_share, 1e-300);
      e.probability *= part;
      e.group *= part;
    }
  }

  bool at_bound_at(const Eigen::VectorXd& strengths, std::size_t column) const {
    return at_bound(fit_.catalogue.hypotheses[fit_.catalogue.columns[column].hypothesis],
                    strengths[ix(column)]);
  }

  // A robot file has no covariates: the part that follows one goes to the effect that carries it, with the
  // closest power.
  void move_covariates(Eigen::VectorXd& strengths) const {
    const auto& columns = fit_.catalogue.columns;
    for (std::size_t k = 0; k < columns.size(); ++k) {
      if (!columns[k].by || strengths[ix(k)] == 0) continue;
      const auto carrier = std::ranges::find_if(columns, [&](const EffectColumn& c) {
        return !c.by && c.effect.effect == columns[k].effect.effect && c.parameter == columns[k].parameter;
      });
      const Eigen::Index to = carrier - columns.begin();
      const auto moved = fit_.equations.moved.col(to);
      strengths[to] += strengths[ix(k)] * moved.dot(fit_.equations.moved.col(ix(k))) /
                       std::max(moved.squaredNorm(), 1e-300);
      strengths[ix(k)] = 0;
    }
  }

  // Moves a strength without a parameter in the robot file to the parameter with the closest power, where
  // power alone was measured and the two differ by less than `equivalent` of it. Those with a name are kept.
  void move_to_file(Eigen::VectorXd& strengths) const {
    const Equations& e = fit_.equations;
    for (std::size_t k = 0; k < e.effects; ++k) {
      const EffectColumn& from = fit_.catalogue.columns[k];
      const std::string_view id = from.effect.effect->info().id;
      const auto own = std::ranges::find(a_.effects, id, &ExplainedBy::id);
      if (strengths[ix(k)] == 0 || from.by || !traits_of(id).calibrates.empty() ||
          (own != a_.effects.end() && own->probability >= named))
        continue;
      const Eigen::VectorXd moved = strengths[ix(k)] * e.moved.col(ix(k));
      double least = equivalent * fit_.data.mean_power_w;
      Eigen::VectorXd best = strengths;
      for (std::size_t q = 0; q < e.effects; ++q) {
        const EffectColumn& to = fit_.catalogue.columns[q];
        const Traits& traits = traits_of(to.effect.effect->info().id);
        const double size = e.moved.col(ix(q)).squaredNorm();
        if (traits.calibrates.empty() || traits.elsewhere || to.by || to.parameter != 0 || size == 0)
          continue;
        const double strength = e.moved.col(ix(q)).dot(moved) / size;
        const double off_w = (moved - strength * e.moved.col(ix(q))).cwiseAbs().mean();
        Eigen::VectorXd changed = strengths;
        changed[ix(k)] = 0;
        changed[ix(q)] += strength;
        if (off_w >= least || changed != bounded(fit_.catalogue, changed) || at_bound_at(changed, q))
          continue;
        least = off_w;
        best = std::move(changed);
      }
      strengths = std::move(best);
    }
  }

  // The strengths of the prediction are those that were tested on held-out parts: the mean over the models
  // without a function, by a step from the point of the walk. At an end of its range a strength is no
  // estimate: the file's value is kept.
  void choose_model() {
    Eigen::VectorXd strengths = mean_strengths(fit_, fit_.once());
    if (fit_.data.power) {
      const Step step = damped_step(fit_, strengths, fit_.once());
      if (missed(fit_.data, power_of(fit_, strengths)) > step.missed + clear_gain) strengths = step.strengths;
    }
    for (std::size_t k = 0; k < fit_.catalogue.columns.size(); ++k)
      if (at_bound_at(strengths, k)) strengths[ix(k)] = 0;
    if (fit_.data.at_readings()) move_to_file(strengths);
    if (fit_.data.power) {
      const Eigen::VectorXd measured = fit_.data.rows.measured_w();
      a_.repeats_file = repeated_part(fit_.data, measured - fit_.unchanged_w);
      a_.explained_w = power_of(fit_, strengths);
      a_.repeats_left = repeated_part(fit_.data, measured - a_.explained_w);
      if (fit_.data.of_instants()) {
        PowerTerms found = power_terms(fit_, a_.explained_w);
        a_.terms = std::move(found.terms);
        a_.sums = std::move(found.sums);
      }
    }
    const HeldOut& h = a_.held_out;
    a_.adopts = h.known && removed_interval(h.blocks)[0] > 0 &&
                missed(fit_.data, power_of(fit_, strengths)) < fit_.gap;
    if (fit_.data.power) move_covariates(strengths);
    a_.model = in_force(fit_.data, fit_.catalogue, strengths);
    a_.model.erase(a_.model.begin(),
                   a_.model.begin() + static_cast<std::ptrdiff_t>(fit_.data.in_file.size()));
    join_same(a_.model);
  }

  void cap_effects(double most = withheld) {
    for (ExplainedBy& e : a_.effects)
      e.probability = std::min(e.probability, most), e.group = std::min(e.group, most);
  }

  void judge() {
    const HeldOut& h = a_.held_out;
    // Where power is all that shows them, effects are no likelier than that they predict it.
    if (h.known && fit_.data.at_readings()) cap_effects(chance_of_benefit(h.blocks));
    double moved = 0;
    for (const ExplainedBy& e : a_.effects) moved += e.group >= named ? e.power_share : 0;
    Verdict v = Verdict::inconclusive;
    if (summary_.none >= named)
      v = Verdict::none;
    else if (summary_.outside >= named && a_.outside_share > moved)
      v = Verdict::outside;
    else if (std::ranges::any_of(a_.effects, [](const ExplainedBy& e) { return e.group >= named; }))
      v = Verdict::effects;
    else if (!a_.effects.empty() && summary_.outside > considered)
      v = Verdict::outside;
    a_.probability = v == Verdict::none ? summary_.none : 0;
    // A function that does not predict is no evidence against effects that do.
    if (v == Verdict::outside && !function_predicts())
      v = surest() >= named ? Verdict::effects : Verdict::inconclusive;
    const bool mismatched = h.known && h.file - h.explanation > mismatched_file;
    // A function of the motion is then the file's: of speed, acceleration or turning.
    constexpr std::array<std::string_view, 3> motion{"speed", "acceleration", "yaw_rate"};
    const bool other = v == Verdict::outside && std::ranges::find(motion, a_.outside.follows) == motion.end();
    if (!other && (mismatched || (v == Verdict::effects && h.file > mismatched_file)))
      v = Verdict::not_this_robot;
    if (v == Verdict::effects || v == Verdict::not_this_robot)
      v = effects_predict() ? v : Verdict::inconclusive;
    const auto none = v == Verdict::effects || v == Verdict::outside || v == Verdict::inconclusive
                          ? probability_of_none(v)
                          : std::nullopt;
    if (none) {
      v = Verdict::none;
      a_.probability = *none;
      cap_effects();
      a_.outside.probability = std::min(a_.outside.probability, withheld);
    }
    if (v == Verdict::none && a_.detectable > detectable) {
      v = Verdict::inconclusive;
      a_.reasons.push_back(
          std::isfinite(a_.detectable)
              ? fmt::format("gaps below {:.1f} % of the power are not detectable in these data",
                            100 * a_.detectable)
              : "many effects are not detectable in these data, whatever their size");
    }
    if (v == Verdict::none && gap_is_left()) {
      v = Verdict::inconclusive;
      a_.reasons.push_back(fmt::format(
          "no cause was found, but the gap is not noise alone: on held-out data the error is {:.1f} % "
          "of the power with the robot file and {:.1f} % with a calibrated file, and {:.1f} % repeats",
          100 * h.file, 100 * h.explanation, 100 * a_.repeats_file));
    }
    a_.verdict = v;
    if (v != Verdict::none) a_.probability = v == Verdict::outside ? a_.outside.probability : surest();
  }

  double surest() const {
    double most = 0;
    for (const ExplainedBy& e : a_.effects) most = std::max(most, e.group);
    return most;
  }

  // Practical equivalence: the joint reduction by effects and functions on held-out data is less than a gap
  // worth a name, or effects predict power worse than the file and the regression no better; and no effect is
  // visible in channels without power. Absent where that does not hold.
  std::optional<double> probability_of_none(Verdict v) const {
    const HeldOut& h = a_.held_out;
    const bool elsewhere = std::ranges::any_of(a_.effects, [&](const ExplainedBy& e) {
      return e.bagged * e.constant >= named && shows_elsewhere(fit_, fit_.catalogue.hypotheses[e.hypothesis]);
    });
    if (!h.known || elsewhere || gap_is_left()) return std::nullopt;
    const bool worse =
        v != Verdict::outside && h.explanation > h.file + clear_gain && h.regression > h.file - clear_gain;
    if (!worse)
      return h.removed >= clear_gain || h.too_little < named ? std::nullopt : std::optional(h.too_little);
    const auto without = std::ranges::count_if(
        h.blocks, [](const HeldOut::Block& b) { return b.file - b.explanation < clear_gain * b.size; });
    return static_cast<double>(without) / static_cast<double>(h.blocks.size());
  }

  // A difference that a calibration removes, or that repeats, is a gap without a name.
  bool gap_is_left() const {
    const HeldOut& h = a_.held_out;
    return h.known && (h.file - h.explanation > clear_gain || a_.repeats_file > detectable);
  }

  bool function_predicts() {
    const HeldOut& h = a_.held_out;
    if (!h.known) return true;
    if (!function_helps()) {
      state_useless_function();
      return false;
    }
    return !more_repeats(h.repeats_left);
  }

  bool more_repeats(double left) {
    if (!(left > std::max(repeats_left * a_.repeats_file, detectable))) return false;
    a_.reasons.push_back(
        fmt::format("of a repeating error of {:.1f} % of the power {:.1f} % remain: a larger cause is left",
                    100 * a_.repeats_file, 100 * left));
    cap_effects();
    return true;
  }

  bool effects_predict() {
    const HeldOut& h = a_.held_out;
    if (!h.known) return true;
    if (h.explanation > h.file + clear_gain) {
      a_.reasons.push_back(fmt::format(
          "on held-out data the error is {:.1f} % of the power with the robot file and {:.1f} % with the "
          "effects found",
          100 * h.file, 100 * h.explanation));
      cap_effects();
      return false;
    }
    return !more_repeats(a_.repeats_left);
  }

  const Fit& fit_;
  View view_;  // of all blocks
  Summary summary_;
  Explained a_;
};

}  // namespace

Explained explain(const Fit& fit) {
  Explained answer = Explainer(fit).explain();
  // Groups are compared in power alone. Where power leaves open how well the robot matches its file, a
  // difference in other channels may be the file's.
  const bool open = answer.verdict == Verdict::inconclusive || answer.verdict == Verdict::not_this_robot;
  if (open || !fit.data.at_readings() || fit.data.windows.empty() || !fit.data.group.empty()) return answer;
  for (const Witness witness : {Witness::terminals, Witness::kinematics}) {
    const std::unique_ptr<Fit> own = walk(rows_of_witness(fit.data, witness, fit.plain.factor));
    if (own->equations.channels.empty()) continue;
    for (ExplainedBy& e : Explainer(*own).explain().effects) {
      const bool known = std::ranges::any_of(answer.effects, [&](const ExplainedBy& of) {
        return of.id == e.id || std::ranges::find(e.alternatives, of.id) != e.alternatives.end();
      });
      if (known || e.group < named) continue;
      if (answer.verdict == Verdict::none) answer.verdict = Verdict::effects, answer.probability = 0;
      if (answer.verdict == Verdict::effects) answer.probability = std::max(answer.probability, e.group);
      answer.model.push_back(own->catalogue.hypotheses[e.hypothesis].effect);
      for (std::size_t k = 0; k < e.parameters.size(); ++k)
        answer.model.back().values[k] = e.parameters[k].value;
      answer.effects.push_back(std::move(e));
    }
  }
  std::ranges::stable_sort(answer.effects, std::greater(), &ExplainedBy::probability);
  return answer;
}

}  // namespace joulecast::gap::posterior

#include "gap/groups/comparer.h"

#include <algorithm>
#include <cmath>
#include <random>
#include <set>

#include "gap/diagnose/account.h"
#include "gap/diagnose/naming.h"
#include "gap/diagnose/power_fit.h"
#include "gap/verdict/judge.h"
#include "statistics/shapley.h"

namespace joulecast::gap {
namespace {

constexpr std::size_t max_group_folds = 6;
constexpr std::size_t max_group_shared_causes = 4;  // causes that all groups share
constexpr double progress_after_folds = 0.7;        // of the progress

// A cause that differs between groups.
struct Contrasted {
  std::size_t hypothesis = 0;
  Eigen::MatrixXd strengths, deviations;  // groups by coefficients, beside the mean over all
  std::size_t low = 0, high = 0;          // the groups that are furthest apart
};

// What all groups have.
struct Shared {
  std::vector<Cause> causes;  // the same in all
  struct Mean {
    std::size_t hypothesis = 0;
    Eigen::VectorXd coefficients;
  };
  std::vector<Mean> means;  // of what differs between groups
};

// Of these hypotheses alone.
Mixture::Estimate estimate_of(const Problem& problem, const HypothesisSet& set,
                              const std::vector<bool>& out) {
  std::vector<std::size_t> own = columns_of(problem.hypotheses, set);
  if (own.empty()) return {};
  std::ranges::sort(own);
  return Mixture(problem, out, own).estimate(set);
}

// The likely causes, or else the one that the data speak for most.
HypothesisSet named_in(const Problem& problem, const Explanation& explanation) {
  const HypothesisSet likely = likely_causes(problem, explanation);
  const auto candidate = std::ranges::find(explanation.members, true, &Member::candidate);
  if (!likely.empty() || candidate == explanation.members.end()) return likely;
  return {candidate->hypothesis};
}

class Comparer {
 public:
  Comparer(const GroupedData& data, const CompareSettings& settings, Comparison& comparison)
      : data_(data), settings_(settings), c_(comparison), groups_(comparison.groups.size()) {}

  bool run();

 private:
  bool goes_on(double part) const { return !settings_.progress || settings_.progress(part); }
  bool power_known() const { return c_.diagnosis.power != PowerSource::none; }
  std::vector<Contrasted> contrasted(const Mixture::Estimate& differences, const HypothesisSet& set) const;
  Shared shared_beside(const Problem& base, const std::vector<Contrasted>& causes,
                       const std::vector<bool>& out) const;
  std::vector<double> predict(const Shared& shared, const std::vector<Contrasted>& causes) const;
  double error(const std::vector<double>& predicted, const std::vector<bool>& out = {}) const;
  Problem alike(Problem base, const std::vector<Contrasted>& causes) const;
  std::vector<Controls> permuted(const Mixture& mixture, const Explanation& explanation) const;
  bool hold_out();
  Explanation explanation_of(const std::vector<Contrasted>& members) const;
  void measure_common();
  void add_differences();
  void add_baseline();
  void judge_all();

  const GroupedData& data_;
  const CompareSettings& settings_;
  Comparison& c_;
  std::size_t groups_;
  Problem problem_;
  Explanation explanation_;
  HypothesisSet named_;
  std::vector<Contrasted> causes_;
  Shared shared_;
  std::vector<double> common_;  // of every item, by the model with what all groups share
  std::optional<HeldOut> held_out_;
  std::vector<Controls> controls_;
};

std::vector<Contrasted> Comparer::contrasted(const Mixture::Estimate& differences,
                                             const HypothesisSet& set) const {
  std::vector<Contrasted> result;
  Eigen::Index at = 0;
  for (const std::size_t h : set) {
    const auto n = static_cast<Eigen::Index>(problem_.hypotheses[h].candidate.columns.size());
    const auto own = n / static_cast<Eigen::Index>(groups_ - 1);
    Contrasted c;
    c.hypothesis = h;
    c.strengths = by_group(differences.mean.segment(at, n), data_.group_of_block, groups_);
    c.deviations = Eigen::MatrixXd::Zero(c.strengths.rows(), own);
    for (Eigen::Index g = 1; g < c.strengths.rows(); ++g)
      c.deviations.row(g) = differences.sd.segment(at + (g - 1) * own, own).transpose();
    // The first group is known as well as the others are beside it.
    c.deviations.row(0) = c.deviations.bottomRows(c.deviations.rows() - 1).colwise().mean();
    double furthest = -1;
    for (std::size_t a = 0; a < groups_; ++a) {
      for (std::size_t b = 0; b < groups_; ++b) {
        const auto ga = static_cast<Eigen::Index>(a), gb = static_cast<Eigen::Index>(b);
        const double apart = (c.strengths.row(gb) - c.strengths.row(ga)).norm();
        if (apart <= furthest || (own == 1 && c.strengths(gb, 0) < c.strengths(ga, 0))) continue;
        furthest = apart;
        c.low = a, c.high = b;
      }
    }
    result.push_back(std::move(c));
    at += n;
  }
  return result;
}

// What all groups share is sought, and its strengths are estimated, where what differs between groups has
// left the data: together, as each of them would otherwise be taken for all the others. What differs is
// there, so that nothing speaks against its having a mean beforehand. Far from what is linear that may
// predict worse than what everything is linear around, which stays then.
Shared Comparer::shared_beside(const Problem& base, const std::vector<Contrasted>& causes,
                               const std::vector<bool>& out) const {
  Problem rest = alike(base, causes);
  const auto differs = [&](const Hypothesis& h) {
    return std::ranges::find_if(causes, [&](const Contrasted& c) {
      return !h.outside() && rest.hypotheses[c.hypothesis].cause().same_kind(h.cause());
    });
  };
  for (Hypothesis& h : rest.hypotheses) {
    if (differs(h) != causes.end()) h.candidate.log_prior = 0;
  }
  ExplainSettings settings = data_.explain;
  settings.most_members = max_group_shared_causes;
  settings.candidate = false;
  HypothesisSet set;
  for (const Member& m : explain(rest, out, settings).members) {
    const Hypothesis& h = rest.hypotheses[m.hypothesis];
    if (h.outside()) continue;
    const auto other = differs(h);
    set = with(std::move(set), other == causes.end() ? m.hypothesis : other->hypothesis);
  }
  const Eigen::VectorXd levels = estimate_of(rest, set, out).mean;
  Shared shared, around{data_.around, {}};
  for (const Contrasted& c : causes) {
    around.means.push_back({c.hypothesis, Eigen::VectorXd::Zero(c.strengths.cols())});
    // The mean of what only differs is that of the robot file.
    if (!std::ranges::binary_search(set, c.hypothesis)) shared.means.push_back(around.means.back());
  }
  Eigen::Index at = 0;
  for (const std::size_t h : set) {
    const auto n = static_cast<Eigen::Index>(rest.hypotheses[h].candidate.columns.size());
    if (differs(rest.hypotheses[h]) != causes.end())
      shared.means.push_back({h, levels.segment(at, n)});
    else
      shared.causes.push_back(data_.cause(h, levels.segment(at, n)));
    at += n;
  }
  if (power_known() && error(predict(around, causes), out) < error(predict(shared, causes), out))
    return around;
  return shared;
}

std::vector<double> Comparer::predict(const Shared& shared, const std::vector<Contrasted>& causes) const {
  std::vector<std::vector<Cause>> by_group(groups_, shared.causes);
  for (std::size_t g = 0; g < groups_; ++g) {
    for (const Shared::Mean& mean : shared.means) {
      Eigen::VectorXd own = mean.coefficients;
      const auto c = std::ranges::find(causes, mean.hypothesis, &Contrasted::hypothesis);
      if (c != causes.end()) own += c->strengths.row(static_cast<Eigen::Index>(g)).transpose();
      by_group[g].push_back(data_.cause(mean.hypothesis, own));
    }
  }
  return data_.predict(by_group);
}

double Comparer::error(const std::vector<double>& predicted, const std::vector<bool>& out) const {
  double sum = 0, size = 0;
  for (std::size_t k = 0; k < data_.items.size(); ++k) {
    const Item& item = data_.items[k];
    if ((!out.empty() && out[item.block]) || !std::isfinite(item.measured + predicted[k])) continue;
    sum += item.weight * std::fabs(item.measured - predicted[k]);
    size += item.weight * std::fabs(item.measured);
  }
  return size > 0 ? sum / size : missing;
}

// The base problem as it would be if all groups were the mean one: what these explain of each block by its
// group has left its response.
Problem Comparer::alike(Problem base, const std::vector<Contrasted>& causes) const {
  HypothesisSet set;
  for (const Contrasted& c : causes) set.push_back(c.hypothesis);
  for (std::size_t g = 0; g < groups_; ++g) {
    Eigen::VectorXd own(0);
    for (const Contrasted& c : causes) {
      own.conservativeResize(own.size() + c.strengths.cols());
      own.tail(c.strengths.cols()) = c.strengths.row(static_cast<Eigen::Index>(g)).transpose();
    }
    std::vector<bool> of_group;
    for (const std::size_t block_group : data_.group_of_block) of_group.push_back(block_group == g);
    take_out(base, set, own, of_group);
  }
  return base;
}

// Takes all differences out, and shuffles which block is of which group: how often is the same found?
std::vector<Controls> Comparer::permuted(const Mixture& mixture, const Explanation& explanation) const {
  const Problem& problem = mixture.problem();
  std::vector<Controls> controls(explanation.members.size(), Controls{settings_.controls, 0});
  if (explanation.members.empty()) return controls;
  const Problem rest = alike(data_.base, contrasted(mixture.estimate(explanation.whole), explanation.whole));
  ExplainSettings quick = data_.explain;
  quick.candidate = false;
  for (std::size_t s = 0; s < settings_.controls; ++s) {
    std::mt19937_64 random(s + 1);
    std::vector<std::size_t> order = data_.group_of_block;
    std::ranges::shuffle(order, random);
    const Problem surrogate = contrast(rest, order, groups_);
    const Explanation answer = explain(surrogate, {}, quick);
    for (std::size_t m = 0; m < controls.size(); ++m) {
      const std::set<std::string> group = stated_ids(problem, explanation.members[m]);
      controls[m].named_in += finds(answer, surrogate, group) ? 1 : 0;
    }
    if (!goes_on(std::lerp(progress_after_folds, 1.0,
                           static_cast<double>(s + 1) / static_cast<double>(settings_.controls))))
      return {};
  }
  return controls;
}

bool Comparer::hold_out() {
  HeldOut held;
  const std::size_t blocks = data_.group_of_block.size();
  held.blocks.resize(blocks);
  // Every part has blocks of every group where there are enough.
  std::vector<std::size_t> part_of(blocks), seen(groups_, 0);
  std::size_t most = 0;
  for (std::size_t b = 0; b < blocks; ++b) most = std::max(most, ++seen[data_.group_of_block[b]]);
  held.parts = std::clamp<std::size_t>(most, 2, max_group_folds);
  std::ranges::fill(seen, 0u);
  for (std::size_t b = 0; b < blocks; ++b) part_of[b] = seen[data_.group_of_block[b]]++ % held.parts;
  for (std::size_t part = 0; part < held.parts; ++part) {
    std::vector<bool> out(blocks), use(data_.items.size());
    for (std::size_t b = 0; b < blocks; ++b) out[b] = part_of[b] == part;
    for (std::size_t k = 0; k < use.size(); ++k) use[k] = !out[data_.items[k].block];
    const Problem base = data_.without(out);
    const Problem problem = contrast(base, data_.group_of_block, groups_);
    const HypothesisSet named = named_in(problem, explain(problem, out, data_.explain));
    std::vector<std::string> ids;
    for (const std::size_t h : named) ids.push_back(problem.hypotheses[h].id());
    held.named.push_back(std::move(ids));
    if (power_known()) {
      const std::vector<Contrasted> causes = contrasted(estimate_of(problem, named, out), named);
      const Shared shared = shared_beside(base, causes, out);
      const std::vector<double> common = predict(shared, {}), predicted = predict(shared, causes);
      std::vector<double> missed;
      for (std::size_t k = 0; k < use.size(); ++k) missed.push_back(data_.items[k].measured - common[k]);
      const std::vector<double> refereed = data_.referee(missed, use);
      for (std::size_t k = 0; k < use.size(); ++k) {
        const Item& item = data_.items[k];
        if (use[k] || !std::isfinite(missed[k])) continue;
        BlockErrors& b = held.blocks[item.block];
        b.unchanged += item.weight * std::fabs(missed[k]);
        b.explained += item.weight * std::fabs(item.measured - predicted[k]);
        b.referee += item.weight * std::fabs(missed[k] - refereed[k]);
        b.size += item.weight * std::fabs(item.measured);
      }
    }
    if (!goes_on(progress_after_folds * static_cast<double>(part + 1) / static_cast<double>(held.parts)))
      return false;
  }
  held_out_ = std::move(held);
  return true;
}

// How the model with what all groups share stands to what was measured.
void Comparer::measure_common() {
  common_ = predict(shared_, {});
  for (const Cause& cause : shared_.causes) {
    const auto same = [&](const Hypothesis& h) { return !h.outside() && h.cause().same_kind(cause); };
    if (std::ranges::none_of(causes_,
                             [&](const Contrasted& c) { return same(problem_.hypotheses[c.hypothesis]); }))
      c_.common.push_back(std::ranges::find_if(problem_.hypotheses, same)->id());
  }
  Diagnosis& d = c_.diagnosis;
  if (!power_known()) {
    for (ComparedGroup& group : c_.groups) group.model_per_m_j = missing;
    d.energy_relative = d.power_absolute_relative = d.noise_floor = missing;
    return;
  }
  std::vector<double> energy(groups_, 0);
  double measured_j = 0, missed_j = 0;
  for (std::size_t k = 0; k < common_.size(); ++k) {
    const Item& item = data_.items[k];
    if (!std::isfinite(item.measured + common_[k])) continue;
    energy[item.group] += item.energy_per_unit * common_[k];
    measured_j += item.energy_per_unit * item.measured;
    missed_j += item.energy_per_unit * (item.measured - common_[k]);
  }
  for (std::size_t g = 0; g < groups_; ++g) c_.groups[g].model_per_m_j = energy[g] / c_.groups[g].way_m;
  d.energy_relative = missed_j / measured_j;
  d.power_absolute_relative = error(common_);
  d.noise_floor = std::min(d.noise_floor, d.power_absolute_relative);
}

void Comparer::add_differences() {
  std::vector<double> per_m(groups_, missing);
  for (std::size_t g = 0; g < groups_; ++g) per_m[g] = c_.groups[g].energy_per_m_j;
  std::optional<GroupDifference> d;
  if (power_known() && std::ranges::all_of(per_m, [](double e) { return std::isfinite(e); })) {
    d.emplace();
    d->from = static_cast<std::size_t>(std::ranges::min_element(per_m) - per_m.begin());
    d->to = static_cast<std::size_t>(std::ranges::max_element(per_m) - per_m.begin());
    d->energy_per_m_j = per_m[d->to] - per_m[d->from];
    d->by_motion_j = c_.groups[d->to].model_per_m_j - c_.groups[d->from].model_per_m_j;
    d->unexplained_j = d->energy_per_m_j - d->by_motion_j;
  }
  for (const Contrasted& c : causes_) {
    const Hypothesis& h = data_.base.hypotheses[c.hypothesis];
    ComparedEffect e;
    e.id = h.id();
    const auto& info = h.effect.effect->info().parameters[h.parameter];
    e.parameter = h.is_effect() ? std::string(info.name) : "coefficient";
    e.unit = h.is_effect() ? std::string(info.unit) : h.unit;
    const std::vector<double> with = power_known() ? predict(shared_, {c}) : common_;
    std::vector<double> energy(groups_, 0);
    for (std::size_t k = 0; k < with.size(); ++k) {
      const Item& item = data_.items[k];
      if (std::isfinite(item.measured + common_[k]))
        energy[item.group] += item.energy_per_unit * (with[k] - common_[k]);
    }
    for (std::size_t g = 0; g < groups_; ++g) {
      const auto at = static_cast<Eigen::Index>(g);
      e.groups.push_back({c.strengths.cols() == 1 ? c.strengths(at, 0) : c.strengths.row(at).norm(),
                          c.deviations.row(at).norm(),
                          power_known() ? energy[g] / c_.groups[g].way_m : missing});
    }
    if (d) {
      d->by_effect_j.push_back(e.groups[d->to].energy_per_m_j - e.groups[d->from].energy_per_m_j);
      d->unexplained_j -= d->by_effect_j.back();
    }
    c_.effects.push_back(std::move(e));
  }
  c_.difference = std::move(d);
}

// The explanation as one of single strengths: the stronger group less the weaker.
Explanation Comparer::explanation_of(const std::vector<Contrasted>& members) const {
  Explanation e = explanation_;
  for (Member& m : e.members) {
    const auto c = std::ranges::find(members, m.hypothesis, &Contrasted::hypothesis);
    const auto low = static_cast<Eigen::Index>(c->low), high = static_cast<Eigen::Index>(c->high);
    const Eigen::VectorXd apart = (c->strengths.row(high) - c->strengths.row(low)).transpose();
    const Eigen::VectorXd sd =
        groups_ == 2
            ? Eigen::VectorXd(c->deviations.row(1).transpose())
            : Eigen::VectorXd((c->deviations.row(high).cwiseAbs2() + c->deviations.row(low).cwiseAbs2())
                                  .cwiseSqrt()
                                  .transpose());
    m.coefficients.assign(apart.begin(), apart.end());
    m.sd.assign(sd.begin(), sd.end());
  }
  return e;
}

void Comparer::add_baseline() {
  if (!power_known()) return;
  Diagnosis& d = c_.diagnosis;
  d.baseline = baseline_of(*held_out_);
  if (!named_.empty()) d.shrinkage = shrinkage_of(*held_out_, problem_.hypotheses, named_, d.noise_floor);
}

void Comparer::judge_all() {
  HypothesisSet members;
  for (const Member& m : explanation_.members) {
    if (!m.candidate) members = with(std::move(members), m.hypothesis);
  }
  std::vector<Contrasted> all = contrasted(estimate_of(problem_, members, {}), members);
  // A candidate is what it would be alone.
  std::ranges::copy_if(causes_, std::back_inserter(all), [&](const Contrasted& c) {
    return std::ranges::find(members, c.hypothesis) == members.end();
  });
  const Explanation explanation = explanation_of(all);
  Findings f{.problem = problem_,
             .explanation = explanation,
             .controls = controls_,
             .named = named_,
             .held_out = held_out_,
             .of_groups = true};
  for (const Contrasted& c : causes_) {
    const auto low = static_cast<Eigen::Index>(c.low), high = static_cast<Eigen::Index>(c.high);
    f.causes.push_back(data_.cause(c.hypothesis, (c.strengths.row(high) - c.strengths.row(low)).transpose()));
    double change = 0, time_s = 0;
    if (power_known()) {
      const std::vector<double> with = predict(shared_, {c});
      for (std::size_t k = 0; k < with.size(); ++k) {
        const Item& item = data_.items[k];
        if (!std::isfinite(with[k] + common_[k])) continue;
        change += item.energy_per_unit * std::fabs(with[k] - common_[k]);
        time_s += item.time_s;
      }
    }
    f.power_w.push_back(time_s > 0 ? change / time_s : missing);
  }
  if (power_known()) {
    f.shares = statistics::shapley_shares(causes_.size(), [&](const std::vector<std::size_t>& some) {
      std::vector<Contrasted> own;
      for (const std::size_t k : some) own.push_back(causes_[k]);
      return error(predict(shared_, own));
    });
  } else {  // ordered by what they move
    for (const std::size_t h : named_)
      f.shares.push_back(std::ranges::find(explanation.members, h, &Member::hypothesis)->share);
  }
  judge(c_.diagnosis, f, data_.robot);
  if (!power_known()) {
    for (DiagnosedEffect& e : c_.diagnosis.effects) e.share = missing;
  }
  c_.diagnosis.adoptable.clear();
  c_.diagnosis.corrections.clear();
  c_.diagnosis.refusal = "a robot file has one strength for all groups";
  if (c_.diagnosis.effects.empty()) c_.diagnosis.shrinkage.reset();
}

bool Comparer::run() {
  problem_ = contrast(data_.base, data_.group_of_block, groups_);
  const Mixture mixture(problem_);
  explanation_ = explain(mixture, {}, data_.explain);
  c_.diagnosis.detectable_share = seen_share(mixture);
  named_ = named_in(problem_, explanation_);
  causes_ = contrasted(estimate_of(problem_, named_, {}), named_);
  shared_ = shared_beside(data_.base, causes_, {});
  measure_common();
  if (!hold_out()) return false;
  controls_ = permuted(mixture, explanation_);
  if (controls_.size() != explanation_.members.size()) return false;
  if (settings_.controls == 0) controls_.clear();
  add_baseline();
  judge_all();
  add_differences();
  return true;
}

}  // namespace

bool compare_groups(const GroupedData& data, const CompareSettings& settings, Comparison& comparison) {
  return Comparer(data, settings, comparison).run();
}

}  // namespace joulecast::gap

#include "gap/diagnose/fewer_causes.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <set>

#include "gap/diagnose/naming.h"
#include "gap/diagnose/power_fit.h"
#include "gap/equations/zone_scan.h"
#include "statistics/bootstrap.h"

namespace joulecast::gap {
namespace {

constexpr std::size_t max_parsimony_folds = 6;
constexpr std::size_t function_size = 2;  // of a function outside the catalogue, counted in causes
constexpr std::size_t most_first_causes = 6, most_by_power = 2;  // that pairs are made of
constexpr double equal = 0.02;                     // of the price of a member, a nat of evidence
constexpr double formulas_off = 0.03;              // of what is left, that says nothing
constexpr double max_contested_probability = 0.7;  // most that evidence against it leaves of a probability

// Rows of a long recording, evenly, that are enough to compare sets by.
Rows thinned_power(const Equations& e) {
  constexpr std::size_t most_rows = 3000;
  const ChannelRows& all = e.rows[index_of(Channel::power)];
  const std::size_t every = (all.block.size() + most_rows - 1) / most_rows;
  std::vector<Eigen::Index> kept;
  Rows rows;
  ChannelRows& thin = rows[index_of(Channel::power)];
  for (std::size_t k = 0; k < all.block.size(); k += every) {
    kept.push_back(static_cast<Eigen::Index>(k));
    thin.window.push_back(all.window[k]);
    thin.block.push_back(all.block[k]);
    thin.resting.push_back(all.resting[k]);
  }
  thin.columns = all.columns;
  thin.x = all.x(kept, Eigen::all);
  thin.y = all.y(kept);
  return rows;
}

class ThirdJudge {
 public:
  ThirdJudge(const Equations& equations, const Mixture& mixture, Explanation& explanation)
      : rows_(thinned_power(equations)),
        e_{equations.columns, rows_, equations.noise, equations.left_out},
        mixture_(mixture),
        problem_(mixture.problem()),
        x_(explanation) {
    for (const Hypothesis& h : problem_.hypotheses) shows_elsewhere_.push_back(shown_elsewhere(equations, h));
    for (std::size_t b = 0; b < problem_.block_count(); ++b) {
      if (!e_.leaves_out(b)) blocks_.push_back(b);
    }
  }

  void run() {
    const HypothesisSet named = likely_causes(problem_, x_);
    HypothesisSet with_functions = named;
    for (const std::size_t h : named) {
      if (!in_search(h)) kept_.push_back(h);
    }
    for (const Member& m : x_.members) {
      if (told_outside(hypothesis(m.hypothesis), m)) with_functions.push_back(m.hypothesis);
    }
    std::ranges::sort(with_functions);
    kept_strengths_ = kept_.empty() ? Eigen::VectorXd() : mixture_.estimate(kept_).mean;
    add(kept_);
    add(named);
    add(with_functions);
    const std::vector<Variant> variants = best_variants(kept_);
    // What closes too little of all blocks closes too little of parts left out.
    const Errors& nothing = errors_.at(kept_);
    const double least = price_of_a_member();
    if (with_functions == kept_ && std::ranges::none_of(variants, [&](const Variant& v) {
          return nothing.blocks.sum() - v.left >= least || nothing.power - v.left_of_power >= least;
        }))
      return;
    for (const Variant& v : variants) add(with(kept_, v.hypothesis));
    const std::vector<HypothesisSet> firsts = best_singles();
    for (const std::size_t function : with_functions) {
      if (!hypothesis(function).outside()) continue;
      add(with(kept_, function));
      for (const HypothesisSet& first : firsts) add(with(first, function));
    }
    for (const HypothesisSet& first : firsts)
      for (const Variant& v : best_variants(first)) add(with(first, v.hypothesis));
    choose(with_functions);
  }

 private:
  const Hypothesis& hypothesis(std::size_t h) const { return problem_.hypotheses[h]; }
  bool in_search(std::size_t h) const {
    return !hypothesis(h).outside() && hypothesis(h).id() != zone_effect &&
           (shows_in_power(hypothesis(h)) || !shows_elsewhere_[h]);
  }
  bool fits(const HypothesisSet& set, std::size_t h) const {
    return std::ranges::none_of(
        set, [&](std::size_t o) { return o == h || hypothesis(o).excludes(hypothesis(h)); });
  }
  std::size_t size_of(const HypothesisSet& set) const {
    std::size_t size = 0;
    for (const std::size_t h : set) size += hypothesis(h).outside() ? function_size : 1;
    return size;
  }

  // Of each cause that may join, the variant that leaves least of all blocks [W, summed over rows].
  struct Variant {
    std::size_t hypothesis = 0;
    double left = 0, left_of_power = 0;
  };
  std::vector<Variant> best_variants(const HypothesisSet& base) const {
    std::map<std::string, Variant> best;
    for (std::size_t h = 0; h < problem_.hypotheses.size(); ++h) {
      if (!in_search(h) || !fits(base, h)) continue;
      const HypothesisSet set = with(base, h);
      const Left left = left_by(set, fitted(set, e_), {});
      const Variant variant{h, left.both().sum(), left.power.sum()};
      const auto [at, first] = best.try_emplace(hypothesis(h).id(), variant);
      if (!first && variant.left < at->second.left) at->second = variant;
    }
    std::vector<Variant> variants;
    for (const auto& [id, variant] : best) variants.push_back(variant);
    return variants;
  }

  // What each cause has to close of the power by itself to be worth its place [W, summed over rows].
  double price_of_a_member() const {
    const ChannelRows& r = e_.rows[index_of(Channel::power)];
    const Eigen::VectorXd kept = r.y - moved_power(e_, kept_, kept_strengths_);
    double rows = 0, gap = 0;
    for (std::size_t k = 0; k < r.block.size(); ++k) {
      if (e_.leaves_out(r.block[k])) continue;
      gap += std::fabs(kept[static_cast<Eigen::Index>(k)]);
      ++rows;
    }
    return std::max(least_necessary_part * gap, least_necessary_share * e_.columns.mean_power_w() * rows);
  }

  Eigen::VectorXd fitted(const HypothesisSet& set, const Equations& of) const {
    const std::size_t columns = columns_of(problem_.hypotheses, set).size();
    Eigen::VectorXd start = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(columns));
    Eigen::Index at = 0, of_kept = 0;
    for (const std::size_t h : set) {
      const auto n = static_cast<Eigen::Index>(hypothesis(h).candidate.columns.size());
      if (std::ranges::binary_search(kept_, h)) {
        start.segment(at, n) = kept_strengths_.segment(of_kept, n);
        of_kept += n;
      }
      at += n;
    }
    return set.empty() ? start : fitted_to_power(of, set, start);
  }

  // What is missed of each block [W], of those that `in` says: of power the sum of |error|, and of energy the
  // size of their sum. Power alone would not tell a load that is always there from noise that is skewed.
  struct Left {
    Eigen::VectorXd power, energy;

    Eigen::VectorXd both() const { return power + energy.cwiseAbs(); }
  };
  Left left_by(const HypothesisSet& set, const Eigen::VectorXd& coefficients,
               const std::vector<bool>& in) const {
    const ChannelRows& r = e_.rows[index_of(Channel::power)];
    const Eigen::VectorXd left = r.y - moved_power(e_, set, coefficients);
    Left sums{Eigen::VectorXd::Zero(static_cast<Eigen::Index>(problem_.block_count())), {}};
    sums.energy = sums.power;
    for (std::size_t k = 0; k < r.block.size(); ++k) {
      if (e_.leaves_out(r.block[k]) || (!in.empty() && !in[r.block[k]])) continue;
      const auto b = static_cast<Eigen::Index>(r.block[k]), row = static_cast<Eigen::Index>(k);
      sums.power[b] += std::fabs(left[row]);
      sums.energy[b] += left[row];
    }
    return sums;
  }

  void add(const HypothesisSet& set) {
    if (errors_.contains(set)) return;
    Eigen::VectorXd sums = Eigen::VectorXd::Zero(static_cast<Eigen::Index>(problem_.block_count()));
    double power = 0;
    const std::size_t parts = std::min(max_parsimony_folds, blocks_.size());
    for (std::size_t part = 0; part < parts; ++part) {
      std::vector<bool> part_of(problem_.block_count()), left_out = part_of;
      for (std::size_t b = 0; b < problem_.block_count(); ++b) left_out[b] = e_.leaves_out(b);
      for (std::size_t k = 0; k < blocks_.size(); ++k) {
        if (k * parts / blocks_.size() == part) part_of[blocks_[k]] = left_out[blocks_[k]] = true;
      }
      const Equations rest{e_.columns, e_.rows, e_.noise, left_out};
      const Left left = left_by(set, fitted(set, rest), part_of);
      sums += left.both();
      power += left.power.sum();
    }
    errors_[set] = {sums, power};
  }

  // The best by both, and the best by power: of two whose energies cancel neither closes any by itself.
  std::vector<HypothesisSet> best_singles() const {
    std::vector<std::pair<double, HypothesisSet>> by_both, by_power;
    for (const auto& [set, errors] : errors_) {
      if (set.size() != kept_.size() + 1 || !in_search_alone(set)) continue;
      by_both.emplace_back(errors.blocks.sum(), set);
      by_power.emplace_back(errors.power, set);
    }
    std::vector<HypothesisSet> best;
    for (auto* singles : {&by_both, &by_power}) {
      std::ranges::sort(*singles);
      const std::size_t most = singles == &by_both ? most_first_causes : most_by_power;
      for (const auto& [error, set] : std::span(*singles).first(std::min(most, singles->size()))) {
        if (std::ranges::find(best, set) == best.end()) best.push_back(set);
      }
    }
    return best;
  }
  bool in_search_alone(const HypothesisSet& set) const {
    return std::ranges::none_of(set, [&](std::size_t h) { return hypothesis(h).outside(); });
  }

  // What is left, with what the members have to close [W, summed over rows].
  struct Weighed {
    std::vector<HypothesisSet> sets;
    Eigen::MatrixXd left;  // of sets, by block
    Eigen::VectorXd price;
    double a_member = 0;

    std::size_t best(std::span<const int> counts) const {
      Eigen::VectorXd total = price;
      for (Eigen::Index b = 0; b < left.cols(); ++b)
        total += (counts.empty() ? 1 : counts[static_cast<std::size_t>(b)]) * left.col(b);
      Eigen::Index least = 0;
      total.minCoeff(&least);
      return static_cast<std::size_t>(least);
    }
  };

  Weighed weighed() const {
    Weighed w;
    w.a_member = price_of_a_member();
    w.left.resize(static_cast<Eigen::Index>(errors_.size()), static_cast<Eigen::Index>(blocks_.size()));
    w.price.resize(w.left.rows());
    for (const auto& [set, errors] : errors_) {
      const auto at = static_cast<Eigen::Index>(w.sets.size());
      for (std::size_t k = 0; k < blocks_.size(); ++k)
        w.left(at, static_cast<Eigen::Index>(k)) = errors.blocks[static_cast<Eigen::Index>(blocks_[k])];
      w.price[at] = w.a_member * static_cast<double>(size_of(set));
      w.sets.push_back(set);
    }
    return w;
  }

  // How often each set is the best of its blocks drawn anew.
  static std::vector<double> probabilities(const Weighed& w) {
    std::vector<double> p(w.sets.size());
    const auto draws = statistics::bootstrap_counts(static_cast<std::size_t>(w.left.cols()));
    for (const std::vector<int>& counts : draws) p[w.best(counts)] += 1.0 / static_cast<double>(draws.size());
    return p;
  }

  void choose(const HypothesisSet& with_functions) {
    const Weighed w = weighed();
    const HypothesisSet chosen = likeliest_like(w.sets[w.best({})], w);
    if (chosen == with_functions || chosen == kept_) return;
    take(chosen, w);
  }

  void take(const HypothesisSet& chosen, const Weighed& w) {
    const std::vector<double> p = probabilities(w);
    const auto probability = [&](const std::set<std::string>& ids) {
      double sum = 0;
      for (std::size_t m = 0; m < w.sets.size(); ++m) {
        if (std::ranges::any_of(w.sets[m], [&](std::size_t h) { return ids.contains(hypothesis(h).id()); }))
          sum += p[m];
      }
      return sum;
    };
    const Eigen::VectorXd strengths = fitted(chosen, e_);
    const Mixture::Estimate estimate = mixture_.estimate(chosen);
    std::vector<Member> members;
    Eigen::Index at = 0;
    for (std::size_t k = 0; k < chosen.size(); ++k) {
      const Hypothesis& h = hypothesis(chosen[k]);
      const auto n = static_cast<Eigen::Index>(h.candidate.columns.size());
      const Eigen::VectorXd own = strengths.segment(at, n), sd = estimate.sd.segment(at, n);
      at += n;
      const auto known = std::ranges::find(x_.members, chosen[k], &Member::hypothesis);
      const std::vector<Alternative> others = as_good(chosen, chosen[k], w);
      Member m;
      if (known != x_.members.end()) {
        m = *known;
      } else {
        m.hypothesis = chosen[k];
        m.coefficients.assign(own.begin(), own.end());
        m.sd.assign(sd.begin(), sd.end());
        m.share = problem_.moved(h, own);
        m.alternatives = others;
        m.by_evidence = m.group_by_evidence = m.any_by_evidence = max_contested_probability;
      }
      m.by_prediction = std::max(m.by_prediction, probability({h.id()}));
      std::set<std::string> group = stated_ids(problem_, m);
      m.group_by_prediction = std::max(m.group_by_prediction, probability(group));
      for (const Alternative& a : m.alternatives) group.insert(hypothesis(a.hypothesis).id());
      for (const Alternative& a : others) group.insert(hypothesis(a.hypothesis).id());
      m.any_by_prediction = std::max(m.any_by_prediction, probability(group));
      m.wander = mixture_.mean_wander(chosen, k);
      members.push_back(std::move(m));
    }
    x_.members = std::move(members);
    x_.whole = chosen;
    x_.none = std::min(x_.none, 1 - max_contested_probability);
    x_.outside = x_.outside_by_prediction = 0;
  }

  // Whether parts left out are missed by more than what parts differ by and what formulas are off.
  bool clearly_worse(const HypothesisSet& set, const HypothesisSet& best) const {
    const Eigen::ArrayXd apart = (errors_.at(set).blocks - errors_.at(best).blocks).array();
    const double n = static_cast<double>(blocks_.size());
    const double square = std::max(0.0, apart.square().sum() - apart.sum() * apart.sum() / n);
    return apart.sum() > std::max(std::sqrt(square), formulas_off * errors_.at(best).blocks.sum());
  }

  // Which of those that leave hardly more it is, only the evidence says.
  HypothesisSet likeliest_like(const HypothesisSet& best, const Weighed& w) const {
    HypothesisSet likeliest = best;
    double most = mixture_.log_joint(best);
    for (std::size_t m = 0; m < w.sets.size(); ++m) {
      const HypothesisSet& set = w.sets[m];
      if (set.size() != best.size() || size_of(set) != size_of(best) || clearly_worse(set, best)) continue;
      if (const double log_joint = mixture_.log_joint(set); log_joint > most)
        most = log_joint, likeliest = set;
    }
    return likeliest;
  }

  // Other causes that leave hardly more in the place of one, the best first.
  std::vector<Alternative> as_good(const HypothesisSet& chosen, std::size_t member, const Weighed& w) const {
    const double own = errors_.at(chosen).blocks.sum();
    const HypothesisSet rest = without(chosen, member);
    const double evidence = mixture_.log_joint(chosen);
    std::vector<std::pair<double, Alternative>> found;
    for (const auto& [set, errors] : errors_) {
      if (set.size() != chosen.size() || !in_search_alone(set)) continue;
      HypothesisSet other = set;
      for (const std::size_t h : rest) std::erase(other, h);
      if (other.size() != 1 || hypothesis(other.front()).id() == hypothesis(member).id()) continue;
      const double more = errors.blocks.sum() - own;
      if (more >= w.a_member && !problem_.alike(member, other.front())) continue;
      // What leaves the same is put in the order of what is known beforehand.
      const double known = std::clamp(mixture_.log_joint(set) - evidence, -2.0, 2.0);
      found.push_back({more / w.a_member - equal * known, {other.front(), std::exp(-more / w.a_member)}});
    }
    std::ranges::sort(found, {}, [](const auto& f) { return f.first; });
    std::vector<Alternative> result;
    std::set<std::string> ids;  // of each its best variant
    for (const auto& [more, alternative] : found) {
      if (ids.insert(hypothesis(alternative.hypothesis).id()).second) result.push_back(alternative);
    }
    return result;
  }

  const Rows rows_;  // of power alone
  const Equations e_;
  const Mixture& mixture_;
  const Problem& problem_;
  Explanation& x_;
  std::vector<bool> shows_elsewhere_;
  std::vector<std::size_t> blocks_;
  HypothesisSet kept_;  // named causes that other channels show
  Eigen::VectorXd kept_strengths_;
  // What each set misses of parts that it is fitted without.
  struct Errors {
    Eigen::VectorXd blocks;  // of each block, power and energy
    double power = 0;        // of power alone
  };
  std::map<HypothesisSet, Errors> errors_;
};

}  // namespace

void prefer_fewer_causes(const Equations& equations, const Mixture& mixture, Explanation& explanation) {
  if (!power_speaks_alone(equations)) return;
  ThirdJudge(equations, mixture, explanation).run();
}

}  // namespace joulecast::gap

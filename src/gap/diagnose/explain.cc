#include "gap/diagnose/explain.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <optional>
#include <set>

#include "gap/traits.h"
#include "statistics/selection.h"

namespace joulecast::gap {
namespace {

constexpr double leading = 14;         // sets this far below the best in log odds are dropped
constexpr std::size_t most_sets = 60;  // that are looked at closer
constexpr std::size_t most_sets_a_size = 40;
constexpr std::size_t most_predicted = 40;
constexpr double certain = 50;            // log odds of a member
constexpr double beyond_tolerance = 2.5;  // of a coefficient, for effects seen in other channels than power
constexpr double alternative_odds = 0.04;
constexpr double least_odds = -2, most_of_candidate = 0.45;  // of a candidate: log odds, probability
constexpr double cancelling = 3;                             // from which on members undo each other

class Explainer {
 public:
  Explainer(const Mixture& mixture, const std::vector<bool>& left_out, const ExplainSettings& settings)
      : mixture_(mixture), problem_(mixture.problem()), left_out_(left_out), settings_(settings) {}

  Explanation run() {
    search();
    weigh();
    if (settings_.predictive) predict();
    return answer();
  }

 private:
  struct Found {
    HypothesisSet set;
    double log_odds = 0;
  };

  const Hypothesis& hypothesis(std::size_t h) const { return problem_.hypotheses[h]; }
  bool fits(const HypothesisSet& set, std::size_t h) const {
    const bool outside = hypothesis(h).outside();
    const auto alike =
        std::ranges::count_if(set, [&](std::size_t o) { return hypothesis(o).outside() == outside; });
    if (static_cast<std::size_t>(alike) >= (outside ? settings_.most_families : settings_.most_members))
      return false;
    return std::ranges::none_of(set, [&](std::size_t o) { return hypothesis(o).excludes(hypothesis(h)); });
  }

  void search() {
    found_ = {{{}, 0.0}};
    std::vector<Found> front = found_;
    std::set<HypothesisSet> seen;
    for (std::size_t size = 1; size <= settings_.most_members + settings_.most_families && !front.empty();
         ++size) {
      std::vector<Found> next;
      for (const Found& base : front) {
        for (std::size_t h = 0; h < problem_.hypotheses.size(); ++h) {
          if (!fits(base.set, h)) continue;
          HypothesisSet set = with(base.set, h);
          if (!seen.insert(set).second) continue;
          const double odds = mixture_.log_odds(set);
          next.push_back({std::move(set), odds});
        }
      }
      std::ranges::sort(next, std::greater{}, &Found::log_odds);
      std::size_t kept = 0;
      for (const Found& f : next) {
        if (kept == most_sets_a_size) break;
        if (cancels(f.set)) continue;
        found_.push_back(f);
        ++kept;
      }
      front.clear();
      for (Found& f : next) {
        if (front.size() == settings_.beam) break;
        if (!cancels(f.set)) front.push_back(std::move(f));
      }
    }
    std::ranges::stable_sort(found_, std::greater{}, &Found::log_odds);
  }

  // Coefficients of one member within those of a set.
  static Eigen::VectorXd own(const Problem& problem, const HypothesisSet& set, const Eigen::VectorXd& all,
                             std::size_t member) {
    Eigen::Index first = 0;
    for (const std::size_t h : set) {
      const auto n = static_cast<Eigen::Index>(problem.hypotheses[h].candidate.columns.size());
      if (h == member) return all.segment(first, n);
      first += n;
    }
    return {};
  }

  double share(const HypothesisSet& set, const Mixture::Estimate& estimate, std::size_t member) const {
    return problem_.moved(hypothesis(member), own(problem_, set, estimate.mean, member));
  }

  // Whether an outside family only bends an effect along the variable that the effect itself follows.
  bool bent(const HypothesisSet& set, const Mixture::Estimate& estimate, std::size_t family) const {
    const Hypothesis& h = hypothesis(family);
    return h.outside() && std::ranges::any_of(bends, [&](const Bend& b) {
             if (b.channel != h.channel || b.variable != h.variable) return false;
             const auto effect =
                 std::ranges::find_if(set, [&](std::size_t o) { return hypothesis(o).id() == b.effect; });
             return effect != set.end() &&
                    share(set, estimate, family) < b.most * share(set, estimate, *effect);
           });
  }

  // A flexible law bends to noise and to how a formula ends: where one effect of the catalogue says nearly as
  // much, it stands for the law.
  HypothesisSet named_by_catalogue(HypothesisSet set) {
    constexpr double nearly_all_of_stribeck = 0.85, nearly_all = 0.92;  // of the log odds that the law brings
    constexpr double close = 4;                                         // in log odds
    for (const std::size_t law : HypothesisSet(set)) {
      const Hypothesis& l = hypothesis(law);
      if (!l.outside()) continue;
      const bool of_speed =
          l.variable == "speed" && (l.channel == "wheel_torque" || l.channel == "battery_power_from_motion");
      const HypothesisSet rest = without(set, law);
      const double base = odds(rest), whole = odds(set);
      double most = base;
      std::optional<std::size_t> best;
      for (std::size_t h = 0; h < problem_.hypotheses.size(); ++h) {
        if (!hypothesis(h).is_effect() || !fits(rest, h)) continue;
        const double reached = mixture_.log_odds(with(rest, h));
        const bool enough = of_speed && hypothesis(h).id() == "stribeck_friction"
                                ? reached > base + nearly_all_of_stribeck * (whole - base)
                                : reached > base + nearly_all * (whole - base) && reached > whole - close;
        if (!enough || reached <= most) continue;
        most = reached;
        best = h;
      }
      if (best) set = with(rest, *best);
    }
    return set;
  }

  double odds(const HypothesisSet& set) {
    const auto known = odds_.find(set);
    if (known != odds_.end()) return known->second;
    return odds_[set] = mixture_.log_odds(set);
  }

  bool matters(const HypothesisSet& set, const Mixture::Estimate& estimate, std::size_t member) {
    const Hypothesis& h = hypothesis(member);
    const double moves = share(set, estimate, member);
    const double gained = odds(set) - odds(without(set, member));
    if (h.outside()) return moves > settings_.least_outside_share;
    if (moves > (gained > certain ? settings_.least_share_for_certain : settings_.least_share)) return true;
    if (!h.is_effect() || !traits_of(h.id()).elsewhere) return false;
    const Eigen::VectorXd coefficients = own(problem_, set, estimate.mean, member);
    double size = 0;
    for (std::size_t k = 0; k < h.candidate.columns.size(); ++k) {
      const double tolerance =
          problem_.circumstances.front().tolerance[static_cast<Eigen::Index>(h.candidate.columns[k])];
      size = std::max(size, std::fabs(coefficients[static_cast<Eigen::Index>(k)]) / tolerance);
    }
    return size > beyond_tolerance;
  }

  // A set in terms of the catalogue where that can be, and those of its members that say something.
  struct Simplified {
    HypothesisSet whole, kept;
  };
  Simplified simplified(const HypothesisSet& found) {
    HypothesisSet set = named_by_catalogue(found);
    Mixture::Estimate estimate = mixture_.estimate(set);
    HypothesisSet straight = set;
    std::erase_if(straight, [&](std::size_t h) { return bent(set, estimate, h); });
    if (straight.size() < set.size()) estimate = mixture_.estimate(straight);
    Simplified result{straight, {}};
    for (const std::size_t h : straight) {
      if (matters(straight, estimate, h)) result.kept.push_back(h);
    }
    return result;
  }

  bool cancels(const HypothesisSet& set) const {
    return set.size() > 1 && problem_.cancelling(set, mixture_.estimate(set).mean) > cancelling;
  }

  void weigh() {
    double total = 0;
    std::size_t looked_at = 0;
    for (const Found& f : found_) {
      if (f.log_odds < found_.front().log_odds - leading || ++looked_at > most_sets) break;
      const double weight = std::exp(f.log_odds - found_.front().log_odds);
      Simplified simple = simplified(f.set);
      const auto [entry, first] =
          sets_.try_emplace(std::move(simple.kept), Kept{std::move(simple.whole), 0.0});
      entry->second.probability += weight;
      total += weight;
    }
    for (auto& [set, kept] : sets_) kept.probability /= total;
  }

  // Sets that are worth predicting with: the likeliest, all parts of the best, and nothing.
  std::vector<HypothesisSet> shortlist() const {
    std::vector<std::pair<double, HypothesisSet>> order;
    for (const auto& [set, kept] : sets_) order.emplace_back(kept.probability, set);
    std::ranges::stable_sort(order, std::greater{}, &std::pair<double, HypothesisSet>::first);
    std::set<HypothesisSet> chosen{HypothesisSet{}};
    const HypothesisSet& best = order.front().second;
    for (std::size_t part = 0; part < (std::size_t{1} << best.size()); ++part) {
      HypothesisSet set;
      for (std::size_t k = 0; k < best.size(); ++k) {
        if (part >> k & 1) set.push_back(best[k]);
      }
      chosen.insert(std::move(set));
    }
    for (const auto& [p, set] : order) {
      if (chosen.size() >= most_predicted) break;
      chosen.insert(set);
    }
    // The likeliest as they were found, by size.
    for (const Found& f : found_) {
      if (chosen.size() >= most_predicted) break;
      chosen.insert(f.set);
    }
    return {chosen.begin(), chosen.end()};
  }

  void predict() {
    models_ = shortlist();
    std::set<std::size_t> columns;
    for (const HypothesisSet& set : models_) {
      for (const std::size_t h : set) {
        const auto& own_columns = hypothesis(h).candidate.columns;
        columns.insert(own_columns.begin(), own_columns.end());
      }
    }
    std::vector<std::size_t> blocks;
    for (std::size_t b = 0; b < problem_.block_count(); ++b) {
      if (left_out_.empty() || !left_out_[b]) blocks.push_back(b);
    }
    const std::vector<std::size_t> asked = columns.empty()
                                               ? std::vector<std::size_t>{0}
                                               : std::vector<std::size_t>(columns.begin(), columns.end());
    Eigen::MatrixXd score(static_cast<Eigen::Index>(models_.size()),
                          static_cast<Eigen::Index>(blocks.size()));
    Eigen::VectorXd whole(score.rows());
    const std::vector<bool> none =
        left_out_.empty() ? std::vector<bool>(problem_.block_count(), false) : left_out_;
    const Mixture all(problem_, none, asked);
    for (Eigen::Index m = 0; m < score.rows(); ++m)
      whole[m] = all.log_joint(models_[static_cast<std::size_t>(m)]);
    for (std::size_t k = 0; k < blocks.size(); ++k) {
      std::vector<bool> out = none;
      out[blocks[k]] = true;
      const Mixture rest(problem_, out, asked);
      for (Eigen::Index m = 0; m < score.rows(); ++m)
        score(m, static_cast<Eigen::Index>(k)) =
            whole[m] - rest.log_joint(models_[static_cast<std::size_t>(m)]);
    }
    std::vector<std::size_t> size;
    for (const HypothesisSet& set : models_) size.push_back(set.size());
    selection_ = statistics::select_within_error(score, size);
  }

  // Probability by prediction that a set holds what the test says.
  template <class Test>
  double predicted(const Test& test) const {
    if (!selection_) return 1;
    double p = 0;
    for (std::size_t m = 0; m < models_.size(); ++m) {
      if (test(models_[m])) p += selection_->probability[m];
    }
    return p;
  }
  template <class Test>
  double believed(const Test& test) const {
    double p = 0;
    for (const auto& [set, kept] : sets_) {
      if (test(set)) p += kept.probability;
    }
    return p;
  }

  // Other causes that would explain the data nearly as well in the place of one of the set, each by its best
  // variant.
  std::vector<Alternative> alternatives(const HypothesisSet& set, std::size_t member) const {
    const HypothesisSet rest = without(set, member);
    const double reference = mixture_.log_joint(set);
    std::map<std::string, Alternative> best;
    for (std::size_t h = 0; h < problem_.hypotheses.size(); ++h) {
      const Hypothesis& other = hypothesis(h);
      if (other.outside() || other.id() == hypothesis(member).id() || !fits(rest, h)) continue;
      const double log_odds = mixture_.log_joint(with(rest, h)) - reference;
      if (log_odds < std::log(alternative_odds) && !problem_.alike(member, h)) continue;
      const Alternative found{h, std::exp(std::min(50.0, log_odds))};
      Alternative& kept = best.try_emplace(other.id(), found).first->second;
      if (found.odds > kept.odds) kept = found;
    }
    std::vector<Alternative> result;
    for (const auto& [id, a] : best) result.push_back(a);
    std::ranges::sort(result, std::greater{}, &Alternative::odds);
    return result;
  }

  Explanation answer() {
    const auto has_outside = [&](const HypothesisSet& set) {
      return std::ranges::any_of(set, [&](std::size_t h) { return hypothesis(h).outside(); });
    };
    Explanation e;
    e.none = believed([](const HypothesisSet& set) { return set.empty(); });
    e.none_by_prediction = predicted([](const HypothesisSet& set) { return set.empty(); });
    e.outside = believed(has_outside);
    e.outside_by_prediction = predicted(has_outside);
    const auto& best =
        *std::ranges::max_element(sets_, {}, [](const auto& entry) { return entry.second.probability; });
    // What does not matter by itself still belongs to what the data were fitted with.
    const HypothesisSet& set = best.second.whole;
    e.whole = set;
    const Mixture::Estimate estimate = mixture_.estimate(set);
    for (std::size_t k = 0; k < set.size(); ++k) {
      const Hypothesis& h = hypothesis(set[k]);
      if (std::ranges::find(best.first, set[k]) == best.first.end()) continue;
      const auto holds = [&](const HypothesisSet& other) {
        return std::ranges::any_of(other, [&](std::size_t o) { return hypothesis(o).id() == h.id(); });
      };
      Member m;
      m.hypothesis = set[k];
      m.by_evidence = believed(holds);
      m.by_prediction = predicted(holds);
      if (settings_.predictive && !h.outside()) m.alternatives = alternatives(set, set[k]);
      std::set<std::string> group = stated_ids(problem_, m);
      const auto holds_any = [&](const HypothesisSet& other) {
        return std::ranges::any_of(other, [&](std::size_t o) { return group.contains(hypothesis(o).id()); });
      };
      m.group_by_evidence = believed(holds_any);
      m.group_by_prediction = predicted(holds_any);
      for (const Alternative& a : m.alternatives) group.insert(hypothesis(a.hypothesis).id());
      m.any_by_evidence = believed(holds_any);
      m.any_by_prediction = predicted(holds_any);
      m.share = share(set, estimate, set[k]);
      const Eigen::VectorXd mean = own(problem_, set, estimate.mean, set[k]);
      const Eigen::VectorXd sd = own(problem_, set, estimate.sd, set[k]);
      m.coefficients.assign(mean.begin(), mean.end());
      m.sd.assign(sd.begin(), sd.end());
      if (settings_.predictive) m.wander = mixture_.mean_wander(set, k);
      e.members.push_back(std::move(m));
    }
    if (settings_.candidate && settings_.predictive && std::ranges::all_of(e.members, [&](const Member& m) {
          return hypothesis(m.hypothesis).outside() || m.there_probability() < least_named;
        })) {
      add_candidate(e);
    }
    return e;
  }

  // The one effect that the data speak for most, however little.
  void add_candidate(Explanation& e) const {
    std::optional<std::size_t> best;
    double most = least_odds;
    for (std::size_t h = 0; h < problem_.hypotheses.size(); ++h) {
      if (!hypothesis(h).is_effect() || traits_of(hypothesis(h).id()).elsewhere) continue;
      if (const double odds = mixture_.log_odds({h}); odds > most) most = odds, best = h;
    }
    if (!best) return;
    const Mixture::Estimate estimate = mixture_.estimate({*best});
    const double moves = problem_.moved(hypothesis(*best), estimate.mean);
    if (moves < settings_.least_share) return;
    const auto same = [&](const Member& m) {
      return hypothesis(m.hypothesis).id() == hypothesis(*best).id();
    };
    if (const auto own = std::ranges::find_if(e.members, same); own != e.members.end()) {
      own->candidate = true;
      return;
    }
    Member m;
    m.hypothesis = *best;
    m.candidate = true;
    m.by_evidence = m.by_prediction = std::min(most_of_candidate, 1 / (1 + std::exp(-most)));
    m.group_by_evidence = m.group_by_prediction = m.any_by_evidence = m.any_by_prediction = m.by_evidence;
    m.alternatives = alternatives({*best}, *best);
    m.coefficients.assign(estimate.mean.begin(), estimate.mean.end());
    m.sd.assign(estimate.sd.begin(), estimate.sd.end());
    m.share = moves;
    m.wander = mixture_.mean_wander({*best}, 0);
    e.members.push_back(std::move(m));
  }

  const Mixture& mixture_;
  const Problem& problem_;
  const std::vector<bool>& left_out_;
  const ExplainSettings& settings_;
  std::vector<Found> found_;              // best first
  std::map<HypothesisSet, double> odds_;  // of sets asked for more than once
  struct Kept {
    HypothesisSet whole;  // of the likeliest set that comes to it
    double probability;   // by evidence, of all that do
  };
  std::map<HypothesisSet, Kept> sets_;  // by what matters
  std::vector<HypothesisSet> models_;
  std::optional<statistics::Selection> selection_;
};

}  // namespace

std::set<std::string> stated_ids(const Problem& problem, const Member& member) {
  std::set<std::string> ids{problem.hypotheses[member.hypothesis].id()};
  for (const Alternative& a : member.stated()) ids.insert(problem.hypotheses[a.hypothesis].id());
  return ids;
}

bool finds(const Explanation& explanation, const Problem& problem, const std::set<std::string>& ids) {
  return std::ranges::any_of(explanation.members, [&](const Member& m) {
    return ids.contains(problem.hypotheses[m.hypothesis].id()) && m.group_probability() >= least_named;
  });
}

Explanation explain(const Mixture& mixture, const std::vector<bool>& left_out,
                    const ExplainSettings& settings) {
  return Explainer(mixture, left_out, settings).run();
}

Explanation explain(const Problem& problem, const std::vector<bool>& left_out,
                    const ExplainSettings& settings) {
  return explain(Mixture(problem, left_out), left_out, settings);
}

}  // namespace joulecast::gap

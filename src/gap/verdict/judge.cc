#include "gap/verdict/judge.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "gap/diagnose/account.h"
#include "gap/traits.h"
#include "gap/verdict/adopt.h"
#include "gap/verdict/probability.h"
#include "gap/verdict/text.h"
#include "gap/verdict/words.h"

namespace joulecast::gap {
namespace {

// Of the mean power, beyond the noise floor.
constexpr double largest_unnamed = 0.012;             // what may be left over while nothing is named
constexpr double largest_left = 0.014, of_gap = 0.1;  // and beside names, with a part of the gap
constexpr double closes_nothing = 0.95;               // of the gap on held-out parts, that still is left
constexpr double closes_little = 0.8;                 // the same, that may be the skew of noise
constexpr double moves_energy = 0.5;                // of what is missed of their energies, that a name moves
constexpr double closes_no_energy = 0.8;            // of what is missed of their energies
constexpr double unbelieved = 0.1;                  // probability that nothing is there, by either judge
constexpr double mostly_outside = 0.25;             // of what moves power, outside the catalogue
constexpr double clearly_better_prediction = 0.95;  // of what the regression and the file miss
constexpr double mostly_closed = 0.5;               // of what held-out parts can be closed by
constexpr double beyond_usual = 3;                  // strengths that no robot has, over the usual ones
constexpr double doubtful = 0.6;          // factor on names beside which something speaks against all
constexpr double sure = 0.9;              // probability of such a name
constexpr double varying = 0.7;           // most of a name whose strength varies, or that nothing proves
constexpr double most_detectable = 0.08;  // share below which effects must be seen for "none"
constexpr double most_noise = 0.2;        // of the power, that a file which is right may miss

// A battery sensor that reads too much while the motors' are right: a load that follows the current would
// read the same.
bool like_a_load(const Cause& cause) {
  const std::string_view id = cause.effect.effect->info().id;
  return (id == "current_sensor_gain" || id == "voltage_sensor_gain") && cause.effect.values[1] == 0;
}

bool implausible(const Cause& cause) {
  const Traits& traits = traits_of(cause.effect.effect->info().id);
  // What sensors do is no strength of the robot's.
  if (traits.cause == "sensors") return false;
  return !cause.by && traits.usual > 0 && std::fabs(cause.effect.values[0]) > beyond_usual * traits.usual;
}

std::vector<DiagnosedParameter> parameters_of(const Cause& cause, const Hypothesis& h, const Member& member) {
  constexpr double formula_accuracy = 0.015;
  const dynamics::ActiveEffect& active = cause.effect;
  if (cause.by) {
    const double value = active.values[h.parameter];
    return {{"coefficient", h.unit, value, std::hypot(member.sd[0], 0.5 * (member.coefficients[0] - value))}};
  }
  std::vector<DiagnosedParameter> parameters;
  const auto& info = active.effect->info().parameters;
  for (std::size_t k = 0; k < info.size(); ++k) {
    if ((k == 0 || info[k].strength) && k != h.parameter)
      continue;  // a strength of its own that was not asked for
    parameters.push_back({std::string(info[k].name), std::string(info[k].unit), active.values[k], missing});
  }
  const auto own = std::ranges::find(parameters, info[h.parameter].name, &DiagnosedParameter::name);
  double& deviation = own->deviation;
  if (member.sd.size() == 2) {
    const double c = std::cos(active.values[1]), s = std::sin(active.values[1]);
    deviation = std::hypot(c * member.sd[0], s * member.sd[1]);
    parameters[1].deviation =
        std::hypot(s * member.sd[0], c * member.sd[1]) / std::max(std::fabs(active.values[0]), 1e-9);
  } else {
    // What the equations say of the strength, and where the two ways of estimating it differ.
    deviation = std::hypot(member.sd[0], 0.5 * (member.coefficients[0] - active.values[h.parameter]));
  }
  deviation = std::hypot(deviation, formula_accuracy * active.values[h.parameter]);
  return parameters;
}

// What speaks against the names as a whole.
struct Doubts {
  bool far = false;          // the gap is so large that the file is another robot's
  bool strange = false;      // strengths that no robot has
  bool idle = false;         // on held-out parts they close nothing
  bool worse = false;        // than the referee or the unchanged model, on held-out parts
  bool worse_alone = false;  // the same without a function outside the catalogue that is told beside them
  bool unexplained = false;  // held-out parts keep more of the gap than right names leave
  bool partly = false;       // the same, whether or not they predict better than the regression
  bool like_load = false;
  bool outside = false;  // what is outside the catalogue is the answer
  bool any_against() const { return idle || worse || unexplained || like_load; }
};

class Judge {
 public:
  Judge(Diagnosis& d, const Findings& f, const robot::RobotModel& robot)
      : d_(d), f_(f), robot_(robot), beyond_noise_(d.power_absolute_relative - d.noise_floor) {}

  void run() {
    name_effects();
    find_outside();
    if (d_.baseline && f_.held_out && by_function_) explain_with_functions(*d_.baseline);
    weigh_doubts();
    decide();
    state_probabilities();
    settle_adoption();
    d_.outside.probability = std::min(d_.outside.probability, 1.0);
    d_.reasons = reasons_for(d_, d_.baseline && d_.baseline->wins(), doubts_.unexplained);
  }

 private:
  const Hypothesis& hypothesis(std::size_t h) const { return f_.problem.hypotheses[h]; }
  const Member& member_of(std::size_t h) const {
    return *std::ranges::find(f_.explanation.members, h, &Member::hypothesis);
  }
  bool candidate(std::size_t k) const { return member_of(f_.named[k]).candidate; }
  // Whether any of the named that is more than a candidate is so.
  bool finding_is(bool (*so)(const Cause&)) const {
    for (std::size_t k = 0; k < f_.causes.size(); ++k) {
      if (!candidate(k) && so(f_.causes[k])) return true;
    }
    return false;
  }
  std::optional<Controls> controls_of(const Member& m) const {
    if (f_.controls.empty()) return std::nullopt;
    const Controls& made = f_.controls[static_cast<std::size_t>(&m - f_.explanation.members.data())];
    return made.surrogates > 0 ? std::optional(made) : std::nullopt;
  }

  // Where no power is known, no part left out says whether a cause that would show in power predicts
  // anything.
  bool unproved(const Hypothesis& h) const { return d_.power == PowerSource::none && shows_in_power(h); }

  void name_effects() {
    const std::vector<dynamics::ActiveEffect> none;
    for (std::size_t k = 0; k < f_.named.size(); ++k) {
      const Hypothesis& h = hypothesis(f_.named[k]);
      const Member& m = member_of(f_.named[k]);
      DiagnosedEffect e;
      e.id = h.id();
      e.posterior = m.probability();
      if (m.wander > steady_wander || unproved(h)) e.posterior = std::min(e.posterior, varying);
      e.controls = controls_of(m);
      for (const Alternative& a : m.stated()) e.alternatives.push_back(hypothesis(a.hypothesis).id());
      // What is not found again without each part is no surer than that.
      double again = 1;
      if (f_.held_out && !f_.calibrated) {
        again = f_.held_out->found_again(stated_ids(f_.problem, m));
        e.posterior = std::min(e.posterior, again);
      }
      // Found where it is not: no surer than the surrogates allow.
      double not_by_chance = 1;
      if (e.controls) {
        const double n = static_cast<double>(e.controls->surrogates);
        not_by_chance = 1 - static_cast<double>(e.controls->named_in) / n;
        e.posterior = std::min(e.posterior, not_by_chance);
      }
      e.parameters = parameters_of(f_.causes[k], h, m);
      e.share = f_.shares[k];
      e.power_w = f_.power_w[k];
      e.varies = m.wander;
      for (const dynamics::ActiveEffect& effect : k < f_.instead.size() ? f_.instead[k] : none)
        e.instead.push_back(dynamics::adopt(effect));
      if (h.is_effect()) e.calibrates = traits_of(e.id).calibrates;
      const double group = e.alternatives.empty() ? e.posterior : std::max(e.posterior, group_of(m, e));
      weakest_ = std::min({weakest_, group, not_by_chance, again});
      if (!m.candidate) named_share_ += m.share;
      d_.effects.push_back(std::move(e));
    }
  }
  static double group_of(const Member& m, const DiagnosedEffect& e) {
    return m.wander > steady_wander ? e.posterior : m.group_probability();
  }

  // Whether parts left out are predicted better with the functions, where that can be asked, and no worse
  // than by the regression.
  bool functions_help() const {
    if (!f_.held_out) return true;
    if (f_.of_groups && d_.baseline && d_.baseline->wins()) return false;
    const double without = f_.held_out->explained(), with = f_.held_out->explained_with_functions();
    return !(with > without || with < without) || (with < without && !baseline_of(*f_.held_out, true).wins());
  }

  // The largest thing outside the catalogue that both judges see and that surrogates do not show.
  void find_outside() {
    const double least = least_outside_share(std::max(0.0, beyond_noise_));
    double largest = 0;
    const auto passes = [](const std::optional<Controls>& c) {
      return !c || 10 * c->named_in <= c->surrogates;
    };
    for (const Member& m : f_.explanation.members) {
      const Hypothesis& h = hypothesis(m.hypothesis);
      if (!told_outside(h, m) || m.share < least || !functions_help()) continue;
      const auto controls = controls_of(m);
      if (!passes(controls)) continue;
      outside_share_ += m.share;
      if (m.share <= largest) continue;
      largest = m.share;
      by_function_ = true;
      d_.outside = {std::min(m.by_evidence, m.by_prediction), h.channel, h.variable, "", {}, controls};
      if (h.variable == "time" && h.channel.starts_with("battery_power"))
        d_.outside.like = "accessory_load", d_.outside.power_w = f_.load_by_time_w;
    }
    if (f_.wandering) {
      const Member& m = f_.explanation.members[*f_.wandering];
      const auto controls = controls_of(m);
      outside_share_ += m.share;
      if (m.share > largest && passes(controls)) {
        largest = m.share;
        const std::string channel =
            d_.motor_channels ? "battery_power_from_motors" : "battery_power_from_motion";
        d_.outside = {m.group_probability(), channel, "time", hypothesis(m.hypothesis).id(),
                      f_.wandering_power_w,  controls};
      }
    }
    if (f_.ripple && f_.ripple->power_share > least) {
      const Controls controls{f_.ripple->surrogates, f_.ripple->found_in};
      if (!passes(controls)) return;
      outside_share_ += f_.ripple->power_share;
      rippled_ = true;
      if (f_.ripple->power_share > largest) {
        d_.outside = {
            1,       d_.motor_channels ? "wheel_torque" : "battery_power_from_motion", "wheel_angle", "", {},
            controls};
      }
    }
    if (d_.outside.channel.empty())
      d_.outside.probability = std::min(f_.explanation.outside, f_.explanation.outside_by_prediction);
  }

  void explain_with_functions(Baseline& baseline) const {
    const Baseline with = baseline_of(*f_.held_out, true);
    baseline.explanation_held_out = with.explanation_held_out;
    baseline.deviation = with.deviation;
  }

  void weigh_doubts() {
    doubts_.far = !f_.of_groups && beyond_noise_ > far_off;
    doubts_.strange = !f_.of_groups && finding_is(implausible);
    doubts_.like_load = d_.motor_channels && finding_is(like_a_load);
    if (!f_.held_out || d_.effects.empty() || d_.power == PowerSource::none) return;
    const double after = f_.held_out->explained();
    closed_ = (f_.held_out->unchanged() - after) / (f_.held_out->unchanged() - d_.noise_floor);
    const bool by_power =
        std::ranges::all_of(f_.named, [&](std::size_t h) { return shows_in_power(hypothesis(h)); });
    const double energy = f_.held_out->unchanged_energy();
    const double energy_after = f_.held_out->explained_energy();
    // What moves the energies of parts and brings them no nearer fits the skew of noise.
    const bool skew = f_.held_out->moved_energy() > moves_energy * energy &&
                      energy_after > closes_nothing * energy &&
                      after > closes_little * f_.held_out->unchanged();
    doubts_.idle =
        by_power &&
        ((after > closes_nothing * f_.held_out->unchanged() && !(energy_after < closes_no_energy * energy)) ||
         skew);
    doubts_.worse = d_.baseline && d_.baseline->wins();
    doubts_.worse_alone = d_.baseline && baseline_of(*f_.held_out).wins();
    const bool best = d_.baseline && after < clearly_better_prediction *
                                                 std::min(f_.held_out->referee(), f_.held_out->unchanged());
    const bool much_left = !(closed_ > mostly_closed) &&
                           after - d_.noise_floor > largest_left + of_gap * d_.power_absolute_relative;
    doubts_.unexplained = much_left && !best;
    doubts_.partly = much_left;
  }

  void decide() {
    // What was named beside something outside still is the answer where it closes most of what can be closed.
    const bool outside = !d_.outside.channel.empty() &&
                         (rippled_ || (outside_share_ > mostly_outside * (named_share_ + outside_share_) &&
                                       !(closed_ > mostly_closed)));
    // An effect smaller than the noise hardly shows in the gap: there the evidence says whether it is there.
    const bool hidden = named_share_ > largest_unnamed && d_.noise_floor > named_share_;
    const double none = std::max(f_.explanation.none, f_.explanation.none_by_prediction);
    const bool open = beyond_noise_ > largest_unnamed || (hidden && none < unbelieved);
    // Where the gap is hardly larger than what nothing could remove, only a sure name says something.
    const bool all_unsure = std::ranges::all_of(d_.effects, [](const auto& e) { return e.posterior < sure; });
    const bool seen_elsewhere =
        std::ranges::any_of(f_.named, [&](std::size_t h) { return !shows_in_power(hypothesis(h)); });
    const bool nothing = d_.effects.empty() || doubts_.idle || (!open && all_unsure && !seen_elsewhere);
    doubts_.outside = outside;
    if (outside) {
      d_.verdict = Verdict::outside;
      d_.verdict_probability = d_.outside.probability;
    } else if (nothing) {
      const bool blind = d_.detectable_share > most_detectable || d_.noise_floor > most_noise;
      const bool something = d_.outside.probability >= least_named;
      d_.verdict = !open && !blind && !something ? Verdict::none : Verdict::inconclusive;
      d_.verdict_probability = open ? 1 : std::max(f_.explanation.none, least_named);
      if (d_.verdict == Verdict::none) d_.effects.clear();
    } else if (!doubts_.any_against() && weakest_ >= least_named) {
      d_.verdict = Verdict::effects;
      d_.verdict_probability = weakest_;
    } else {
      d_.verdict = Verdict::inconclusive;
      d_.verdict_probability = weakest_;
    }
    if (d_.verdict != Verdict::none && (doubts_.far || (doubts_.strange && open)))
      d_.verdict = Verdict::not_this_robot;
  }

  void state_probabilities() {
    const double trust = named_share_ > 0 ? named_share_ / (named_share_ + outside_share_) : 1;
    for (DiagnosedEffect& e : d_.effects) {
      e.posterior *= trust;
      if (doubts_.partly) e.posterior = std::min(e.posterior, varying);
      if (doubts_.any_against()) e.posterior *= doubtful;
      const Standing standing = d_.verdict == Verdict::outside ? Standing::outside
                                : doubts_.any_against()        ? Standing::inconclusive
                                : e.alternatives.empty()       ? Standing::alone
                                                               : Standing::grouped;
      e.standing = standing;
      e.probability = stated_probability(e.posterior, standing);
    }
    d_.verdict_probability = std::min(d_.verdict_probability, surest_verdict);
    // What a file that is not this robot's has wrong is told as its corrections; what no file could say comes
    // first.
    std::ranges::stable_sort(d_.effects, std::greater{}, [&](const DiagnosedEffect& e) {
      return std::pair(d_.verdict == Verdict::not_this_robot && e.calibrates.empty(), e.share);
    });
  }

  void settle_adoption() {
    std::vector<double> deviations;
    for (std::size_t k = 0; k < f_.causes.size(); ++k) {
      const Cause& cause = f_.causes[k];
      // A robot file has no covariates, and a candidate is no finding.
      if (cause.by || candidate(k)) continue;
      const std::string_view id = cause.effect.effect->info().id;
      const auto named = std::ranges::find(d_.effects, id, &DiagnosedEffect::id);
      if (named == d_.effects.end()) continue;
      d_.adoptable.push_back(dynamics::adopt(cause.effect));
      const auto own =
          std::ranges::find_if(named->parameters, [](const auto& p) { return std::isfinite(p.deviation); });
      deviations.push_back(own == named->parameters.end() ? 0 : own->deviation);
    }
    if (d_.verdict == Verdict::not_this_robot) {
      for (std::size_t k = 0; k < f_.base.size(); ++k) {
        if (f_.base[k].by) continue;
        d_.adoptable.push_back(dynamics::adopt(f_.base[k].effect));
        deviations.push_back(missing);
      }
    }
    if (d_.verdict == Verdict::not_this_robot)
      d_.corrections = corrections_of(robot_, d_.adoptable, deviations);
    d_.refusal = refusal_of(d_, doubts_.worse_alone, doubts_.any_against() || weakest_ < least_named);
    if (d_.verdict == Verdict::not_this_robot && d_.refusal.empty()) d_.refusal = correction_refusal();
  }

  // Why a file that is not this robot's is not corrected by what was found.
  std::string correction_refusal() const {
    if (doubts_.outside) return "something that no effect of the catalogue describes is at work";
    const auto unsteady =
        std::ranges::find_if(d_.effects, [](const auto& e) { return e.varies > steady_wander; });
    if (unsteady == d_.effects.end()) return {};
    return fmt::format("the strength of {} varies along the recordings by {} of itself", unsteady->id,
                       percent(unsteady->varies));
  }

  Diagnosis& d_;
  const Findings& f_;
  const robot::RobotModel& robot_;
  double beyond_noise_;
  double weakest_ = 1, named_share_ = 0, outside_share_ = 0;
  double closed_ = missing;  // part of the gap beyond noise that goes away on held-out parts
  bool rippled_ = false, by_function_ = false;  // what is outside
  Doubts doubts_;
};

}  // namespace

double least_outside_share(double gap_share) {
  constexpr double without_a_gap = 0.016, closed = 0.01, usual = 0.012, part_of_gap = 0.2, most_gap = 0.12;
  if (gap_share < closed) return without_a_gap;
  return std::max(usual, part_of_gap * std::min(gap_share, most_gap));
}

void judge(Diagnosis& d, const Findings& findings, const robot::RobotModel& robot) {
  Judge(d, findings, robot).run();
}

}  // namespace joulecast::gap

#include "gap/verdict/text.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <string_view>
#include <utility>

#include "gap/posterior/constants.h"
#include "gap/verdict/words.h"
#include "windows/track.h"

namespace joulecast::gap {
namespace {

constexpr double notable_outside = 0.3;   // probability of an unknown cause that is worth a sentence
constexpr double notable_rest = 2;        // residual over noise, the same
constexpr double notable_scatter = 0.45;  // of a strength
constexpr double notable_gap = 0.012;     // of the power, beyond the noise floor
constexpr double notable_term = 5;        // standard errors of a regression's term from the model's

std::string channel_words(std::string_view channel) {
  constexpr std::array<std::pair<std::string_view, std::string_view>, 6> words{
      {{"wheel_torque", "the torque at the wheels"},
       {"motor_voltage", "the voltage of the motors"},
       {"battery_voltage", "the voltage of the battery"},
       {"motor_voltage_from_motion", "the voltage of the motors"},
       {"battery_power_from_motors", "battery power in addition to that of the motors"},
       {"battery_power_from_motion", "battery power"}}};
  const auto* found =
      std::ranges::find(words, channel, &std::pair<std::string_view, std::string_view>::first);
  return found == words.end() ? words_of(channel) : std::string(found->second);
}

std::string follows_words(std::string_view variable) {
  if (variable == "wheel_angle")
    return "repeats with the turning of a wheel: look for an out-of-round wheel, a bent axle, a damaged "
           "tooth or a cogging motor";
  if (variable == "time") return "changes with the time since the mission began";
  if (variable == "recent_motion")
    return "rises or falls with the recent motion of the robot, as with parts that warm up in use";
  if (variable == "position") return "depends on where the robot is";
  return "follows the " + words_of(variable);
}

std::string outside_clause(const Outside& o) {
  const std::string probability = probability_text(o.probability);
  if (!o.like.empty() && o.power_w[0] != o.power_w[1])
    return fmt::format(
        "a load independent of motion (probability {}) follows time or place: from {} W to {} W", probability,
        brief(o.power_w[0]), brief(o.power_w[1]));
  return fmt::format("an unknown cause (probability {}) shows in {} and {}", probability,
                     channel_words(o.channel), follows_words(o.follows));
}

std::vector<std::string> names_of(const std::vector<std::string>& ids) {
  std::vector<std::string> names;
  for (const std::string& id : ids) names.push_back(words_of(id));
  return names;
}

class Reasons {
 public:
  explicit Reasons(const Diagnosis& d) : d_(d) {}

  std::vector<std::string> all(bool worse_than_regression) {
    const bool nothing = d_.effects.empty() && d_.verdict == Verdict::inconclusive;
    if (d_.power == PowerSource::none && nothing) {
      say("no power was recorded, and the {} of the motors alone do not determine the cause",
          d_.motor_channels ? "torques" : "voltages");
      return said_;
    }
    if (d_.verdict == Verdict::none) {
      strongest_term();
      return said_;
    }
    if (const double sound = sound_readings(d_.checks); sound < posterior::named)
      say("{}: see the checks", error_words(sound));
    if (d_.verdict == Verdict::not_this_robot)
      say("the robot file has an error of {} of the power: it belongs to another robot, or to another "
          "state of this one{}",
          percent(d_.power_absolute_relative),
          d_.corrections.empty() ? "" : "; values that fit are proposed below");
    if (!d_.outside.channel.empty())
      said_.push_back(sentence((d_.verdict == Verdict::effects ? "in addition to the effects found, " : "") +
                               outside_clause(d_.outside)));
    if (worse_than_regression) regression();
    if (d_.verdict != Verdict::effects) shrinkage();
    for (const DiagnosedEffect& e : d_.effects) effect(e);
    if (d_.verdict == Verdict::effects) return said_;
    if (d_.outside.channel.empty() && d_.outside.probability >= notable_outside)
      say("a cause outside the catalogue may be present, too (probability {})",
          probability_text(d_.outside.probability));
    if (nothing) {
      if (d_.power_absolute_relative - d_.noise_floor > notable_gap)
        say("the error is {} of the power at a noise floor of {}, and no effect of the catalogue explains it "
            "well enough to be named",
            percent(d_.power_absolute_relative), percent(d_.noise_floor));
      else
        say("the error is {} of the power, which may be noise or a hidden cause: nothing in these recordings "
            "predicts it",
            percent(d_.power_absolute_relative));
    }
    if (said_.empty() && !d_.effects.empty()) {
      const auto least = std::ranges::min(d_.effects, {}, &DiagnosedEffect::probability);
      say("the probability of {} is only {}", words_of(least.id), probability_text(least.probability));
    }
    return said_;
  }

 private:
  template <class... Args>
  void say(fmt::format_string<Args...> text, Args&&... args) {
    said_.push_back(sentence(fmt::format(text, std::forward<Args>(args)...)));
  }

  void shrinkage() {
    if (!d_.shrinkage || !std::isfinite(d_.shrinkage->after)) return;
    const Shrinkage& s = *d_.shrinkage;
    const bool one = d_.effects.size() == 1;
    if (s.interval[1] < 0)
      say("on held-out data the {} the gap by {} to {}", one ? "effect increases" : "effects increase",
          percent(-s.interval[1]), percent(-s.interval[0]));
    else if (s.interval[0] < 0)
      say("the benefit for held-out data is uncertain: the gap shrinks by {} to {}", percent(s.interval[0]),
          percent(s.interval[1]));
    else if (s.after > notable_rest * d_.noise_floor)
      say("with the {}, an error of {} of the power remains on held-out data; the noise floor is {}",
          one ? "effect" : "effects", percent(s.after), percent(d_.noise_floor));
  }

  void effect(const DiagnosedEffect& e) {
    if (!e.alternatives.empty())
      say("these data do not distinguish {} from {}", words_of(e.id),
          enumerate(names_of(e.alternatives), "or"));
    if (e.id == "accessory_load" && e.parameters.front().value < 0)
      say("a negative load is a source of power, or a base load below the robot file's");
    if (e.varies > notable_scatter)
      say("the strength of {} varies by {} of its mean during the recordings", words_of(e.id),
          percent(e.varies));
  }

  void strongest_term() {
    if (!d_.baseline) return;
    const auto off = [](const BaselineTerm& t) { return std::fabs(t.value - t.model) / t.deviation; };
    const BaselineTerm* most = nullptr;
    for (const BaselineTerm& t : d_.baseline->terms)
      if (off(t) > (most ? off(*most) : notable_term)) most = &t;
    if (most)
      say("no gap that matters, although the term {} of power is {} in the data and {} in the robot file",
          most->name, with_deviation(most->value, most->deviation, most->unit), brief(most->model));
  }

  void regression() {
    if (!d_.baseline) return;
    const Baseline& b = *d_.baseline;
    if (b.unchanged_model_held_out < b.held_out) {
      say("on held-out data the error is {} with the robot file and {} with the effects found",
          percent(b.unchanged_model_held_out), percent(b.explanation_held_out));
      return;
    }
    say("on held-out data the error of a linear regression of power on speed, turning and acceleration is "
        "{}, that of this explanation {}",
        percent(b.held_out), percent(b.explanation_held_out));
    said_.insert(said_.end(), b.says.begin(), b.says.end());
  }

  const Diagnosis& d_;
  std::vector<std::string> said_;
};

}  // namespace

double sound_readings(std::span<const Check> checks) {
  double sound = 1;
  for (const Check& check : checks) {
    const double own = check.factor || check.swapped ? check.probability : 1 - check.error;
    if (!check.contradicted && std::isfinite(own)) sound *= own;
  }
  return sound;
}

std::string error_words(double sound) {
  return fmt::format("an error of the readings has a probability of {}", probability_text(1 - sound));
}

std::string outside_words(const Outside& o) {
  return sentence(outside_clause(o));
}

std::string earlier_words(const Diagnosis& earlier, std::string_view first_mission) {
  std::vector<std::string> found;
  for (const DiagnosedEffect& e : earlier.effects) {
    const DiagnosedParameter& p = e.parameters.front();
    found.push_back(fmt::format("{} {} (probability {})", words_of(e.id),
                                with_deviation(p.value, p.deviation, p.unit),
                                probability_text(e.probability)));
  }
  return sentence(
      fmt::format("this result is for the missions from {} on, after the step; that of the {} missions "
                  "before it is {}{}{}",
                  first_mission, earlier.missions, title_of(earlier.verdict), found.empty() ? "" : ": ",
                  enumerate(found)));
}

std::vector<std::string> reasons_for(const Diagnosis& d, bool worse) {
  return Reasons(d).all(worse);
}

std::string missing_data(const Diagnosis& d, bool motion_known) {
  if (!motion_known)
    return fmt::format(
        "The recordings have less usable motion of the wheels than the 20 s that a diagnosis needs: they are "
        "shorter or have too few readings, their checks exclude it, or no wheel turns faster than {} rad/s.",
        windows::moving_rad_s);
  if (d.power != PowerSource::none) return "There are too few seconds of motion with power.";
  std::vector<std::string> excluded;
  for (const Check& check : d.checks)
    if ((check.contradicted || check.id == "impossible_readings") && check.channel != "wheel_velocity" &&
        std::ranges::find(excluded, check.channel) == excluded.end())
      excluded.push_back(check.channel);
  if (excluded.empty())
    return "Neither power nor the motors' voltage or current was recorded: a diagnosis needs battery_voltage "
           "with battery_current, or motor_voltage, or motor_current.";
  return fmt::format(
      "No power is left without the readings of {}, which the checks exclude: compare their unit and the "
      "robot file with the robot.",
      enumerate(excluded, "and"));
}

}  // namespace joulecast::gap

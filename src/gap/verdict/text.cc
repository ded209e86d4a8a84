#include "gap/verdict/text.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <string_view>
#include <utility>

#include "gap/verdict/words.h"

namespace joulecast::gap {
namespace {

constexpr double notable_outside = 0.3;  // probability of an unknown cause that is worth a sentence
constexpr double notable_rest = 2;       // residual over noise, the same

std::string channel_words(std::string_view channel) {
  constexpr std::array<std::pair<std::string_view, std::string_view>, 9> words{
      {{"wheel_torque", "the torque at the wheels"},
       {"motor_voltage", "the voltage of the motors"},
       {"battery_voltage", "the voltage of the battery"},
       {"motor_voltage_from_motion", "the voltage of the motors"},
       {"battery_power_from_motors", "battery power in addition to that of the motors"},
       {"battery_power_from_motion", "battery power"},
       {"yaw_rate", "the yaw rate at given wheel speeds"},
       {"map_travel", "the distance for given turns of the wheels"},
       {"map_turn", "the rotation for given turns of the wheels"}}};
  const auto* found =
      std::ranges::find(words, channel, &std::pair<std::string_view, std::string_view>::first);
  return found == words.end() ? words_of(channel) : std::string(found->second);
}

std::string follows_words(std::string_view variable) {
  if (variable == "wheel_angle")
    return "repeats with the turning of a wheel: look for a wheel out of round, a bent axle, a damaged "
           "tooth or a motor that cogs";
  if (variable == "time") return "changes with the time since the mission began";
  if (variable == "recent_motion")
    return "rises or falls with the recent motion of the robot, as with parts that warm up in use";
  if (variable == "position") return "depends on where the robot is";
  return "follows the " + words_of(variable);
}

std::vector<std::string> names_of(const std::vector<std::string>& ids) {
  std::vector<std::string> names;
  for (const std::string& id : ids) names.push_back(words_of(id));
  return names;
}

void say_shrinkage(const Diagnosis& d, std::vector<std::string>& reasons) {
  if (!d.shrinkage || !std::isfinite(d.shrinkage->after)) return;
  const Shrinkage& s = *d.shrinkage;
  const bool one = d.effects.size() == 1;
  if (s.interval[1] < 0) {
    reasons.push_back(
        sentence(fmt::format("the {} the gap of held-out data larger: {} instead of {}",
                             one ? "effect makes" : "effects make", percent(s.after), percent(s.before))));
  } else if (s.interval[0] < 0) {
    reasons.push_back(
        sentence(fmt::format("the benefit for held-out data is uncertain: the gap shrinks by {} to {}",
                             percent(s.interval[0]), percent(s.interval[1]))));
  } else if (s.after > notable_rest * d.noise_floor) {
    reasons.push_back(sentence(fmt::format(
        "with the {}, an error of {} of the power remains on held-out data; the noise floor is {}",
        one ? "effect" : "effects", percent(s.after), percent(d.noise_floor))));
  }
}

bool of_motors_alone(const DiagnosedEffect& e) {
  const auto battery = std::ranges::find(e.parameters, "battery", &DiagnosedParameter::name);
  return battery != e.parameters.end() && battery->value == 0;
}

void say_effects(const Diagnosis& d, std::vector<std::string>& reasons) {
  for (const DiagnosedEffect& e : d.effects) {
    if (!e.alternatives.empty()) {
      reasons.push_back(sentence(fmt::format("these data do not distinguish {} from {}", words_of(e.id),
                                             enumerate(names_of(e.alternatives), "or"))));
    }
    if (e.id == "accessory_load" && e.parameters.front().value < 0)
      reasons.emplace_back("A negative load is a source of power, or a base load below the robot file's.");
    constexpr double notable_wander = 0.45;
    if (e.varies > notable_wander) {
      reasons.push_back(
          sentence(fmt::format("the strength of {} varies by {} of its mean during the recordings",
                               words_of(e.id), percent(e.varies))));
    }
    if ((e.id == "current_sensor_gain" || e.id == "voltage_sensor_gain") && d.motor_channels &&
        !of_motors_alone(e))
      reasons.push_back(
          sentence(fmt::format("a load proportional to the current would look like {}", words_of(e.id))));
  }
}

void say_referee(const Diagnosis& d, std::vector<std::string>& reasons) {
  if (!d.baseline) return;
  const Baseline& b = *d.baseline;
  if (b.unchanged_model_held_out < b.held_out) {
    reasons.push_back(sentence(
        fmt::format("on held-out data the robot file has an error of {}, and of {} with the effects found",
                    percent(b.unchanged_model_held_out), percent(b.explanation_held_out))));
    return;
  }
  reasons.push_back(sentence(fmt::format(
      "on held-out data a linear regression of power on speed, turning and acceleration has an error of {}, "
      "this explanation of {}",
      percent(b.held_out), percent(b.explanation_held_out))));
  reasons.insert(reasons.end(), b.says.begin(), b.says.end());
}

}  // namespace

std::string outside_words(const Outside& o) {
  if (!o.like.empty() && o.power_w[0] != o.power_w[1]) {
    const std::string what =
        o.like == "accessory_load" ? "a load independent of motion" : "something like " + words_of(o.like);
    return sentence(fmt::format("{} that follows time or place: from {} W to {} W", what, brief(o.power_w[0]),
                                brief(o.power_w[1])));
  }
  return sentence(
      fmt::format("an unknown cause shows in {} and {}", channel_words(o.channel), follows_words(o.follows)));
}

std::string earlier_words(const Diagnosis& earlier, std::string_view first_mission) {
  std::vector<std::string> found;
  for (const DiagnosedEffect& e : earlier.effects) {
    const DiagnosedParameter& p = e.parameters.front();
    found.push_back(fmt::format("{} {} (probability {})", words_of(e.id),
                                with_deviation(p.value, p.deviation, p.unit),
                                probability_text(e.probability)));
  }
  return sentence(fmt::format(
      "this is the answer from mission {} on, after the step; that of the {} missions before it is {}{}{}",
      first_mission, earlier.missions, words_of(name_of(earlier.verdict)), found.empty() ? "" : ": ",
      enumerate(found)));
}

std::vector<std::string> reasons_for(const Diagnosis& d, bool worse) {
  std::vector<std::string> reasons;
  if (!d.motion_known) {
    reasons.emplace_back(
        "The motion that needs the power is not recorded, or too short: see the checks of the recordings.");
    return reasons;
  }
  if (!std::isfinite(d.power_absolute_relative)) {
    reasons.emplace_back(
        d.motor_channels && d.power == PowerSource::none
            ? "No power was recorded, and the torques alone do not determine the cause."
            : "The data are insufficient: too few seconds of motion, or neither power nor the motors' "
              "voltage or current.");
    if (d.effects.empty() && d.verdict == Verdict::inconclusive) return reasons;
    reasons.clear();
  }
  if (d.verdict == Verdict::none) return reasons;
  if (d.verdict == Verdict::not_this_robot) {
    reasons.push_back(
        sentence(fmt::format("the robot file has an error of {} of the power: it belongs to another robot, "
                             "or another state of it{}",
                             percent(d.power_absolute_relative),
                             d.corrections.empty() ? "" : "; values that fit are proposed below")));
  }
  if (!d.outside.channel.empty()) reasons.push_back(outside_words(d.outside));
  if (worse) say_referee(d, reasons);
  if (d.verdict == Verdict::effects) {
    say_effects(d, reasons);
    return reasons;
  }
  say_shrinkage(d, reasons);
  say_effects(d, reasons);
  if (d.outside.channel.empty() && d.outside.probability >= notable_outside) {
    reasons.push_back(
        sentence(fmt::format("a cause outside the catalogue may be present, too (probability {})",
                             probability_text(d.outside.probability))));
  }
  if (d.effects.empty() && d.verdict == Verdict::inconclusive) {
    if (d.power_absolute_relative - d.noise_floor > 0.012) {
      reasons.push_back(sentence(
          fmt::format("the error is {} of the power at a noise floor of {}, and no effect of the catalogue "
                      "explains it well enough to be named",
                      percent(d.power_absolute_relative), percent(d.noise_floor))));
    } else if (d.detectable_share < d.noise_floor) {
      reasons.push_back(sentence(
          fmt::format("the error is {} of the power, which may be noise or a hidden cause: nothing in these "
                      "recordings predicts it",
                      percent(d.power_absolute_relative))));
    } else {
      reasons.push_back(sentence(
          fmt::format("an effect of less than {} of the power is not detectable in these recordings, so "
                      "that the absence of a cause proves little",
                      percent(d.detectable_share))));
    }
  }
  if (reasons.empty() && !d.effects.empty()) {
    const auto least = std::ranges::min(d.effects, {}, &DiagnosedEffect::probability);
    reasons.push_back(sentence(fmt::format("the probability of {} is only {}", words_of(least.id),
                                           probability_text(least.probability))));
  }
  return reasons;
}

}  // namespace joulecast::gap

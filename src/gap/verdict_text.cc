#include "gap/verdict_text.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <cmath>
#include <string_view>
#include <utility>

#include "gap/report_page.h"

namespace joulecast::gap {
namespace {

constexpr double notable_outside = 0.3;  // probability of something unknown that is worth a word
constexpr double notable_rest = 2;       // what is left over noise, the same

std::string channel_words(std::string_view channel) {
  constexpr std::array<std::pair<std::string_view, std::string_view>, 8> words{
      {{"wheel_torque", "the torque at the wheels"},
       {"motor_voltage", "the voltage of the motors"},
       {"battery_voltage", "the voltage of the battery"},
       {"battery_power_from_motors", "battery power beside what the motors take"},
       {"battery_power_from_motion", "battery power"},
       {"yaw_rate", "how fast the robot turns for its wheels' speeds"},
       {"map_travel", "how far the robot comes for its wheels' turns"},
       {"map_turn", "how far the robot turns for its wheels' turns"}}};
  const auto* found =
      std::ranges::find(words, channel, &std::pair<std::string_view, std::string_view>::first);
  return found == words.end() ? words_of(channel) : std::string(found->second);
}

std::string follows_words(std::string_view variable) {
  if (variable == "wheel_angle")
    return "repeats with the turning of a wheel, as of a wheel out of round, a bent axle, a damaged tooth "
           "or a motor that cogs";
  if (variable == "time") return "changes with the time since the mission began";
  if (variable == "recent_motion")
    return "grows or falls with how much the robot moved of late, as of what warms up in use";
  if (variable == "position") return "depends on where the robot is";
  return "follows the " + words_of(variable);
}

std::string sentence(std::string text) {
  text.front() = static_cast<char>(std::toupper(static_cast<unsigned char>(text.front())));
  return text + '.';
}

// What speaks against the effects that are likeliest.
std::vector<std::string> against_effects(const Diagnosis& d) {
  std::vector<std::string> reasons;
  const bool one = d.effects.size() == 1;
  if (d.shrinkage && std::isfinite(d.shrinkage->after)) {
    const Shrinkage& s = *d.shrinkage;
    if (s.interval[1] < 0) {
      reasons.push_back(
          sentence(fmt::format("on missions left out of the fit {}, {} instead of {}, and is no explanation",
                               one ? "it makes the gap larger" : "what they do makes the gap larger",
                               percent(s.after), percent(s.before))));
    } else if (s.interval[0] < 0) {
      reasons.push_back(sentence(fmt::format(
          "that {} on missions left out of the fit is not sure: the gap shrinks by {} to {} there",
          one ? "it helps" : "they help", percent(s.interval[0]), percent(s.interval[1]))));
    } else if (s.after > notable_rest * d.noise_floor) {
      reasons.push_back(sentence(
          fmt::format("with {} {} of the power is still missed on missions left out of the fit, where "
                      "noise makes {}",
                      one ? "it" : "them", percent(s.after), percent(d.noise_floor))));
    }
  }
  for (const DiagnosedEffect& e : d.effects) {
    if (e.alternatives.empty()) continue;
    std::vector<std::string> others;
    for (const std::string& id : e.alternatives) others.push_back(words_of(id));
    reasons.push_back(
        sentence(fmt::format("these data do not tell {} from {}", words_of(e.id), enumerate(others))));
  }
  if (d.outside.probability >= notable_outside) {
    reasons.push_back(sentence(fmt::format(
        "something that no effect of the catalogue describes may be at work as well (probability {})",
        probability_text(d.outside.probability))));
  }
  for (const DiagnosedEffect& e : d.effects) {
    if (e.id == "current_sensor_gain" || e.id == "voltage_sensor_gain")
      reasons.push_back(
          sentence(fmt::format("a load that follows the current would look like {}", words_of(e.id))));
  }
  if (reasons.empty()) {
    const auto least = std::ranges::min(d.effects, {}, &DiagnosedEffect::probability);
    reasons.push_back(sentence(
        fmt::format("{} has a probability of {} only, by what the data show and by how plausible its "
                    "strength is",
                    words_of(least.id), probability_text(least.probability))));
  }
  return reasons;
}

}  // namespace

std::string outside_words(const Outside& outside) {
  return sentence(
      fmt::format("it shows in {} and {}", channel_words(outside.channel), follows_words(outside.follows)));
}

std::vector<std::string> verdict_reasons(const Diagnosis& d) {
  switch (d.verdict) {
    case Verdict::none:
    case Verdict::effects:
      return {};
    case Verdict::outside:
      return {outside_words(d.outside)};
    case Verdict::inconclusive:
      break;
  }
  if (!d.effects.empty()) return against_effects(d);
  if (!std::isfinite(d.power_absolute_relative)) {
    return {d.motor_channels && d.power == PowerSource::none
                ? "No power was recorded, and the torques alone do not decide it."
                : "There is too little to judge by: too few seconds of motion, or neither battery power nor "
                  "motor "
                  "currents."};
  }
  return {
      sentence(fmt::format("{} of the power is missed where noise makes {}, and no effect of the catalogue "
                           "accounts for it well enough to be named",
                           percent(d.power_absolute_relative), percent(d.noise_floor)))};
}

}  // namespace joulecast::gap

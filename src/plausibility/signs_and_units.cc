#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <utility>

#include "plausibility/evaluation.h"
#include "plausibility/faults.h"

namespace joulecast::plausibility {
namespace {

constexpr auto wanted = std::to_array<std::array<std::string_view, 2>>({
    {"wheel_velocity", "rad/s at the wheel, positive forward, right before left"},
    {"motor_voltage", "V at the armature, positive driving forward, right before left"},
    {"motor_current", "A in the armature, positive driving forward, right before left"},
    {"battery_voltage", "V"},
    {"battery_current", "A, positive while discharging"},
    {"velocity_command", "m/s forward and rad/s to the left"},
    {"yaw_rate", "rad/s, positive to the left"},
    {"pitch", "rad, nose up positive"},
    {"pose.heading", "rad from x to y, positive to the left"},
    {"pose", "m, in the frame of the heading"},
    {"payload_mass", "kg"},
});

std::string_view contract_of(std::string_view channel) {
  for (const auto& [start, contract] : wanted)
    if (channel.starts_with(start)) return contract;
  return "";
}

std::string also(const std::vector<const ChannelFault*>& alternatives, const Measured& measured) {
  std::string text;
  const auto add = [&](const std::string& what) { text += (text.empty() ? "; " : " or ") + what; };
  for (const ChannelFault* f : alternatives) add(f->channel + " " + f->cause);
  if (measured.by_gear && measured.factor > 0) {
    add(fmt::format("a gear_ratio in the robot file {:.3g} times the robot's", measured.factor));
  }
  if (measured.by_power && measured.factor > 0)
    add(fmt::format("a robot file whose powers are {:.3g} times the robot's", 1 / measured.factor));
  return text.empty() ? text : text + " would look the same";
}

constexpr double over_limit = 1.5;
constexpr std::size_t fewest_leaps = 2;  // there and back ...
constexpr double alike_leaps = 0.8;  // ... by the period of the counter, plus or minus a row's acceleration
// Departures of sound readings from a constant factor of the wheels' speeds, as logarithms: of turning and
// travel by the tolerance of tracks and radii in one robot, of the motors' voltage constant by that of its
// magnets, of a controller's command. Power by the motion falls with the factor (friction) to its square
// (inertia, drag).
constexpr double motion_agrees = 0.05, constant_agrees = 0.2, power_agrees = 0.35;
constexpr double command_agrees = 0.1;
constexpr double least_constant_factor = 1.5;

// The factor of the wheels' speeds by one independent reading, as logarithms.
struct FactorWitness {
  std::string says;
  double low = 0, high = 0, agrees = 0;
  // Not against the factor where it disagrees: commands are followed by wrong wheel speeds, too, and a range
  // of power is no value.
  bool weak = false;

  double off(double log_factor) const {
    return std::max({low - log_factor, log_factor - high, 0.0}) / agrees;
  }
};

// The readings that compare the speeds of both wheels with something else: one for each kind.
std::vector<FactorWitness> factor_witnesses(std::span<const ChannelEvidence> evidence) {
  struct Kind {
    Source source;
    double agrees;
    bool weak = false;
  };
  std::vector<FactorWitness> found;
  const auto add = [&](const ChannelEvidence& e, double low, double high, double agrees, bool weak = false) {
    found.push_back(
        {fmt::format("{} {} times {}", e.says, with_interval(e.ratio.value, e.ratio.interval()), e.against),
         low, high, agrees, weak});
  };
  for (const auto& [source, agrees, weak] :
       {Kind{Source::yaw_rate, motion_agrees}, Kind{Source::heading, motion_agrees},
        Kind{Source::position, motion_agrees}, Kind{Source::voltage_right, constant_agrees},
        Kind{Source::command_speed, command_agrees, true}}) {
    const ChannelEvidence* first = nullptr;
    double low = std::numeric_limits<double>::infinity(), high = -low;
    for (const ChannelEvidence& e : evidence) {
      const int right = e.power_of(Source::wheel_right);
      const int wheel = right != 0 ? right : e.power_of(Source::wheel_left);
      const int other = source == Source::voltage_right && e.power_of(source) == 0
                            ? e.power_of(Source::voltage_left)
                            : e.power_of(source);
      if (wheel == 0 || other != -wheel || !(e.ratio.value > 0)) continue;
      if (first == nullptr) first = &e;
      low = std::min(low, wheel * std::log(e.ratio.value));
      high = std::max(high, wheel * std::log(e.ratio.value));
    }
    if (first != nullptr && high - low < agrees) add(*first, low, high, agrees, weak);
  }
  for (const ChannelEvidence& e : evidence) {
    if (!e.by_power || e.says != power_by_motion || !(e.ratio.value > 0)) continue;
    const double least = -std::log(e.ratio.value);
    add(e, std::min(least, 0.5 * least), std::max(least, 0.5 * least), power_agrees, true);
  }
  return found;
}

// Steps of the wheels' speeds there and back by the period of a counter.
bool check_leaps(const CheckContext& c, Checks& checks) {
  std::size_t leaps = 0;
  double least = std::numeric_limits<double>::infinity(), farthest = 0;
  for (const Observation& o : c.seen) {
    leaps += o.leaps;
    least = std::min(least, o.least_leap_rad_s);
    farthest = std::max(farthest, o.farthest_leap_rad_s);
  }
  // A counter's readings lie within its period.
  double greatest = 0;
  for (const std::size_t k : {reading::wheel_velocity, reading::wheel_velocity + 1})
    greatest = std::max({greatest, c.tally(k).high(), -c.tally(k).low()});
  if (leaps < fewest_leaps || least <= alike_leaps * farthest || greatest >= (2 - alike_leaps) * farthest)
    return false;
  add_check(
      checks, "wheel_velocity_leaps", "wheel_velocity", static_cast<double>(leaps), true,
      "wheel_velocity steps {} times by up to {:.4g} rad/s from one sample to the next, {:.3g} times "
      "limits.speed_m_s, and stays: no robot accelerates so; a counter that overflows? An import undoes "
      "it with wraps_at.",
      leaps, farthest, farthest * c.robot.kinematics.wheel_radius_m / c.robot.limits.speed_m_s);
  return true;
}

}  // namespace

void check_signs_and_units(const CheckContext& c, Checks& checks) {
  const std::vector<ChannelEvidence> evidence = gather_evidence(c);
  std::vector<ChannelFault> faults = known_faults(c.robot);
  if (auto odd = odd_pose_scale(evidence)) faults.push_back(*std::move(odd));
  const FaultExplanation explanation = explain_faults(evidence, faults);
  for (std::size_t k = 0; k < explanation.faults.size(); ++k) {
    const ChannelFault& fault = *explanation.faults[k];
    const Measured measured = measured_factor(evidence, explanation, fault);
    if (measured.evidence == nullptr) continue;
    const ChannelEvidence& e = *measured.evidence;
    Check& check =
        checks.emplace_back(Check{fault.id, fault.channel, measured.factor, measured.interval, {}, true});
    check.says = fmt::format("{} looks {}: {} {} times {}; joulecast expects {}{}.", fault.channel,
                             fault.cause, e.says, with_interval(e.ratio.value, e.ratio.interval()), e.against,
                             contract_of(fault.channel), also(explanation.alternatives[k], measured));
    // A robot file that is wrong by the factor would look the same.
    const bool by_file = measured.factor > 0 && (measured.by_gear || measured.by_power);
    check.probability = explanation.probability[k] / (by_file ? 1 + explanation.probability[k] : 1);
    const auto factor = std::ranges::find_if(fault.factor, [](double f) { return f != 1; });
    check.swapped = fault.swaps != 0 && check.probability > 0.5;
    if (factor == fault.factor.end() || check.probability <= 0.5) continue;
    // A unit is a correction only where its own measurement agrees with it.
    if (*factor == -1 || std::fabs(std::log(measured.factor / *factor)) < same_ratio) check.factor = *factor;
  }
}

// Speeds of the wheels that overflow; or are all too large or too small by the factor of a unit or of an
// encoder's counts (2, 4), if every reading that they can be compared with agrees on it, two at least.
void check_wheels(const CheckContext& c, Checks& checks) {
  if (!c.heard({reading::wheel_velocity, reading::wheel_velocity + 1}) || check_leaps(c, checks)) return;
  const std::vector<FactorWitness> witnesses = factor_witnesses(gather_evidence(c));
  if (witnesses.size() < 2) return;
  struct Factor {
    double factor;
    std::string cause;
  };
  std::vector<Factor> factors{{2, "counted twice"},
                              {4, "counted four times"},
                              {0.5, "counted half"},
                              {0.25, "counted a quarter"},
                              {2 * std::numbers::pi, "multiplied by 2 pi"}};
  for (const ChannelFault& f : known_faults(c.robot)) {
    const double factor = f.factor[static_cast<std::size_t>(Source::wheel_right)];
    if (f.channel == "wheel_velocity" && factor > 0 && factor != 1) factors.push_back({factor, f.cause});
  }
  const Factor* best = nullptr;
  double least = std::numeric_limits<double>::infinity();
  for (const Factor& one : factors) {
    const double log_factor = std::log(one.factor);
    if (std::fabs(log_factor) < std::log(least_constant_factor)) continue;
    double sum = 0;
    std::size_t agree = 0, strong = 0;
    bool against = false;
    for (const FactorWitness& w : witnesses) {
      const bool agrees = w.off(log_factor) <= 1;
      agree += agrees, strong += agrees && !w.weak;
      against = against || (!agrees && !w.weak);
      if (agrees) sum += w.off(log_factor);
    }
    // Of equally good factors the one on which more agree.
    if (against || strong == 0 || agree < 2) continue;
    sum -= static_cast<double>(agree);
    if (sum >= least) continue;
    least = sum;
    best = &one;
  }
  if (best == nullptr) return;
  std::string says =
      fmt::format("wheel_velocity is {:.3g} times the motion, {}: ", best->factor, best->cause);
  bool first = true;
  for (const FactorWitness& w : witnesses)
    if (w.off(std::log(best->factor)) <= 1)
      says.append(std::exchange(first, false) ? "" : "; ").append(w.says);
  says.append("; joulecast expects ").append(contract_of("wheel_velocity")).append(".");
  checks.push_back(
      {"wheel_velocity_scale", "wheel_velocity", best->factor, no_interval, std::move(says), true});
  checks.back().factor = best->factor;
}

// Reports speeds beyond the file's limits, if no other check contradicts their channel.
void check_limits(const CheckContext& c, Checks& checks) {
  const auto look = [&](const char* id, std::size_t at, const char* channel, double fastest, double limit,
                        const char* what, const char* unit) {
    const double ratio = fastest / limit;
    if (!c.heard({at}) || !(limit > 0) || ratio < over_limit) return;
    add_check(checks, id, channel, ratio, false,
              "{} reaches {:.3g} times the file's {} in the usual mission: is it {}? joulecast expects {}.",
              channel, ratio, what, unit, contract_of(channel));
  };
  look("speed_over_limit", reading::wheel_velocity, "wheel_velocity", c.usual(&Observation::fastest_m_s),
       c.robot.limits.speed_m_s, "limits.speed_m_s", "in rpm, or of the motor");
  look("yaw_rate_over_limit", reading::yaw_rate, "yaw_rate", c.usual(&Observation::fastest_turn_rad_s),
       c.robot.limits.yaw_rate_rad_s, "limits.yaw_rate_rad_s", "in degrees");
}

}  // namespace joulecast::plausibility

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "plausibility/evaluation.h"
#include "plausibility/faults.h"
#include "statistics/robust.h"

namespace joulecast::plausibility {
namespace {

struct Wanted {
  std::string_view channel, contract;
};
constexpr auto wanted = std::to_array<Wanted>({
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
  for (const Wanted& w : wanted) {
    if (channel.starts_with(w.channel)) return w.contract;
  }
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

}  // namespace

std::vector<Check> check_signs_and_units(const CheckContext& c) {
  const std::vector<ChannelEvidence> evidence = gather_evidence(c);
  std::vector<ChannelFault> faults = known_faults(c.robot);
  if (auto odd = odd_pose_scale(evidence)) faults.push_back(*std::move(odd));
  const FaultExplanation explanation = explain_faults(evidence, faults);
  std::vector<Check> checks;
  for (std::size_t k = 0; k < explanation.faults.size(); ++k) {
    const ChannelFault& fault = *explanation.faults[k];
    const Measured measured = measured_factor(evidence, explanation, fault);
    if (measured.evidence == nullptr) continue;
    const ChannelEvidence& e = *measured.evidence;
    Check check{fault.id, fault.channel, measured.factor, measured.interval, {}, true};
    check.says = fmt::format("{} looks {}: {} {} times {}; joulecast expects {}{}.", fault.channel,
                             fault.cause, e.says, with_interval(e.ratio.value, e.ratio.interval()), e.against,
                             contract_of(fault.channel), also(explanation.alternatives[k], measured));
    checks.push_back(std::move(check));
  }
  return checks;
}

// Reports speeds beyond the file's limits, if no other check contradicts their channel.
std::vector<Check> check_limits(const CheckContext& c) {
  std::vector<double> speed, turn;
  for (const Observation& o : c.seen) {
    if (o.fastest_m_s > 0) speed.push_back(o.fastest_m_s);
    if (o.fastest_turn_rad_s > 0) turn.push_back(o.fastest_turn_rad_s);
  }
  std::vector<Check> checks;
  const auto look = [&](const char* id, const char* channel, std::vector<double>& fastest, double limit,
                        const char* what) {
    const std::size_t at =
        std::string_view(channel) == "yaw_rate" ? reading::yaw_rate : reading::wheel_velocity;
    if (fastest.empty() || !c.heard({at}) || !(limit > 0)) return;
    const double ratio = statistics::median(fastest) / limit;
    if (ratio < over_limit) return;
    checks.push_back(
        {id,
         channel,
         ratio,
         {std::numeric_limits<double>::quiet_NaN(), std::numeric_limits<double>::quiet_NaN()},
         fmt::format(
             "{} reaches {:.3g} times the file's {} in the usual mission: is it {}? joulecast expects {}.",
             channel, ratio, what, at == reading::yaw_rate ? "in degrees" : "in rpm, or of the motor",
             contract_of(channel)),
         false});
  };
  look("speed_over_limit", "wheel_velocity", speed, c.robot.limits.speed_m_s, "limits.speed_m_s");
  look("yaw_rate_over_limit", "yaw_rate", turn, c.robot.limits.yaw_rate_rad_s, "limits.yaw_rate_rad_s");
  return checks;
}

}  // namespace joulecast::plausibility

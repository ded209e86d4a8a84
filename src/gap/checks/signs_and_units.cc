#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "gap/checks/evaluation.h"
#include "gap/checks/faults.h"

namespace joulecast::gap {
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

std::string also(const std::vector<const Fault*>& alternatives) {
  std::string text;
  for (const Fault* f : alternatives) {
    text += fmt::format("{}{} {}", text.empty() ? "; it would be the same with " : " or ", f->channel, f->cause);
  }
  return text;
}

// More of the same kind than this come from one mistake.
constexpr double fits = 2.0;  // standard deviations of what sound robots differ by

}  // namespace

std::vector<Check> check_signs_and_units(const CheckContext& c) {
  const std::vector<Evidence> evidence = gather_evidence(c.seen, c.robot, c.model, c.motor_delay_s, c.silent);
  const std::vector<Fault> faults = known_faults(c.robot);
  const Explanation explanation = explain(evidence, faults);
  std::vector<Check> checks;
  for (std::size_t k = 0; k < explanation.faults.size(); ++k) {
    const Fault& fault = *explanation.faults[k];
    const Measured measured = measured_factor(evidence, explanation, fault);
    if (measured.evidence == nullptr) continue;
    const Evidence& e = *measured.evidence;
    Check check{fault.id, fault.channel, measured.factor, measured.interval, {}, true};
    check.says = fmt::format("{} looks {}: {} {} times {}; joulecast wants {}{}.", fault.channel, fault.cause, e.says,
                             with_interval(e.ratio.value, e.ratio.interval()), e.against, contract_of(fault.channel),
                             also(explanation.alternatives[k]));
    checks.push_back(std::move(check));
  }
  return checks;
}

}  // namespace joulecast::gap

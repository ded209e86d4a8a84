#include "plausibility/faults.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <limits>
#include <numbers>

namespace joulecast::plausibility {
namespace {

using S = Source;

constexpr double sign_surprise = 4, unit_surprise = 4, swap_surprise = 4.5, odd_surprise = 5.5;
constexpr double lost_surprise = 1;   // of evidence that a fault would make meaningless
constexpr double least_support = 1;   // nats by which the support for a fault must exceed its surprise
constexpr double least_gain = 4;      // nats, beyond the fault's own surprise
constexpr double nearly = 1.5;        // nats between explanations that are about equally good
constexpr double least_factor = 2.0;  // factors nearer to 1 than this are errors of calibration, not of units
constexpr double degrees = 180 / std::numbers::pi, rpm = 30 / std::numbers::pi;
constexpr double km_h = 3.6, mph = 2.2369, feet = 3.2808;  // per m/s

using Set = std::vector<const ChannelFault*>;

// Several faults in combination.
struct Combined {
  explicit Combined(const Set& set) {
    factor.fill(1);
    for (const ChannelFault* fault : set) {
      for (std::size_t k = 0; k < source_count; ++k) factor[k] *= fault->factor[k];
      swaps ^= fault->swaps;
      surprise += fault->surprise;
    }
  }
  Sources<double> factor;
  std::uint32_t swaps = 0;
  double surprise = 0;
};

// The ratio that the faults predict for this evidence; empty where they make it meaningless.
std::optional<double> predicted(const ChannelEvidence& e, const Combined& faults) {
  const Sources<double>& factor = faults.factor;
  double ratio = 1;
  for (std::size_t k = 0; k < source_count; ++k) {
    if (e.lost_by[k] && std::fabs(factor[k]) != 1) return std::nullopt;
    if (e.exponent[k] != 0 && factor[k] != 1) ratio *= std::pow(factor[k], e.exponent[k]);
  }
  if (e.both_sides) {
    for (const S right : {S::wheel_right, S::voltage_right, S::current_right}) {
      const auto r = static_cast<std::size_t>(right);
      // The power of a load barely depends on the direction of a wheel.
      const bool differ = e.lost_by[r] ? std::fabs(factor[r]) != std::fabs(factor[r + 1])
                                       : e.exponent[r] != 0 && factor[r] != factor[r + 1];
      if (differ) return std::nullopt;
    }
  }
  for (std::uint32_t bit = 1; bit <= 4; bit *= 2) {
    if ((faults.swaps & e.turned_by & bit) != 0) ratio = -ratio;
  }
  return e.magnitude ? std::fabs(ratio) : ratio;
}

double surprise_of(const ChannelEvidence& e, const Combined& faults) {
  const auto expected = predicted(e, faults);
  if (!expected) return std::min(lost_surprise, e.trust);
  const double ratio = e.ratio.value / *expected;
  if (ratio < 0) return e.trust;
  const double log_sd = e.ratio.sd / std::fabs(e.ratio.value);
  const double off = std::log(ratio), tolerance = off < 0 ? e.below : e.above;
  if (tolerance == 0) return 0;
  return std::min(0.5 * off * off / (tolerance * tolerance + log_sd * log_sd), e.trust);
}

// Sum over all evidence; summation stops once it exceeds `most`.
double surprise_of(std::span<const ChannelEvidence> evidence, const Combined& faults,
                   double most = std::numeric_limits<double>::infinity()) {
  double total = faults.surprise;
  for (const ChannelEvidence& e : evidence) {
    if (total > most) break;
    total += surprise_of(e, faults);
  }
  return total;
}

// True if each fault predicts the observations, and does not only make contradicting evidence meaningless.
bool supported(std::span<const ChannelEvidence> evidence, const Set& set) {
  const Combined all(set);
  return std::ranges::all_of(set, [&](const ChannelFault* fault) {
    Set rest;
    std::ranges::copy_if(set, std::back_inserter(rest), [&](const ChannelFault* f) { return f != fault; });
    const Combined others(rest);
    double support = 0;
    for (const ChannelEvidence& e : evidence) {
      if (predicted(e, all)) support += surprise_of(e, others) - surprise_of(e, all);
    }
    return support >= fault->surprise + least_support;
  });
}

class Table {
 public:
  void add(std::string id, std::string channel, std::string cause, std::initializer_list<S> sources,
           double factor, double surprise, std::uint32_t swaps = 0) {
    if (swaps == 0 && factor > 0 && std::fabs(std::log(factor)) < std::log(least_factor)) return;
    ChannelFault& f = faults_.emplace_back();
    f.id = std::move(id);
    f.channel = std::move(channel);
    f.cause = std::move(cause);
    f.factor.fill(1);
    for (const S s : sources) f.factor[static_cast<std::size_t>(s)] = factor;
    f.surprise = surprise;
    f.swaps = swaps;
  }
  std::vector<ChannelFault> take() { return std::move(faults_); }

 private:
  std::vector<ChannelFault> faults_;
};

void add_motor_faults(Table& t) {
  struct Pair {
    const char* field;
    S right, left;
    std::uint32_t swap;
    const char* milli;
  };
  for (const Pair& p : {Pair{"motor_voltage", S::voltage_right, S::voltage_left, 2, "given in mV"},
                        Pair{"motor_current", S::current_right, S::current_left, 4, "given in mA"}}) {
    const std::string field = p.field;
    t.add(field + "_reversed", field, "reversed on both sides", {p.right, p.left}, -1, sign_surprise);
    t.add(field + "_reversed", field + ".right", "reversed", {p.right}, -1, sign_surprise);
    t.add(field + "_reversed", field + ".left", "reversed", {p.left}, -1, sign_surprise);
    t.add(field + "_scale", field, p.milli, {p.right, p.left}, 1000, unit_surprise);
    t.add(field + "_scale", field + ".right", p.milli, {p.right}, 1000, odd_surprise);
    t.add(field + "_scale", field + ".left", p.milli, {p.left}, 1000, odd_surprise);
    t.add(field + "_scale", field, "divided by 1000 once too often", {p.right, p.left}, 0.001, odd_surprise);
    t.add(field + "_sides_swapped", field, "swapped between right and left", {}, 1, swap_surprise, p.swap);
  }
  t.add("motor_sides_swapped", "motor_voltage, motor_current", "swapped between right and left", {}, 1,
        swap_surprise, 2 | 4);
}

void add_wheel_faults(Table& t, const robot::RobotModel& robot) {
  const std::initializer_list<S> both{S::wheel_right, S::wheel_left};
  const double gear = robot.motor.gear_ratio, radius = robot.kinematics.wheel_radius_m;
  // With such readings the robot visibly appears to drive backwards, so that the fault is less likely.
  t.add("wheel_velocity_reversed", "wheel_velocity", "reversed on both sides", both, -1, sign_surprise + 0.5);
  t.add("wheel_velocity_reversed", "wheel_velocity.right", "reversed", {S::wheel_right}, -1, sign_surprise);
  t.add("wheel_velocity_reversed", "wheel_velocity.left", "reversed", {S::wheel_left}, -1, sign_surprise);
  t.add("wheel_velocity_sides_swapped", "wheel_velocity", "swapped between right and left", {}, 1,
        swap_surprise, 1);
  t.add("wheel_velocity_scale", "wheel_velocity", "given in rpm", both, rpm, unit_surprise);
  t.add("wheel_velocity_scale", "wheel_velocity", "given in degrees a second", both, degrees, unit_surprise);
  t.add("wheel_velocity_scale", "wheel_velocity", "given in m/s at the rim", both, radius, unit_surprise);
  t.add("wheel_velocity_scale", "wheel_velocity", "given at the motor shaft", both, gear, unit_surprise);
  t.add("wheel_velocity_scale", "wheel_velocity", "given at the motor shaft in rpm", both, gear * rpm,
        odd_surprise);
  t.add("wheel_velocity_scale", "wheel_velocity", "given in mm/s at the rim", both, 1000 * radius,
        odd_surprise);
  t.add("wheel_velocity_scale", "wheel_velocity", "converted from rpm once too often", both, 1 / rpm,
        odd_surprise);
  t.add("wheel_velocity_scale", "wheel_velocity", "given in turns a second", both, 0.5 / std::numbers::pi,
        odd_surprise);
  t.add("wheel_velocity_scale", "wheel_velocity", "divided by the gear ratio once too often", both, 1 / gear,
        odd_surprise);
  t.add("wheel_velocity_scale", "wheel_velocity", "computed from km/h as if they were m/s", both, km_h,
        odd_surprise);
  t.add("wheel_velocity_scale", "wheel_velocity", "computed from m/s as if they were km/h", both, 1 / km_h,
        odd_surprise);
  t.add("wheel_velocity_scale", "wheel_velocity", "computed from miles an hour as if they were m/s", both,
        mph, odd_surprise);
  t.add("wheel_velocity_scale", "wheel_velocity", "computed from feet a second as if they were m/s", both,
        feet, odd_surprise);
}

}  // namespace

std::vector<ChannelFault> known_faults(const robot::RobotModel& robot) {
  Table t;
  add_wheel_faults(t, robot);
  add_motor_faults(t);
  t.add("battery_current_reversed", "battery_current", "reversed", {S::battery_current}, -1, sign_surprise);
  t.add("battery_current_scale", "battery_current", "given in mA", {S::battery_current}, 1000, unit_surprise);
  t.add("battery_current_scale", "battery_current", "given in mA and reversed", {S::battery_current}, -1000,
        unit_surprise + 1);
  t.add("battery_current_scale", "battery_current", "divided by 1000 once too often", {S::battery_current},
        0.001, odd_surprise);
  t.add("battery_current_scale", "battery_current", "given in W", {S::battery_current},
        robot.battery.nominal_voltage_v, unit_surprise);
  t.add("battery_voltage_scale", "battery_voltage", "given in mV", {S::battery_voltage}, 1000, unit_surprise);
  t.add("battery_voltage_scale", "battery_voltage", "divided by 1000 once too often", {S::battery_voltage},
        0.001, odd_surprise);
  t.add("yaw_rate_reversed", "yaw_rate", "reversed", {S::yaw_rate}, -1, sign_surprise - 0.5);
  t.add("yaw_rate_scale", "yaw_rate", "given in degrees a second", {S::yaw_rate}, degrees, unit_surprise);
  t.add("yaw_rate_scale", "yaw_rate", "given in degrees a second and reversed", {S::yaw_rate}, -degrees,
        unit_surprise + 1);
  t.add("yaw_rate_scale", "yaw_rate", "converted from degrees once too often", {S::yaw_rate}, 1 / degrees,
        odd_surprise);
  t.add("pose_heading_reversed", "pose.heading", "reversed, as in frames with z down", {S::heading}, -1,
        sign_surprise);
  t.add("pose_heading_scale", "pose.heading", "given in degrees", {S::heading}, degrees, unit_surprise);
  t.add("pose_heading_scale", "pose.heading", "given in degrees and reversed", {S::heading}, -degrees,
        unit_surprise + 1);
  t.add("pose_scale", "pose.x, pose.y", "given in mm", {S::position}, 1000, unit_surprise);
  t.add("pose_scale", "pose.x, pose.y", "given in cm", {S::position}, 100, odd_surprise);
  t.add("pose_reversed", "pose.x, pose.y", "reversed against its heading", {S::position}, -1, sign_surprise);
  t.add("velocity_command_scale", "velocity_command", "given in mm/s", {S::command_speed}, 1000,
        unit_surprise);
  t.add("velocity_command_reversed", "velocity_command.speed", "reversed", {S::command_speed}, -1,
        sign_surprise - 0.5);
  t.add("velocity_command_reversed", "velocity_command.turn", "reversed", {S::command_turn}, -1,
        sign_surprise - 0.5);
  t.add("pitch_reversed", "pitch", "reversed", {S::pitch}, -1, sign_surprise);
  t.add("pitch_scale", "pitch", "given in degrees", {S::pitch}, degrees, unit_surprise);
  t.add("payload_scale", "payload_mass", "given in g", {S::payload}, 1000, unit_surprise);
  return t.take();
}

std::optional<ChannelFault> odd_pose_scale(std::span<const ChannelEvidence> evidence) {
  constexpr auto position = static_cast<std::size_t>(S::position);
  const auto moved = std::ranges::find_if(
      evidence, [](const ChannelEvidence& e) { return e.magnitude && e.exponent[position] == 1; });
  if (moved == evidence.end()) return std::nullopt;
  Table t;
  t.add("pose_scale", "pose.x, pose.y", "off by a factor that no unit has", {S::position}, moved->ratio.value,
        odd_surprise + 1);
  const std::vector<ChannelFault> odd = t.take();
  return odd.empty() ? std::nullopt : std::optional(odd.front());
}

FaultExplanation explain_faults(std::span<const ChannelEvidence> evidence,
                                std::span<const ChannelFault> faults) {
  FaultExplanation best;
  Set set;
  const double none = surprise_of(evidence, Combined(set));
  double least = none;
  if (none < least_gain) return best;
  const auto try_set = [&](const Set& candidate) {
    const double s = surprise_of(evidence, Combined(candidate), least);
    if (!(s < least - 1e-9) || !supported(evidence, candidate)) return;
    least = s;
    set = candidate;
  };
  for (const ChannelFault& one : faults) {
    try_set({&one});
    for (const ChannelFault& two : faults) {
      if (&two > &one) try_set({&one, &two});
    }
  }
  if (set.size() == 2) {
    const Set pair = set;
    for (const ChannelFault& third : faults) try_set({pair[0], pair[1], &third});
  }
  if (set.empty() || none - least < least_gain * static_cast<double>(set.size())) return best;
  best.gain = none - least;
  best.faults = set;
  for (std::size_t k = 0; k < set.size(); ++k) {
    auto& others = best.alternatives.emplace_back();
    for (const ChannelFault& fault : faults) {
      Set with = set;
      with[k] = &fault;
      if (&fault == set[k] || surprise_of(evidence, Combined(with), least + nearly) > least + nearly)
        continue;
      if (supported(evidence, with)) others.push_back(&fault);
    }
  }
  return best;
}

Measured measured_factor(std::span<const ChannelEvidence> evidence, const FaultExplanation& explanation,
                         const ChannelFault& fault) {
  Set rest;
  for (const ChannelFault* f : explanation.faults) {
    if (f != &fault) rest.push_back(f);
  }
  const Combined others(rest), all(explanation.faults);
  Measured best;
  double most = 0;
  bool by_gear = true, by_power = true;
  for (const ChannelEvidence& e : evidence) {
    const auto without = predicted(e, others), with = predicted(e, all);
    if (!without || !with || *without == *with) continue;
    const double supports = surprise_of(e, others) - surprise_of(e, all);
    if (supports >= least_support) by_gear = by_gear && e.by_gear, by_power = by_power && e.by_power;
    if (supports <= most) continue;
    most = supports;
    // The exponent of the fault's own factor; swaps reverse the sign only.
    int exponent = 1;
    for (std::size_t k = 0; k < source_count; ++k) {
      if (fault.factor[k] != 1 && e.exponent[k] != 0) exponent = e.exponent[k];
    }
    const auto factor = [&](double ratio) { return std::pow(ratio / *without, exponent); };
    best.evidence = &e;
    best.factor = factor(e.ratio.value);
    const auto interval = e.ratio.interval();
    best.interval = {factor(interval[0]), factor(interval[1])};
    if (best.interval[0] > best.interval[1]) std::swap(best.interval[0], best.interval[1]);
  }
  best.by_gear = by_gear && best.evidence != nullptr;
  best.by_power = by_power && best.evidence != nullptr;
  return best;
}

}  // namespace joulecast::plausibility

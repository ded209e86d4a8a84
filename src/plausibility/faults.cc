#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>
#include <numbers>

#include "plausibility/evidence.h"

namespace joulecast::plausibility {
namespace {

using namespace reading;

constexpr double slight = 1;  // nats: least surprise of meaningless evidence, least of a fault's support
constexpr double least_told = 0.2, certain = 0.982;  // probability of an error: told; its channel is not used
constexpr double nearly = 1.5;                       // nats between explanations that are about equally good
constexpr double least_factor = 2.0;                 // of a unit
constexpr double degrees = 180 / std::numbers::pi, rpm = 30 / std::numbers::pi;
constexpr double km_h = 3.6, mph = 2.2369, feet = 3.2808;  // per m/s

using Set = std::vector<const ChannelFault*>;

// Several faults in combination; impossible where two scale one channel.
struct Combined {
  explicit Combined(const Set& set) {
    factor.fill(1);
    for (const ChannelFault* fault : set) {
      for (std::size_t k = 0; k < factor.size(); ++k) {
        if (std::fabs(factor[k]) != 1 && std::fabs(fault->factor[k]) != 1)
          surprise = std::numeric_limits<double>::infinity();
        factor[k] *= fault->factor[k];
      }
      swaps ^= fault->swaps;
      surprise += fault->surprise;
    }
  }
  std::array<double, factor_count> factor;
  std::uint32_t swaps = 0;
  double surprise = 0;
};

// The ratio that the faults predict for this evidence; empty where they make it meaningless.
std::optional<double> predicted(const ChannelEvidence& e, const Combined& faults) {
  const auto& factor = faults.factor;
  // A path along a reversed heading is not the reversed path.
  const auto lost = [&](std::size_t k) { return k == heading ? factor[k] != 1 : std::fabs(factor[k]) != 1; };
  if (std::ranges::any_of(e.lost_by, lost)) return std::nullopt;
  double ratio = 1;
  for (const auto& [k, power] : e.powers)
    if (factor[k] != 1)
      ratio *= std::pow(std::fabs(factor[k]), power) *
               (factor[k] < 0 && std::fmod(std::fabs(power), 2) == 1 ? -1 : 1);
  for (const std::size_t right : {wheel_velocity, motor_voltage, motor_current}) {
    // The power of a load barely depends on the direction of a wheel.
    const double r = factor[right], l = factor[right + 1];
    if (e.both_sides && (e.by_power ? std::fabs(r) != std::fabs(l) : e.power_of(right) != 0 && r != l))
      return std::nullopt;
  }
  if (std::popcount(faults.swaps & e.turned_by) % 2 == 1) ratio = -ratio;
  return e.magnitude ? std::fabs(ratio) : ratio;
}

// Half of the robots agree with a property of their file this well, as logarithms: turning and travel by the
// spread of tracks and radii of one robot, the motors' voltage constant by that of their magnets, wheels by a
// controller's error.
double core_of(Property property) {
  switch (property) {
    case Property::gyro_track:
    case Property::map_track:
    case Property::radius:
    case Property::accelerating_power:
      return 0.05;
    case Property::following:
    case Property::steady_power:
      return 0.1;
    case Property::voltage_constant:
      return 0.2;
    default:
      return 0;
  }
}

double surprise_of(const ChannelEvidence& e, const Combined& faults) {
  if (e.trust == 0) return 0;
  const auto expected = predicted(e, faults);
  // A fault gains nothing by making evidence meaningless.
  if (!expected) return std::max(std::min(slight, e.trust), surprise_of(e, Combined({})));
  const double ratio = e.ratio.value / *expected;
  if (ratio < 0) return e.trust;
  const double log_sd = std::hypot(e.ratio.sd / e.ratio.value, e.unexplained);
  const double off = std::log(ratio), tolerance = e.off[off < 0 ? 0 : 1], core = core_of(e.property);
  if (tolerance == 0) return 0;
  const auto squares = [&](double sd) {
    const double z2 = off * off / (sd * sd + log_sd * log_sd);
    return e.heavy_tails ? 2 * std::log1p(z2 / 3) : 0.5 * z2;
  };
  const double surprise = std::min(squares(tolerance), e.trust);
  if (core == 0) return surprise;
  const double within = tolerance / (tolerance + core);  // relative density in the middle
  return surprise - std::log(within * std::exp(-squares(core)) + 1 - within) / e.alike;
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

// 1 for swapped sides.
double factor_of(const ChannelFault& fault) {
  const auto factor = std::ranges::find_if(fault.factor, [](double f) { return f != 1; });
  return factor == fault.factor.end() ? 1 : *factor;
}

Set set_without(const Set& set, const ChannelFault* fault) {
  Set rest = set;
  std::erase(rest, fault);
  return rest;
}

// True if the fault changes what some evidence is expected to be: else these data say nothing about it.
bool is_tested(std::span<const ChannelEvidence> evidence, const ChannelFault& fault) {
  const Combined with({&fault});
  return std::ranges::any_of(evidence, [&](const ChannelEvidence& e) {
    const auto expected = predicted(e, with);
    return e.trust > 0 && expected && *expected != 1;
  });
}

constexpr double sign_nats = 4, unit_nats = 4, swap_nats = 4.5, odd_nats = 5.5;

// One error of a channel.
struct ChannelError {
  const char* cause;
  double factor, surprise;
  std::uint32_t swaps = 0;
};

std::string also(const std::vector<const ChannelFault*>& alternatives, const Measured& measured) {
  std::string text;
  const auto add = [&](const std::string& what) {
    text += (text.empty() ? "; other explanations: " : ", ") + what;
  };
  for (const ChannelFault* f : alternatives) add(f->channel + " " + f->cause);
  if (measured.by_gear && measured.factor > 0)
    add(fmt::format("a gear_ratio in the robot file {:.3g} times the robot's", measured.factor));
  if (measured.by_power && measured.factor > 0)
    add(fmt::format("a robot file with {:.3g} times the robot's powers", 1 / measured.factor));
  return text;
}

}  // namespace

std::vector<ChannelFault> known_faults(const robot::RobotModel& robot,
                                       std::span<const ChannelEvidence> evidence) {
  const double gear = robot.motor.gear_ratio, radius = robot.kinematics.wheel_radius_m;
  const char *both = "reversed on both sides", *swapped = "swapped between right and left";
  const char *thousandth = "divided by 1000 once too often", *reversed = "reversed";
  const char *milliamperes = "given in mA", *millivolts = "given in mV";
  std::vector<ChannelFault> all;
  const auto add = [&](const std::string& name, const std::string& channel,
                       std::initializer_list<std::size_t> readings,
                       std::initializer_list<ChannelError> rows) {
    for (const ChannelError& row : rows) {
      if (row.swaps == 0 && row.factor > 0 && std::fabs(std::log(row.factor)) < std::log(least_factor))
        continue;
      const char* kind = row.swaps != 0 ? "_sides_swapped" : row.factor == -1 ? "_reversed" : "_scale";
      all.push_back({name + kind, channel, row.cause, {}, row.swaps, row.surprise});
      all.back().factor.fill(1);
      for (const std::size_t k : readings) all.back().factor[k] = row.factor;
    }
  };
  // With wheels reversed on both sides the robot visibly appears to drive backwards: less likely.
  add("wheel_velocity", "wheel_velocity", {wheel_velocity, wheel_velocity + 1},
      {{both, -1, sign_nats + 0.5},
       {"given in rpm", rpm, unit_nats},
       {"given in degrees a second", degrees, unit_nats},
       {"given in m/s at the rim", radius, unit_nats},
       {"given at the motor shaft", gear, unit_nats},
       {"given at the motor shaft in rpm", gear * rpm, odd_nats},
       {"given in mm/s at the rim", 1000 * radius, odd_nats},
       {"converted from rpm once too often", 1 / rpm, odd_nats},
       {"given in turns a second", 0.5 / std::numbers::pi, odd_nats},
       {"divided by the gear ratio once too often", 1 / gear, odd_nats},
       {"computed from km/h as if they were m/s", km_h, unit_nats},
       {"computed from m/s as if they were km/h", 1 / km_h, odd_nats},
       {"computed from miles an hour as if they were m/s", mph, odd_nats},
       {"computed from feet a second as if they were m/s", feet, odd_nats},
       {"counted twice (2 times the motion)", 2, unit_nats},
       {"counted four times (4 times the motion)", 4, odd_nats},
       {"counted half (0.5 times the motion)", 0.5, odd_nats},
       {"counted a quarter (0.25 times the motion)", 0.25, odd_nats},
       {"multiplied by 2 pi once too often", 2 * std::numbers::pi, odd_nats}});
  add("wheel_radius", std::string(radius_of_file), {double_radius},
      {{"the wheel's diameter in the robot file", 2, unit_nats}});
  add("wheel_radius", std::string(radius_of_file), {half_radius},
      {{"half the wheel's radius in the robot file", 0.5, odd_nats}});
  for (std::size_t k : {0u, 1u})
    add("wheel_velocity", std::string("wheel_velocity.") + side_name[k], {wheel_velocity + k},
        {{reversed, -1, sign_nats}});
  add("wheel_velocity", "wheel_velocity", {}, {{swapped, 1, swap_nats, 1}});
  for (const bool volts : {true, false}) {
    const std::string name = volts ? "motor_voltage" : "motor_current";
    const std::size_t right = volts ? motor_voltage : motor_current;
    const char* thousand = volts ? millivolts : milliamperes;
    add(name, name, {right, right + 1},
        {{both, -1, sign_nats}, {thousand, 1000, unit_nats}, {thousandth, 0.001, odd_nats}});
    for (std::size_t k : {0u, 1u})
      add(name, name + "." + side_name[k], {right + k},
          {{reversed, -1, sign_nats}, {thousand, 1000, odd_nats}});
    add(name, name, {}, {{swapped, 1, swap_nats, volts ? 2u : 4u}});
  }
  add("motor", "motor_voltage, motor_current", {}, {{swapped, 1, swap_nats, 2 | 4}});
  add("battery_current", "battery_current", {battery_current},
      {{reversed, -1, sign_nats},
       {milliamperes, 1000, unit_nats},
       {"given in mA and reversed", -1000, unit_nats + 1},
       {thousandth, 0.001, odd_nats},
       {"10 times the true one", 10, odd_nats},
       {"a tenth of the true one", 0.1, odd_nats},
       {"a hundredth of the true one", 0.01, odd_nats},
       {"given in W", robot.battery.nominal_voltage_v, unit_nats}});
  add("battery_voltage", "battery_voltage", {battery_voltage},
      {{millivolts, 1000, unit_nats}, {thousandth, 0.001, odd_nats}});
  add("yaw_rate", "yaw_rate", {yaw_rate},
      {{reversed, -1, sign_nats - 0.5},
       {"given in degrees a second", degrees, unit_nats},
       {"given in degrees a second and reversed", -degrees, unit_nats + 1},
       {"converted from degrees once too often", 1 / degrees, odd_nats}});
  add("pose_heading", "pose.heading", {heading},
      {{"reversed, as in frames with z down", -1, sign_nats},
       {"given in degrees", degrees, unit_nats},
       {"given in degrees and reversed", -degrees, unit_nats + 1}});
  add("pose", "pose.x, pose.y", {x},
      {{"given in mm", 1000, unit_nats},
       {"given in cm", 100, odd_nats},
       {"reversed against its heading", -1, sign_nats}});
  add("velocity_command", "velocity_command.speed", {command_speed},
      {{"given in mm/s", 1000, unit_nats}, {reversed, -1, sign_nats - 0.5}});
  add("velocity_command", "velocity_command.turn", {command_turn}, {{reversed, -1, sign_nats - 0.5}});
  add("pitch", "pitch", {pitch}, {{reversed, -1, sign_nats}, {"given in degrees", degrees, unit_nats}});
  add("payload", "payload_mass", {payload}, {{"given in g", 1000, unit_nats}});
  const auto moved = std::ranges::find_if(
      evidence, [](const ChannelEvidence& e) { return e.magnitude && e.power_of(x) == 1 && e.trust > 0; });
  if (moved != evidence.end())
    add("pose", "pose.x, pose.y", {x},
        {{"off by a factor that no unit has", moved->ratio.value, odd_nats + 1}});
  // Times of another scale, with wheel speeds that are measured, or slopes of positions over these times.
  for (const ChannelEvidence& e : evidence) {
    const double factor = 1 / e.ratio.value, size = std::max(factor, 1 / factor);
    if (e.power_of(heading) != 1 || e.power_of(yaw_rate) != -1 || e.trust == 0 ||
        !(std::log(size) > std::log(least_factor) - same_ratio))
      continue;
    for (const double wheels : {1.0, e.ratio.value}) {
      ChannelFault& fault = all.emplace_back();
      fault = {"utime_scale",
               "utime",
               fmt::format("{:.3g} times too {}", size, factor > 1 ? "long" : "short"),
               {},
               0,
               odd_nats + 2};
      fault.factor.fill(1);
      fault.factor[time_scale] = factor;
      fault.factor[wheel_velocity] = fault.factor[wheel_velocity + 1] = wheels;
    }
  }
  return all;
}

FaultExplanation explain_faults(std::span<const ChannelEvidence> evidence,
                                std::span<const ChannelFault> faults) {
  FaultExplanation best;
  Set tested, set;
  for (const ChannelFault& fault : faults)
    if (is_tested(evidence, fault)) tested.push_back(&fault);
  const double none = surprise_of(evidence, Combined({}));
  double least = std::numeric_limits<double>::infinity();
  const auto try_set = [&](const Set& candidate) {
    const double most = candidate.size() > 1 ? std::min(least, none) : least;
    const double s = surprise_of(evidence, Combined(candidate), most);
    if (!(s < most - 1e-9)) return;
    least = s;
    set = candidate;
  };
  for (const ChannelFault* one : tested) try_set({one});
  for (std::size_t one = 0; one < tested.size(); ++one)
    for (std::size_t two = one + 1; two < tested.size(); ++two) try_set({tested[one], tested[two]});
  if (set.size() == 2) {
    const Set pair = set;
    for (const ChannelFault* third : tested) try_set({pair[0], pair[1], third});
  }
  for (std::size_t k = 0; k < set.size(); ++k) {
    std::vector<const ChannelFault*> others;
    double absent = std::exp(least - surprise_of(evidence, Combined(set_without(set, set[k]))));
    if (set.size() > 1) absent += std::exp(least - none);
    // Of the fault or one that is nearly the same, and of all.
    double same = 1, all = 1 + absent;
    Set with = set;
    for (const ChannelFault* fault : tested) {
      with[k] = fault;
      if (std::ranges::count(set, fault) > 0) continue;
      const double more = surprise_of(evidence, Combined(with)) - least;
      all += std::exp(-more);
      if (fault->id == set[k]->id && std::fabs(std::log(factor_of(*fault) / factor_of(*set[k]))) < same_ratio)
        same += std::exp(-more);
      if (more <= nearly) others.push_back(fault);
    }
    if (1 - absent / all < least_told) continue;
    best.faults.push_back(set[k]);
    best.alternatives.push_back(std::move(others));
    best.probability.push_back(same / all);
    best.any.push_back(1 - absent / all);
  }
  return best;
}

Measured measured_factor(std::span<const ChannelEvidence> evidence, const FaultExplanation& explanation,
                         const ChannelFault& fault) {
  const Combined others(set_without(explanation.faults, &fault)), all(explanation.faults);
  Measured best;
  double most = 0;
  bool by_gear = true, by_power = true;
  for (const ChannelEvidence& e : evidence) {
    const auto without = predicted(e, others), with = predicted(e, all);
    if (!without || !with || *without == *with) continue;
    const double supports = surprise_of(e, others) - surprise_of(e, all);
    // The exponent of the fault's own factor; swaps reverse the sign only.
    double exponent = 1;
    for (const auto& [k, power] : e.powers)
      if (fault.factor[k] != 1) exponent = power;
    if (supports >= slight)
      by_gear = by_gear && e.by_gear, by_power = by_power && e.by_power && exponent == 1;
    if (supports <= most) continue;
    most = supports;
    const auto factor = [&](double ratio) { return std::pow(ratio / *without, 1 / exponent); };
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

void check_faults(const CheckContext& c, Checks& checks) {
  const std::vector<ChannelEvidence>& evidence = evidence_of(c);
  const std::vector<ChannelFault> faults = known_faults(c.robot, evidence);
  const FaultExplanation explanation = explain_faults(evidence, faults);
  for (std::size_t k = 0; k < explanation.faults.size(); ++k) {
    const ChannelFault& fault = *explanation.faults[k];
    const Measured measured = measured_factor(evidence, explanation, fault);
    if (measured.evidence == nullptr) continue;
    const ChannelEvidence& e = *measured.evidence;
    const bool contradicted = explanation.any[k] >= certain;
    Check& check = checks.emplace_back(
        Check{fault.id, fault.channel, measured.factor, measured.interval, {}, contradicted});
    check.says =
        fmt::format("{} {} {}: {} {} times {}; joulecast expects {}{}.", fault.channel,
                    contradicted ? "looks" : "may be", fault.cause, e.says, with_interval(e.ratio), e.against,
                    contract_of(fault.channel), also(explanation.alternatives[k], measured));
    check.error = explanation.any[k];
    if (!contradicted) continue;
    // A robot file that is wrong by the factor would look the same.
    const bool by_file = measured.factor > 0 && (measured.by_gear || measured.by_power);
    check.probability = explanation.probability[k] / (by_file ? 1 + explanation.probability[k] : 1);
    const double factor = factor_of(fault);
    check.swapped = fault.swaps != 0 && check.probability > 0.5;
    if (factor == 1 || fault.channel == "utime" || check.probability <= 0.5) continue;
    // A unit is a correction only where its own measurement agrees with it.
    if (factor == -1 || std::fabs(std::log(measured.factor / factor)) < same_ratio) check.factor = factor;
  }
}

}  // namespace joulecast::plausibility

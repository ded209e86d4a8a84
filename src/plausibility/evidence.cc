#include "plausibility/evidence.h"

#include <algorithm>
#include <cmath>

namespace joulecast::plausibility {
namespace {

using S = Source;
using Off = std::array<double, 2>;

// Deviations of sound robots from their file, as standard deviations of logarithms below and above 1.
// Electrical constants of another motor of the size: a third; its resistance with leads, brushes and heat: a
// factor of two; friction and power: a factor of three, the spread between floors of the Husky recordings.
// Skid-steered robots turn a third as much as their wheel speeds imply (Mandow and others 2007: effective
// tracks are 1.5 to 3 times as wide as actual ones). Limits need not be reached.
constexpr double skid = 0.7, track = 0.2;
constexpr Off constant_off{0.35, 0.35}, resistance_off{0.7, 0.7}, load_off{1.1, 1.1}, inertia_off{0.7, 0.7},
    turn_off{skid, track}, travel_off{0.2, 0.2}, heading_off{0.1, 0.1}, command_off{0.3, 0.3},
    driver_off{0.3, 0.5}, voltage_off{0.25, 0.25}, limit_off{1.5, 0.3}, anything{1e3, 1e3};
// Trust in evidence against a sign where the magnitudes of both sides agree with the file: no sound robot
// produces it.
constexpr double surely_trust = 12, alike_sides = 0.1;
constexpr double steepest_rad = 0.35;

// A value of one channel, without noise.
Estimate exactly(double value) {
  return {value, 1e-6, 1e6};
}

double usual_size(const ValueTally& t) {
  return std::hypot(t.mean(), t.deviation());
}

// Trust in a number that is estimated from the right and from the left wheel.
double trust_of_sides(const std::array<Estimate, 2>& ratio, double else_trust) {
  const bool alike = ratio[0].sure() && ratio[1].sure() &&
                     std::fabs(std::log(std::fabs(ratio[0].value / ratio[1].value))) < alike_sides &&
                     std::fabs(std::log(std::fabs(ratio[0].value))) < skid;
  return alike ? surely_trust : else_trust;
}

class Gatherer {
 public:
  explicit Gatherer(const CheckContext& c) : c_(c), robot_(c.robot), p_(c.model.parameters()) {}

  std::vector<ChannelEvidence> gather() {
    armatures();
    torques();
    turning();
    moving();
    batteries();
    loads();
    limits();
    return std::move(found_);
  }

 private:
  using Powers = std::vector<std::pair<S, int>>;
  // Adds evidence if its ratio is significantly different from 0.
  void add(std::string says, std::string against, const Estimate& ratio, Off off, double trust, Powers powers,
           EvidenceTraits traits = {}) {
    if (ratio.sure())
      found_.push_back(
          {std::move(traits), std::move(says), std::move(against), ratio, std::move(powers), off, trust});
  }
  bool heard(std::initializer_list<std::size_t> readings) const { return c_.heard(readings); }
  Estimate slope(Relation r, const std::vector<Eigen::Index>& terms) const {
    return estimate(fit_blocks(c_.blocks(r), 0, terms), 0);
  }
  Estimate sums(Relation r, Eigen::Index y, Eigen::Index x, Eigen::Index last) const {
    return ratio_of_sums(c_.blocks(r), y, x, last);
  }

  void armatures() {
    for (std::size_t k : {0u, 1u}) {
      if (!heard({reading::wheel_velocity + k, reading::motor_voltage + k, reading::motor_current + k}))
        continue;
      const std::string motor = std::string("the ") + side_name[k] + " motor's ";
      const S volts = side_of(S::voltage_right, k);
      add(motor + "voltage constant, from its voltage, current and speed, is", "the file's",
          c_.motors[k].constant_v_s_rad * (1 / p_.voltage_constant_v_s_rad), constant_off, 12,
          {{volts, 1}, {side_of(S::wheel_right, k), -1}}, {.by_gear = true});
      add(motor + "resistance, from its voltage, current and speed, is", "the file's",
          c_.motors[k].resistance_ohm * (1 / p_.resistance_ohm[k]), resistance_off, 8,
          {{volts, 1}, {side_of(S::current_right, k), -1}});
    }
    if (!heard({0, 1, 2, 3, 4, 5})) return;
    const BlockFit fit = fit_armature(c_.seen, Relation::armature_difference, c_.motor_delay_s);
    add("the voltage constant, from the differences of the sides, is", "the file's",
        estimate(fit, 1) * (1 / p_.voltage_constant_v_s_rad), constant_off, 12,
        {{S::voltage_right, 1}, {S::wheel_right, -1}},
        {.turned_by = 1 | 2, .by_gear = true, .both_sides = true});
    add("the resistance, from the differences of the sides, is", "the file's",
        estimate(fit, 0) * (2 / (p_.resistance_ohm[0] + p_.resistance_ohm[1])), resistance_off, 10,
        {{S::voltage_right, 1}, {S::current_right, -1}}, {.turned_by = 2 | 4, .both_sides = true});
  }

  void torques() {
    const double radius = 0.5 * (p_.wheel_radius_m[0] + p_.wheel_radius_m[1]);
    const ValueTally& payload = c_.tally(reading::payload);
    const double load = payload.known() > 1 ? payload.mean() : 0;
    const double inertia = 0.5 * robot_.total_mass_kg(load) * radius * radius + p_.wheel_inertia_kg_m2;
    for (std::size_t k : {0u, 1u}) {
      if (!heard({reading::wheel_velocity + k, reading::motor_current + k})) continue;
      const std::string motor = std::string("the ") + side_name[k] + " motor's ";
      const S wheel = side_of(S::wheel_right, k), current = side_of(S::current_right, k);
      add(motor + "current for acceleration is", "what the file's inertia gives",
          c_.motors[k].current_per_rad_s2_a * (p_.torque_constant_nm_a / inertia), inertia_off, 6,
          {{current, 1}, {wheel, -1}});
      add(motor + "current at steady speed is", "what the file's friction gives", c_.friction_ratio(k),
          load_off, 4, {{current, 1}, {wheel, -1}}, {.lost_by = {wheel}});
    }
    if (!heard({0, 1, 4, 5})) return;
    // Straight on, both motors of a pair draw similar currents, independent of the file's parameters.
    add("straight on, the right motor's current is", "the left one's", sums(Relation::siblings, 0, 1, 2),
        load_off, 8,
        {{S::current_right, 1}, {S::current_left, -1}, {S::wheel_right, -1}, {S::wheel_left, 1}});
  }

  // Compares the turning of the robot, from the gyro or the map, with the turning of each wheel.
  void turning_by_wheels(const BlockFit& fit, const std::string& turner, S source) {
    const double share = 0.5 / p_.half_track_m;
    const std::array ratio{estimate(fit, 0) * (1 / (share * p_.wheel_radius_m[0])),
                           estimate(fit, 1) * (-1 / (share * p_.wheel_radius_m[1]))};
    for (std::size_t k : {0u, 1u}) {
      add(std::string("over the turning of the ") + side_name[k] + " wheel " + turner,
          "what the file's track gives", ratio[k], turn_off, trust_of_sides(ratio, 8),
          {{source, 1}, {side_of(S::wheel_right, k), -1}}, {.turned_by = 1});
    }
  }

  // Headings jump by a full turn, in radians or degrees. The unit with the better fit is the heading's.
  BlockFit heading_fit(Relation relation) const {
    BlockFit radians = fit_blocks(c_.blocks(relation), 0, {2, 3});
    BlockFit degrees = fit_blocks(c_.blocks(relation), 1, {2, 3});
    const auto unsure = [](const BlockFit& fit) {
      return fit.known() ? std::fabs(fit.sd(0) / fit.coefficient[0]) : 1e9;
    };
    return unsure(degrees) < 0.5 * unsure(radians) ? degrees : radians;
  }

  void turning() {
    const bool wheels = heard({0, 1}), gyro = heard({reading::yaw_rate});
    if (wheels && gyro)
      turning_by_wheels(fit_blocks(c_.blocks(Relation::gyro), 0, {1, 2, 3}), "the gyro reads", S::yaw_rate);
    if (!heard({reading::heading})) return;
    if (wheels)
      turning_by_wheels(heading_fit(Relation::heading_wheels), "the map's heading turns", S::heading);
    if (!gyro) return;
    add("the map's heading turns", "what the gyro reads", estimate(heading_fit(Relation::heading_gyro), 0),
        heading_off, 12, {{S::heading, 1}, {S::yaw_rate, -1}});
  }

  void moving() {
    if (!heard({0, 1})) return;
    const bool map = heard({reading::x, reading::y});
    if (map && heard({reading::heading})) {
      const BlockFit fit = fit_blocks(c_.blocks(Relation::travel), 0, {2, 3});
      for (std::size_t k : {0u, 1u}) {
        add(std::string("the map moves forward over the turning of the ") + side_name[k] + " wheel",
            "what the file's wheel radius gives",
            estimate(fit, static_cast<Eigen::Index>(k)) * (2 / p_.wheel_radius_m[k]), travel_off, 8,
            {{S::position, 1}, {side_of(S::wheel_right, k), -1}}, {.lost_by = {S::heading}});
      }
    }
    if (map) {
      add("the map moves", "the way of the wheels by the file's radius", slope(Relation::distance, {1}),
          travel_off, 12, {{S::position, 1}, {S::wheel_right, -1}}, {.magnitude = true, .both_sides = true});
    }
    // The predominant direction of travel is weak evidence for the forward direction.
    add("the way forward, less that backward, is", "all the way that the wheels make",
        sums(Relation::way, 0, 1, 2), anything, 1, {{S::wheel_right, 1}}, {.both_sides = true});
    if (heard({reading::command_speed})) {
      const auto by_command = c_.blocks(Relation::command);
      const std::array ratio{estimate(fit_blocks(by_command, 0, {2, 3}), 0),
                             estimate(fit_blocks(by_command, 1, {2, 3}), 0)};
      for (std::size_t k : {0u, 1u}) {
        add(std::string("the ") + side_name[k] + " wheel drives at", "the commanded speed", ratio[k],
            command_off, trust_of_sides(ratio, 5), {{side_of(S::wheel_right, k), 1}, {S::command_speed, -1}});
      }
    }
    if (!heard({reading::command_turn})) return;
    const Estimate ratio = slope(Relation::command_turn, {1});
    const bool surely = std::fabs(std::log(std::fabs(ratio.value))) < track &&
                        ratio.sd < alike_sides * std::fabs(ratio.value);
    add("the wheels turn the robot at", "the commanded yaw rate", ratio, {track, skid},
        surely ? surely_trust : 6, {{S::wheel_right, 1}, {S::command_turn, -1}},
        {.turned_by = 1, .both_sides = true});
  }

  void batteries() {
    if (!heard({reading::battery_voltage})) return;
    if (const ValueTally& volts = c_.tally(reading::battery_voltage); volts.known() > 1) {
      add("the battery's voltage is", "the file's nominal one",
          exactly(volts.mean() / robot_.battery.nominal_voltage_v), voltage_off, 15,
          {{S::battery_voltage, 1}});
    }
    if (!heard({reading::battery_current})) return;
    if (heard({2, 3, 4, 5})) {
      add("the battery's power follows that of the motors", "what it should", slope(Relation::motors, {1, 2}),
          driver_off, 12,
          {{S::battery_voltage, 1}, {S::battery_current, 1}, {S::voltage_right, -1}, {S::current_right, -1}},
          {.both_sides = true});
    }
    if (!heard({0, 1})) return;
    const Powers power{{S::battery_voltage, 1}, {S::battery_current, 1}};
    const auto by_model = [&](const char* says, const Estimate& ratio, double trust) {
      add(says, "what the model gives", ratio, load_off, trust, power,
          {.by_power = true, .both_sides = true, .lost_by = {S::wheel_right, S::wheel_left, S::payload}});
    };
    by_model("while the robot drives, the battery's power is", sums(Relation::driving, 0, 1, 2), 8);
    by_model(power_by_motion, slope(Relation::motion, {1, 2}), 6);
    // Signs that need no model: a robot that drives without braking consumes power, except downhill; a
    // standing robot consumes power unless it is charged. With long descents and no pitch readings,
    // consumption at standstill is the evidence.
    const auto spends = [&](const char* says, const Estimate& watts, double trust) {
      add(says, "what the file's idle power is", watts * (1 / std::max(p_.idle_power_w, 1.0)), anything,
          trust, power);
    };
    spends("driving and not braking, descents left out, the battery gives", sums(Relation::driving, 3, 2, 2),
           8);
    const Estimate idle = sums(Relation::idle, 0, 1, 1);
    spends("standing, the battery gives", idle, idle.value > 0 ? 8 : 1.5);
  }

  void loads() {
    if (!heard({reading::pitch})) return;
    if (heard({0, 1, reading::battery_voltage, reading::battery_current})) {
      add("uphill and downhill, the battery's power changes by", "what the pitch gives",
          slope(Relation::climb, {1, 2}), load_off, 8,
          {{S::pitch, -1}, {S::wheel_right, 1}, {S::battery_voltage, 1}, {S::battery_current, 1}},
          {.lost_by = {S::pitch, S::wheel_right, S::wheel_left, S::battery_current, S::battery_voltage}});
    }
    if (const ValueTally& pitch = c_.tally(reading::pitch); pitch.known() > 1) {
      add("the pitch usually is", "the steepest that robots climb, 20 degrees",
          exactly(usual_size(pitch) / steepest_rad), {0, limit_off[1]}, 10, {{S::pitch, 1}},
          {.magnitude = true});
    }
  }

  // `of`: the readings that determine the value.
  void most(std::initializer_list<std::size_t> of, const std::string& says, const char* limit, double value,
            double bound, double trust, S source) {
    if (!heard(of) || !(bound > 0 && value > 0)) return;
    add(says, limit, exactly(value / bound), limit_off, trust, {{source, 1}},
        {.magnitude = true, .both_sides = source == S::wheel_right});
  }

  void limits() {
    const robot::Limits& limits = robot_.limits;
    most({0, 1}, "the fastest half second of a mission is usually", "the file's speed limit",
         c_.usual(&Observation::fastest_m_s), limits.speed_m_s, 6, S::wheel_right);
    most({reading::yaw_rate}, "the fastest turn of a mission is usually", "the file's yaw rate limit",
         c_.usual(&Observation::fastest_turn_rad_s), limits.yaw_rate_rad_s, 6, S::yaw_rate);
    if (const ValueTally& load = c_.tally(reading::payload); load.known() > 0)
      most({reading::payload}, "the heaviest payload declared is", "the file's payload limit", load.high(),
           std::max(limits.payload_kg, 1.0), 10, S::payload);
    for (std::size_t k : {0u, 1u}) {
      const std::size_t v = reading::motor_voltage + k, i = reading::motor_current + k;
      const std::string motor = std::string("the ") + side_name[k] + " motor's ";
      if (c_.tally(v).known() > 1)
        most({v}, motor + "voltage usually is", "the battery's nominal voltage", usual_size(c_.tally(v)),
             robot_.battery.nominal_voltage_v, 8, side_of(S::voltage_right, k));
      if (c_.tally(i).known() > 1)
        most({i}, motor + "current usually is", "the file's current limit", usual_size(c_.tally(i)),
             limits.current_a, 6, side_of(S::current_right, k));
    }
  }

  const CheckContext& c_;
  const robot::RobotModel& robot_;
  const dynamics::Parameters<double>& p_;
  std::vector<ChannelEvidence> found_;
};

}  // namespace

int ChannelEvidence::power_of(Source source) const {
  const auto at = std::ranges::find(powers, source, &std::pair<Source, int>::first);
  return at == powers.end() ? 0 : at->second;
}

std::vector<ChannelEvidence> gather_evidence(const CheckContext& context) {
  return Gatherer(context).gather();
}

}  // namespace joulecast::plausibility

#include "plausibility/evidence.h"

#include <algorithm>
#include <cmath>

namespace joulecast::plausibility {
namespace {

using namespace reading;
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
// Scales of a robot's friction and mass about its file's, with heavy tails: the power for acceleration of
// three cars is 1.2 times that of their published mass. The correlation of a part of the power with what its
// fit leaves unexplained; hills and delays take up to half of the part.
constexpr double friction_scale = 0.5, mass_scale = 0.2, correlated = 0.5;

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

constexpr double longest_delay_s = 0.1;  // cells are 0.4 s; their mean acceleration is too coarse beyond

// Regresses V on i, w and sign of one motor, or on i and w of the differences of the sides: R, K and c. The
// speed is taken at the instant of the electrical readings, w - delay a, of which the delay is estimated with
// them: acceleration resembles the current, so that a wrong delay changes R by its ratio to the drive's
// mechanical time constant. Only a long delay is that of the currents' shape.
BlockFit fit_armature(const CheckContext& c, Relation relation) {
  const bool difference = relation == Relation::armature_difference;
  const Eigen::Index acceleration = difference ? 3 : 4;
  std::vector<Eigen::Index> terms{1, 2};
  if (!difference) terms.push_back(3);
  std::vector<Products::Block> blocks = c.blocks(relation);
  if (c.motor_delay_s > longest_delay_s)
    return fit_blocks(with_part_of(std::move(blocks), 2, acceleration, -c.motor_delay_s), 0, terms);
  terms.push_back(acceleration);
  const BlockFit fit = fit_blocks(blocks, 0, terms);
  // For one motor the motion determines the current. For the differences it barely does, and with a long
  // delay R is unidentifiable.
  const bool late = difference && fit.known() && -fit.coefficient[2] / fit.coefficient[1] > longest_delay_s;
  return late ? BlockFit{} : fit;
}

class Gatherer {
 public:
  explicit Gatherer(const CheckContext& c)
      : c_(c), robot_(c.robot), p_(c.model.parameters()), motors_(motor_constants(c)) {}

  std::vector<ChannelEvidence> gather() {
    armatures();
    torques();
    turning();
    moving();
    batteries();
    loads();
    limits();
    for (ChannelEvidence& e : found_)
      e.alike = static_cast<double>(std::ranges::count_if(
          found_, [&](const ChannelEvidence& o) { return o.property == e.property && o.trust > 0; }));
    return std::move(found_);
  }

 private:
  static constexpr std::size_t wheel = wheel_velocity;
  using Powers = std::vector<std::pair<std::size_t, double>>;
  using P = Property;

  // Adds evidence; where its ratio may be 0, nothing follows from it for signs and units.
  void add(std::string says, std::string against, const Estimate& ratio, Off off, double trust, Powers powers,
           EvidenceTraits traits = {}) {
    if (ratio.known())
      found_.push_back({std::move(traits), std::move(says), std::move(against), ratio, std::move(powers), off,
                        ratio.sure() ? trust : 0});
  }

  void armatures() {
    for (std::size_t k : {0u, 1u}) {
      const std::string motor = std::string("the ") + side_name[k] + " motor's ";
      add(motor + "voltage constant, from its voltage, current and speed, is", "the file's",
          motors_[k].constant_v_s_rad * (1 / p_.voltage_constant_v_s_rad), constant_off, 12,
          {{motor_voltage + k, 1}, {wheel + k, -1}}, {.property = P::voltage_constant, .by_gear = true});
      add(motor + "resistance, from its voltage, current and speed, is", "the file's",
          motors_[k].resistance_ohm * (1 / p_.resistance_ohm[k]), resistance_off, 8,
          {{motor_voltage + k, 1}, {motor_current + k, -1}}, {.property = P::resistance});
    }
    const BlockFit fit = fit_armature(c_, Relation::armature_difference);
    add("the voltage constant, from the differences of the sides, is", "the file's",
        estimate(fit, 1) * (1 / p_.voltage_constant_v_s_rad), constant_off, 12,
        {{motor_voltage, 1}, {wheel, -1}},
        {.property = P::voltage_constant, .turned_by = 1 | 2, .by_gear = true, .both_sides = true});
    add("the resistance, from the differences of the sides, is", "the file's",
        estimate(fit, 0) * (2 / (p_.resistance_ohm[0] + p_.resistance_ohm[1])), resistance_off, 10,
        {{motor_voltage, 1}, {motor_current, -1}},
        {.property = P::resistance, .turned_by = 2 | 4, .both_sides = true});
  }

  void torques() {
    const double radius = 0.5 * (p_.wheel_radius_m[0] + p_.wheel_radius_m[1]);
    const ValueTally& loads = c_.tally(payload);
    const double load = loads.known() > 1 ? loads.mean() : 0;
    const double inertia = 0.5 * robot_.total_mass_kg(load) * radius * radius + p_.wheel_inertia_kg_m2;
    for (std::size_t k : {0u, 1u}) {
      const std::string motor = std::string("the ") + side_name[k] + " motor's ";
      const Powers powers{{motor_current + k, 1}, {wheel + k, -1}};
      add(motor + "current for acceleration is", "that of the file's inertia",
          motors_[k].current_per_rad_s2_a * (p_.torque_constant_nm_a / inertia), inertia_off, 6,
          {{motor_current + k, 1}, {wheel + k, -1}, {time_scale, 1}, {half_radius, -2}, {double_radius, -2}},
          {.property = P::inertia});
      const double friction_nm =
          p_.friction_torque_nm[k] + p_.viscous_friction_nm_s_rad * motors_[k].mean_speed_rad_s;
      if (friction_nm > 0)
        add(motor + "current at steady speed is", "that of the file's friction",
            motors_[k].steady_current_a * (p_.torque_constant_nm_a / friction_nm), load_off, 4, powers,
            {.property = P::steady_current, .lost_by = {wheel + k}});
    }
    // Straight on, both motors of a pair draw similar currents, independent of the file's parameters.
    add("straight on, the right motor's current is", "the left one's", c_.ratio(Relation::siblings, 0, 1, 2),
        load_off, 8, {{motor_current, 1}, {motor_current + 1, -1}, {wheel, -1}, {wheel + 1, 1}});
  }

  // Compares the turning of the robot, from the gyro or the map, with the turning of each wheel.
  void turning_by_wheels(const BlockFit& fit, const std::string& turner, std::size_t by, Property track_by) {
    const double share = 0.5 / p_.half_track_m;
    const std::array ratio{estimate(fit, 0) * (1 / (share * p_.wheel_radius_m[0])),
                           estimate(fit, 1) * (-1 / (share * p_.wheel_radius_m[1]))};
    for (std::size_t k : {0u, 1u}) {
      add(std::string("over the turning of the ") + side_name[k] + " wheel " + turner,
          "the turning by the file's track", ratio[k], turn_off, trust_of_sides(ratio, 8),
          {{by, 1},
           {wheel + k, -1},
           {half_radius, -1},
           {double_radius, -1},
           {time_scale, by == heading ? -1.0 : 0.0}},
          {.property = track_by, .turned_by = 1});
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
    turning_by_wheels(fit_blocks(c_.blocks(Relation::gyro), 0, {1, 2, 3}), "the gyro reads", yaw_rate,
                      P::gyro_track);
    turning_by_wheels(heading_fit(Relation::heading_wheels), "the map's heading turns", heading,
                      P::map_track);
    add("the map's heading turns", "the gyro's reading", estimate(heading_fit(Relation::heading_gyro), 0),
        heading_off, 12, {{heading, 1}, {yaw_rate, -1}, {time_scale, -1}});
  }

  void moving() {
    const Powers way{{x, 1}, {wheel, -1}, {half_radius, -1}, {double_radius, -1}, {time_scale, -1}};
    add("the map moves forward", "the way of the wheels by the file's radius",
        c_.coefficient(Relation::slip, 0, {1, 2, 3, 4}), travel_off, 12, way,
        {.property = P::radius, .both_sides = true, .lost_by = {heading}});
    add("the map moves", "the way of the wheels by the file's radius",
        c_.coefficient(Relation::distance, 0, {1}), travel_off, 12, way,
        {.property = P::radius, .magnitude = true, .both_sides = true});
    // The predominant direction of travel is weak evidence for the forward direction.
    add("the way forward, less that backward, is", "all the way that the wheels make",
        c_.ratio(Relation::way, 0, 1, 2), anything, 1, {{wheel, 1}}, {.both_sides = true});
    const std::array driven{c_.coefficient(Relation::command, 0, {2, 3}),
                            c_.coefficient(Relation::command, 1, {2, 3})};
    for (std::size_t k : {0u, 1u})
      add(std::string("the ") + side_name[k] + " wheel drives at", "the commanded speed", driven[k],
          command_off, trust_of_sides(driven, 5),
          {{wheel + k, 1}, {half_radius, 1}, {double_radius, 1}, {command_speed, -1}},
          {.property = P::following});
    const Estimate turned = c_.coefficient(Relation::command_turn, 0, {1});
    const bool surely = std::fabs(std::log(std::fabs(turned.value))) < track &&
                        turned.sd < alike_sides * std::fabs(turned.value);
    add("the wheels turn the robot at", "the commanded yaw rate", turned, {track, skid},
        surely ? surely_trust : 6, {{wheel, 1}, {half_radius, 1}, {double_radius, 1}, {command_turn, -1}},
        {.turned_by = 1, .both_sides = true});
  }

  void batteries() {
    if (const ValueTally& volts = c_.tally(battery_voltage); volts.known() > 1 && c_.heard({battery_voltage}))
      add("the battery's voltage is", "the file's nominal one",
          exactly(volts.mean() / robot_.battery.nominal_voltage_v), voltage_off, 15, {{battery_voltage, 1}});
    add("the battery's power follows that of the motors", "the expected power",
        c_.coefficient(Relation::motors, 0, {1, 2}), driver_off, 12,
        {{battery_voltage, 1}, {battery_current, 1}, {motor_voltage, -1}, {motor_current, -1}},
        {.both_sides = true});
    add("with its current, the battery's voltage falls by", "what the file's internal resistance gives",
        c_.coefficient(Relation::sag, 0, {1}) * (-1 / robot_.battery.internal_resistance_ohm), resistance_off,
        8, {{battery_voltage, 1}, {battery_current, -1}}, {.heavy_tails = true});
    const Powers power{{battery_voltage, 1}, {battery_current, 1}};
    add("with the motion, the battery's power changes by", "what the model gives",
        c_.coefficient(Relation::motion, 0, {1, 2}), anything, 6, power);
    moved_power(power);
    // Signs that need no model: a robot that drives without braking consumes power, except downhill; a
    // standing robot consumes power unless it is charged. With long descents and no pitch readings,
    // consumption at standstill is the evidence.
    const double idle_w = std::max(p_.idle_power_w + p_.accessory_power_w, 1.0);
    add("driving and not braking, descents left out, the battery gives", "the file's idle power",
        c_.ratio(Relation::driving, 3, 2, 2) * (1 / idle_w), anything, 8, power);
    const Estimate idle = c_.ratio(Relation::idle, 0, 1, 1) * (1 / idle_w);
    add("standing, the battery gives", "the file's idle power", idle, anything, idle.value > 0 ? 8 : 1.5,
        power, {.property = P::idle_power});
  }

  // The battery's power while the robot drives, and its parts for speed and acceleration. A wrong scale of
  // the wheels' speeds acts on each by another exponent than one of the power.
  void moved_power(const Powers& power) {
    constexpr Eigen::Index modelled = 1, one = 2, steady = 4, accelerating = 5, climbing = 6, turning = 7,
                           slower = 8, larger = 9, smaller = 11;
    const std::vector<Products::Block> blocks = c_.blocks(Relation::driving);
    if (blocks.empty()) return;
    Products::Block all = blocks.front();
    for (const Products::Block& block : std::span(blocks).subspan(1)) all.join(block);
    // `other`: on wheels of half the speed, and where the file's radius is half or double the robot's.
    using Other = std::array<double, 3>;
    const auto by_model = [&](const char* says, const Estimate& ratio, const Off& off, Eigen::Index whole,
                              const Other& other, EvidenceTraits traits) {
      Powers powers = power;
      const double sum = all.sums(one, whole);
      powers.insert(powers.end(), {{wheel, std::log2(other[0] / sum)},
                                   {half_radius, -std::log2(other[1] / sum)},
                                   {double_radius, std::log2(other[2] / sum)}});
      traits.by_power = traits.both_sides = true;
      traits.lost_by = {payload, time_scale};
      if (std::ranges::all_of(powers, [](const auto& p) { return std::isfinite(p.second); }))
        add(says, "what the model gives", ratio, off, 8, powers, std::move(traits));
    };
    const auto sum = [&](Eigen::Index k) { return all.sums(one, k); };
    const double idle = sum(modelled) - sum(steady) - sum(accelerating);
    const Other steady_of_other{sum(slower), sum(larger), sum(smaller)},
        accelerating_of_other{0.25 * sum(accelerating), sum(larger + 1), sum(smaller + 1)};
    Other modelled_of_other;
    for (const std::size_t k : {0u, 1u, 2u})
      modelled_of_other[k] = idle + steady_of_other[k] + accelerating_of_other[k];
    by_model("while the robot drives, the battery's power is", c_.ratio(Relation::driving, 0, modelled, one),
             load_off, modelled, modelled_of_other, {.property = P::driving_power});
    const BlockFit fit = fit_blocks(blocks, 0, {one, steady, accelerating, climbing, turning});
    if (!fit.known()) return;
    Eigen::VectorXd rest = Eigen::VectorXd::Unit(all.sums.rows(), 0);
    rest({one, steady, accelerating, climbing, turning}) = -fit.coefficient;
    const double left = std::sqrt(std::max(rest.dot(all.sums * rest), 0.0));
    const auto part = [&](const char* says, Eigen::Index k, double scale, const Other& other,
                          Property property) {
      const Estimate ratio = estimate(fit, k == steady ? 1 : 2);
      if (ratio.value > 0)
        by_model(says, ratio, {scale, scale}, k, other,
                 {.property = property,
                  .magnitude = true,
                  .heavy_tails = true,
                  .unexplained = correlated * left / (ratio.value * std::sqrt(all.sums(k, k)))});
    };
    part("at steady speed, the battery's power is", steady, friction_scale, steady_of_other, P::steady_power);
    part("for acceleration, the battery's power is", accelerating, mass_scale, accelerating_of_other,
         P::accelerating_power);
  }

  void loads() {
    add("uphill and downhill, the battery's power changes by", "the power of the pitch",
        c_.coefficient(Relation::climb, 0, {1, 2}), load_off, 8,
        {{pitch, -1}, {wheel, 1}, {battery_voltage, 1}, {battery_current, 1}},
        {.lost_by = {pitch, wheel, wheel + 1, half_radius, double_radius, battery_current, battery_voltage}});
    if (const ValueTally& pitches = c_.tally(pitch); pitches.known() > 1)
      most({pitch}, "the pitch usually is", "the steepest that robots climb, 20 degrees", usual_size(pitches),
           steepest_rad, 10, {0, limit_off[1]});
  }

  // `of`: the readings that determine the value.
  void most(std::initializer_list<std::size_t> of, const std::string& says, const char* limit, double value,
            double bound, double trust, Off off = limit_off, Property property = P::none) {
    if (!c_.heard(of) || !(bound > 0) || !(value > 0)) return;
    const bool by_wheels = *of.begin() == wheel;
    Powers powers{{*of.begin(), 1}};
    if (by_wheels) powers.insert(powers.end(), {{half_radius, 1}, {double_radius, 1}});
    add(says, limit, exactly(value / bound), off, trust, std::move(powers),
        {.property = property, .magnitude = true, .both_sides = by_wheels});
  }

  void limits() {
    const robot::Limits& limits = robot_.limits;
    most({wheel, wheel + 1}, "the fastest half second of a mission is usually", "limits.speed_m_s",
         c_.usual(&Observation::fastest_m_s), limits.speed_m_s, 6, limit_off, P::top_speed);
    most({yaw_rate}, "the fastest turn of a mission is usually", "limits.yaw_rate_rad_s",
         c_.usual(&Observation::fastest_turn_rad_s), limits.yaw_rate_rad_s, 6, limit_off, P::top_turn);
    if (const ValueTally& load = c_.tally(payload); load.known() > 0)
      most({payload}, "the heaviest payload declared is", "the file's payload limit", load.high(),
           std::max(limits.payload_kg, 1.0), 10);
    for (std::size_t k : {0u, 1u}) {
      const std::string motor = std::string("the ") + side_name[k] + " motor's ";
      const ValueTally &volts = c_.tally(motor_voltage + k), &amps = c_.tally(motor_current + k);
      if (volts.known() > 1)
        most({motor_voltage + k}, motor + "voltage usually is", "the battery's nominal voltage",
             usual_size(volts), robot_.battery.nominal_voltage_v, 8);
      if (amps.known() > 1)
        most({motor_current + k}, motor + "current usually is", "the file's current limit", usual_size(amps),
             limits.current_a, 6);
    }
  }

  const CheckContext& c_;
  const robot::RobotModel& robot_;
  const dynamics::Parameters<double>& p_;
  const std::array<MotorConstants, 2> motors_;
  std::vector<ChannelEvidence> found_;
};

}  // namespace

double ChannelEvidence::power_of(std::size_t reading) const {
  const auto at = std::ranges::find(powers, reading, &std::pair<std::size_t, double>::first);
  return at == powers.end() ? 0 : at->second;
}

std::array<MotorConstants, 2> motor_constants(const CheckContext& c) {
  std::array<MotorConstants, 2> constants;
  for (const std::size_t side : {0u, 1u}) {
    MotorConstants& m = constants[side];
    const BlockFit electric = fit_armature(c, of_side(Relation::armature_right, side));
    m.resistance_ohm = estimate(electric, 0);
    m.constant_v_s_rad = estimate(electric, 1);
    const auto blocks = c.blocks(of_side(Relation::torque_right, side));
    double rows = 0, speed = 0;
    for (const auto& block : blocks) rows += block.rows, speed += block.sums(1, 2);
    if (rows == 0) continue;
    m.mean_speed_rad_s = speed / rows;
    const BlockFit load = fit_blocks(blocks, 0, {1, 2, 3, 4, 5});
    m.steady_current_a = estimate(load, Eigen::VectorXd{{1, m.mean_speed_rad_s, 0, 0, 0}});
    m.current_per_rad_s2_a = estimate(load, 2);
  }
  return constants;
}

const std::vector<ChannelEvidence>& evidence_of(const CheckContext& context) {
  if (!context.evidence)
    context.evidence = std::make_shared<const std::vector<ChannelEvidence>>(Gatherer(context).gather());
  return *context.evidence;
}

}  // namespace joulecast::plausibility

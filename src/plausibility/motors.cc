#include "plausibility/motors.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "plausibility/evaluation.h"
#include "plausibility/readings.h"

namespace joulecast::plausibility {
namespace {

constexpr double sibling_sd = 6;  // standard deviations between siblings
// Differences within a pair of motors that are not reported: magnets and windings; grease and load.
constexpr double winding_off = 0.10, motor_load_off = 0.5;
constexpr double agree = 0.35;           // of logarithms of one sensor's factor from different constants
constexpr double longest_delay_s = 0.1;  // cells are 0.4 s; their mean acceleration is too coarse beyond
constexpr double useless = 0.5;  // logarithm of a sensor's factor, beyond which the sensor is unusable

MotorConstants constants_of(std::span<const Observation> seen, std::size_t side, double delay_s) {
  MotorConstants m;
  const auto relation = side == 0 ? Relation::armature_right : Relation::armature_left;
  const BlockFit electric = fit_armature(seen, relation, delay_s);
  m.resistance_ohm = estimate(electric, 0);
  m.constant_v_s_rad = estimate(electric, 1);
  m.drop_v = estimate(electric, 2);
  const auto blocks = blocks_of(seen, side == 0 ? Relation::torque_right : Relation::torque_left);
  double rows = 0, speed = 0;
  for (const auto& block : blocks) rows += block.rows, speed += block.sums(1, 2);
  if (rows == 0) return m;
  m.mean_speed_rad_s = speed / rows;
  const BlockFit load = fit_blocks(blocks, 0, {1, 2, 3, 4, 5});
  Eigen::VectorXd steady = Eigen::VectorXd::Zero(5);
  steady[0] = 1;
  steady[1] = m.mean_speed_rad_s;
  m.steady_current_a = estimate(load, steady);
  m.current_per_rad_s2_a = estimate(load, 2);
  return m;
}

// Logarithm of the right motor's constant over the left's, if both differ significantly from 0 and have
// one sign.
Estimate log_ratio(const Estimate& right, const Estimate& left) {
  if (!right.sure() || !left.sure() || right.value * left.value <= 0) return {};
  return {std::log(right.value / left.value), std::hypot(right.sd / right.value, left.sd / left.value),
          std::min(right.freedom, left.freedom)};
}

bool differs(const Estimate& log, double off) {
  return log.known() && std::fabs(log.value) > off && std::fabs(log.value) > sibling_sd * log.sd;
}

// Logarithm of the ratio of the currents straight on, where both motors run alike at the same time; else of
// the fitted currents.
Estimate steady_ratio(const CheckContext& c, const std::array<MotorConstants, 2>& m) {
  const Estimate both = ratio_of_sums(c.blocks(Relation::siblings), 0, 1, 2);
  if (both.sure() && both.value > 0) return {std::log(both.value), both.sd / both.value, both.freedom};
  return log_ratio(m[0].steady_current_a, m[1].steady_current_a);
}

struct Pair {
  Estimate resistance, constant, steady, inertia;  // logarithms, right over left
};

// A current sensor that reads g times the truth: R divided by g, every current times g, K unchanged.
bool current_sensor(const Pair& p) {
  if (!differs(p.resistance, winding_off) || differs(p.constant, winding_off)) return false;
  const Estimate& load = differs(p.inertia, winding_off) ? p.inertia : p.steady;
  return differs(load, winding_off) && std::fabs(load.value + p.resistance.value) < agree;
}

// A voltage sensor that reads g times the truth: R and K times g, currents unchanged.
bool voltage_sensor(const Pair& p) {
  return differs(p.constant, winding_off) && differs(p.resistance, winding_off) &&
         std::fabs(p.constant.value - p.resistance.value) < agree && !differs(p.steady, motor_load_off);
}

std::string part(const char* name, const Estimate& right, const Estimate& left, const char* unit) {
  return fmt::format("{} {:.3g} against {:.3g} {}", name, right.value, left.value, unit);
}

// The side with the resistance farther from the file's.
std::size_t worse_side(const std::array<MotorConstants, 2>& m, double file_ohm) {
  const auto off = [&](std::size_t k) {
    return std::fabs(std::log(std::fabs(m[k].resistance_ohm.value / file_ohm)));
  };
  return off(0) >= off(1) ? 0 : 1;
}

}  // namespace

std::optional<Delay> motor_delay(std::span<const Observation> observations) {
  for (const auto& channels : {std::vector{Late::current_right, Late::current_left},
                               std::vector{Late::current_right}, std::vector{Late::current_left}}) {
    if (const auto delay = delay_of(observations, channels)) {
      const double least = least_delay_s(observations, {4, 5});
      return delay->interval[0] > least ? delay : std::nullopt;
    }
  }
  return std::nullopt;
}

BlockFit fit_armature(std::span<const Observation> observations, Relation relation, double delay_s) {
  const bool difference = relation == Relation::armature_difference;
  const Eigen::Index acceleration = difference ? 3 : 4;
  std::vector<Eigen::Index> terms{1, 2};
  if (!difference) terms.push_back(3);
  std::vector<Products::Block> blocks = blocks_of(observations, relation);
  if (!std::isnan(delay_s))
    return fit_blocks(with_part_of(std::move(blocks), 2, acceleration, -delay_s), 0, terms);
  terms.push_back(acceleration);
  const BlockFit fit = fit_blocks(blocks, 0, terms);
  // For one motor the motion determines the current. For the differences it barely does, and with a long
  // delay R is unidentifiable.
  const bool late = difference && fit.known() && -fit.coefficient[2] / fit.coefficient[1] > longest_delay_s;
  return late ? BlockFit{} : fit;
}

std::array<MotorConstants, 2> motor_constants(std::span<const Observation> observations, double delay_s) {
  return {constants_of(observations, 0, delay_s), constants_of(observations, 1, delay_s)};
}

void check_motors(const CheckContext& c, Checks& checks) {
  if (!c.heard({0, 1, 2, 3, 4, 5})) return;
  const auto& m = c.motors;
  const Pair p{log_ratio(m[0].resistance_ohm, m[1].resistance_ohm),
               log_ratio(m[0].constant_v_s_rad, m[1].constant_v_s_rad), steady_ratio(c, m),
               log_ratio(m[0].current_per_rad_s2_a, m[1].current_per_rad_s2_a)};
  std::string parts;
  const auto add = [&](const std::string& text) { parts += (parts.empty() ? "" : ", ") + text; };
  if (differs(p.resistance, winding_off)) add(part("R", m[0].resistance_ohm, m[1].resistance_ohm, "ohm"));
  if (differs(p.constant, winding_off))
    add(part("K", m[0].constant_v_s_rad, m[1].constant_v_s_rad, "V s/rad"));
  if (differs(p.steady, motor_load_off) || (current_sensor(p) && p.steady.known())) {
    add(m[0].steady_current_a.known() && m[1].steady_current_a.known()
            ? part("steady current", m[0].steady_current_a, m[1].steady_current_a, "A")
            : fmt::format("current straight on {:.3g} times as much", std::exp(p.steady.value)));
  }
  if (parts.empty()) return;
  const std::size_t side = worse_side(m, c.robot.motor.resistance_ohm);
  const double sign = side == 0 ? 1 : -1;
  const std::string both = fmt::format("The right motor against the left: {}", parts);
  const auto sensor = [&](const char* field, const Estimate& log, double direction) {
    const Estimate gain{std::exp(direction * sign * log.value),
                        std::exp(direction * sign * log.value) * log.sd, log.freedom};
    checks.push_back(make_check(
        std::string(field) + "_against_sibling", fmt::format("{}.{}", field, side_name[side]), gain,
        fmt::format("{}; all would agree if {}.{} read {} times the truth.", both, field, side_name[side],
                    with_interval(gain.value, gain.interval()))));
    checks.back().contradicted = std::fabs(log.value) > useless;
  };
  if (current_sensor(p)) return sensor("motor_current", p.resistance, -1);
  if (voltage_sensor(p)) return sensor("motor_voltage", p.constant, 1);
  const Estimate most = differs(p.resistance, winding_off) ? p.resistance
                        : differs(p.constant, winding_off) ? p.constant
                                                           : p.steady;
  checks.push_back(make_check("motor_against_sibling", "",
                              {std::exp(most.value), std::exp(most.value) * most.sd, most.freedom},
                              both + ": two motors of one kind differ less."));
}

}  // namespace joulecast::plausibility

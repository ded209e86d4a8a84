#include "energy/refinement.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <limits>
#include <map>
#include <utility>
#include <vector>

#include "base/median.h"
#include "statistics/robust.h"

namespace joulecast::energy {
namespace {

constexpr auto n = static_cast<Eigen::Index>(unknown_count);
constexpr auto m = static_cast<Eigen::Index>(refined_count);
using ParameterRow = Eigen::Matrix<double, n, 1>;
using ParameterSquare = Eigen::Matrix<double, n, n>;
using Kept = Eigen::Matrix<double, m, 1>;
using KeptSquare = Eigen::Matrix<double, m, m>;

constexpr auto mass = static_cast<Eigen::Index>(Unknown::mass);

constexpr std::size_t fewest_equations = 60;
constexpr Eigen::Index block = 24;  // equations that err together: about 2.5 s
constexpr double huber = 2.5, no_bound = std::numeric_limits<double>::infinity();
constexpr int reweightings = 4;
constexpr double surprise_memory = 0.1;  // weight of the latest mission in the scatter's factor
constexpr double least_factor = 0.1, greatest_factor = 30;

// Solution of one mission's equations, beyond the model in force, under a Gaussian prior about it.
struct MissionSolution {
  ParameterRow value;
  ParameterSquare covariance;
  double torque_rms = std::numeric_limits<double>::quiet_NaN();
};

// Robust least squares with a noise level for each kind of equation, taken from the residuals, and covariance
// by blocks of neighbours, since their errors are correlated.
MissionSolution solve(std::span<const DriveEquation> equations, const ParameterSquare& prior_precision) {
  const auto count = static_cast<Eigen::Index>(equations.size());
  Eigen::Matrix<double, Eigen::Dynamic, n> x(count, n);
  Eigen::VectorXd y(count), weight(count);
  std::map<DriveEquation::Kind, std::vector<Eigen::Index>> of_kind;
  for (Eigen::Index k = 0; k < count; ++k) {
    const DriveEquation& e = equations[static_cast<std::size_t>(k)];
    x.row(k) = Eigen::Map<const Eigen::Matrix<double, 1, n>>(e.row.data());
    y[k] = e.value;
    of_kind[e.kind].push_back(k);
  }
  MissionSolution out{ParameterRow::Zero(), ParameterSquare::Zero()};
  Eigen::VectorXd left = y;
  ParameterSquare normal;
  for (int pass = 0; pass < reweightings; ++pass) {
    for (const auto& [kind, rows] : of_kind) {
      const Eigen::VectorXd own = left(rows), sizes = own.cwiseAbs();
      // The median of |x| is 0.6745 standard deviations of a normal variable.
      const double noise = pass == 0 ? std::sqrt(own.squaredNorm() / static_cast<double>(rows.size()))
                                     : upper_median(std::vector(sizes.begin(), sizes.end())) / 0.6745;
      const double sd = std::max(noise, 1e-9), bound = pass == 0 ? no_bound : huber;
      for (const Eigen::Index k : rows) weight[k] = statistics::huber_weight(left[k], sd, bound) / (sd * sd);
    }
    const Eigen::Matrix<double, n, Eigen::Dynamic> weighted = x.transpose() * weight.asDiagonal();
    normal = prior_precision + weighted * x;
    out.value = normal.ldlt().solve(weighted * y);
    left = y - x * out.value;
  }
  const ParameterSquare inverse = normal.ldlt().solve(ParameterSquare::Identity());
  ParameterSquare meat = prior_precision;
  for (Eigen::Index k = 0; k < count; k += block) {
    const Eigen::Index rows = std::min(block, count - k);
    const ParameterRow score =
        x.middleRows(k, rows).transpose() * weight.segment(k, rows).cwiseProduct(left.segment(k, rows));
    meat += score * score.transpose();
  }
  if (const Eigen::VectorXd torques = left(of_kind[DriveEquation::Kind::torque]); torques.size() > 0)
    out.torque_rms = std::sqrt(torques.squaredNorm() / static_cast<double>(torques.size()));
  // Few blocks underestimate it: at least the deviation by independent errors.
  const ParameterSquare sandwich = inverse * meat * inverse;
  out.covariance = 0.5 * (sandwich + inverse);
  out.covariance = (0.5 * (out.covariance + out.covariance.transpose())).eval();
  return out;
}

Kept parameters_of(const robot::RobotModel& robot) {
  return Eigen::Map<const Kept>(refined_values(robot).data());
}

double dry_nm(const robot::RobotModel& robot) {
  return 0.5 * (robot.motor.friction_torque_nm[0] + robot.motor.friction_torque_nm[1]);
}

// Viscous friction that is a tenth of the dry one at top speed.
double small_viscous(const robot::RobotModel& robot) {
  return 0.1 * dry_nm(robot) * robot.kinematics.wheel_radius_m / robot.limits.speed_m_s;
}

KeptSquare scatter_of(const robot::RobotModel& robot, const RefinementTrust& t) {
  KeptSquare s = KeptSquare::Zero();
  const double common = t.scatter_common * dry_nm(robot), side = t.scatter_side * dry_nm(robot);
  s.topLeftCorner<2, 2>().setConstant(common * common);
  s(0, 0) += side * side;
  s(1, 1) += side * side;
  s(2, 2) = std::pow(t.scatter_viscous * (robot.motor.viscous_friction_nm_s_rad + small_viscous(robot)), 2);
  s(3, 3) = std::pow(t.scatter_idle * robot.idle_power_w, 2);
  s(4, 4) = std::pow(t.scatter_mass * robot.total_mass_kg(0), 2);
  s(5, 5) = std::pow(t.scatter_battery * robot.battery.internal_resistance_ohm, 2);
  return s;
}

KeptSquare file_covariance(const robot::RobotModel& robot, const RefinementTrust& t) {
  Kept sd;
  sd << t.file_friction * robot.motor.friction_torque_nm[0],
      t.file_friction * robot.motor.friction_torque_nm[1],
      t.file_viscous * robot.motor.viscous_friction_nm_s_rad + small_viscous(robot),
      t.file_idle * robot.idle_power_w, t.file_mass * robot.total_mass_kg(0),
      t.file_battery * robot.battery.internal_resistance_ohm;
  return sd.cwiseAbs2().cwiseMax(1e-12).asDiagonal();
}

}  // namespace

std::array<double, refined_count> refined_values(const robot::RobotModel& robot) {
  return {robot.motor.friction_torque_nm[0],
          robot.motor.friction_torque_nm[1],
          robot.motor.viscous_friction_nm_s_rad,
          robot.idle_power_w,
          robot.total_mass_kg(0),
          robot.battery.internal_resistance_ohm};
}

Refinement::Refinement(const robot::RobotModel& robot, const RefinementTrust& trust)
    : robot_(robot), trust_(trust) {
  relearn();
}

void Refinement::rebase(const robot::RobotModel& robot) {
  robot_ = robot;
  relearn();
}

void Refinement::restart(std::int64_t since_utime_us, bool mass_changed) {
  std::erase_if(learned_, [&](const MissionParameters& m) { return m.utime_us < since_utime_us; });
  mass_changed_ = mass_changed;
  relearn();
}

void Refinement::relearn() {
  Eigen::Map<Kept>(mean_.data()) = parameters_of(robot_);
  KeptSquare prior = file_covariance(robot_, trust_);
  if (mass_changed_) prior(mass, mass) += std::pow(trust_.payload_wide * robot_.limits.payload_kg, 2);
  Eigen::Map<KeptSquare>(covariance_.data()) = prior;
  scatter_factor_ = 1;
  steps_ = 0;
  for (const MissionParameters& mission : learned_) step(mission, true);
}

MissionFinding Refinement::judge(std::span<const DriveEquation> equations, double declared_kg,
                                 std::int64_t utime_us, bool learn) {
  if (equations.size() < fewest_equations) {
    MissionFinding none;
    none.equations = equations.size();
    none.torque_rms_nm = std::numeric_limits<double>::quiet_NaN();
    return none;
  }
  ParameterSquare prior = ParameterSquare::Zero();
  const auto narrow = [&](Unknown unknown, double sd) {
    const auto k = static_cast<Eigen::Index>(unknown);
    prior(k, k) = 1 / (sd * sd);
  };
  narrow(Unknown::slope_cos, trust_.slope_rad);
  narrow(Unknown::slope_sin, trust_.slope_rad);
  narrow(Unknown::scrub, trust_.scrub);
  narrow(Unknown::yaw_inertia, trust_.yaw_inertia);
  narrow(Unknown::current_bias, trust_.current_bias * robot_.limits.current_a);
  narrow(Unknown::driver_loss, trust_.driver_loss);
  // Almost free.
  const Kept file = parameters_of(robot_), variance = file_covariance(robot_, trust_).diagonal();
  for (Eigen::Index k = 0; k < m; ++k) prior(k, k) = 1e-4 / variance[k];
  const MissionSolution alone = solve(equations, prior);
  MissionParameters mission{utime_us, declared_kg, {}, {}};
  Eigen::Map<Kept>(mission.value.data()) = file + alone.value.head<m>();
  Eigen::Map<KeptSquare>(mission.covariance.data()) = alone.covariance.topLeftCorner<m, m>();

  // Of a log that is replayed again.
  if (std::erase_if(learned_, [&](const auto& one) { return one.utime_us == utime_us; }) > 0) relearn();
  MissionFinding out = step(mission, learn);
  out.equations = equations.size();
  out.enough = true;
  out.torque_rms_nm = alone.torque_rms;
  for (Eigen::Index k = 0; k < m; ++k)
    out.parameters[static_cast<std::size_t>(k)] = {file[k] + alone.value[k],
                                                   std::sqrt(alone.covariance(k, k))};
  if (!learn) return out;
  learned_.push_back(mission);
  if (learned_.size() <= most_missions) return out;
  learned_.pop_front();
  relearn();
  return out;
}

// Compares a mission with the estimate, and with `learn` takes it in.
MissionFinding Refinement::step(const MissionParameters& mission, bool learn) {
  Eigen::Map<Kept> mean(mean_.data());
  Eigen::Map<KeptSquare> covariance(covariance_.data());
  const KeptSquare scatter = scatter_of(robot_, trust_);
  const KeptSquare drifted = covariance + scatter / trust_.memory_missions;
  const Kept innovation = Eigen::Map<const Kept>(mission.value.data()) - mean;
  KeptSquare total =
      drifted + scatter_factor_ * scatter + Eigen::Map<const KeptSquare>(mission.covariance.data());

  // Any payload adds to the mass.
  MissionFinding out;
  const double wide = std::pow(trust_.payload_wide * robot_.limits.payload_kg + 1e-3, 2);
  KeptSquare loaded = total;
  loaded(mass, mass) += wide;
  const Kept of_mass = loaded.ldlt().solve(Kept::Unit(mass));
  const double kg = wide * of_mass.dot(innovation);
  out.undeclared_kg = {kg, std::hypot(std::sqrt(std::max(0.0, wide - wide * wide * of_mass[mass])),
                                      trust_.payload_scale * (mission.declared_kg + std::abs(kg)))};
  out.inseparable = out.undeclared_kg.sd > 0.5 * robot_.limits.payload_kg;
  out.undeclared = std::abs(kg) > trust_.payload_certain * out.undeclared_kg.sd &&
                   std::abs(kg) > trust_.payload_least * robot_.limits.payload_kg;
  if (out.undeclared) total = loaded;
  out.surprise = innovation.dot(total.ldlt().solve(innovation)) / static_cast<double>(m);
  if (!learn) return out;
  const KeptSquare gain = total.ldlt().solve(drifted).transpose();
  mean += gain * innovation;
  covariance = drifted - gain * drifted;
  covariance = (0.5 * (covariance + covariance.transpose())).eval();
  // The first missions' surprise is the file's error.
  if (++steps_ > 3)
    scatter_factor_ = std::clamp(scatter_factor_ * (1 + surprise_memory * (std::min(out.surprise, 9.0) - 1)),
                                 least_factor, greatest_factor);
  return out;
}

double Refinement::with_inertia_scale(double mass_sd_kg) const {
  const double radius_m = robot_.kinematics.wheel_radius_m;
  const double turning_kg =
      2 * (robot_.mass.wheel_inertia_kg_m2 + robot_.motor.rotor_inertia_kg_m2) / (radius_m * radius_m);
  return std::hypot(mass_sd_kg, trust_.inertia_scale * (robot_.total_mass_kg(0) + turning_kg));
}

std::array<Estimate, refined_count> Refinement::estimates() const {
  const Eigen::Map<const KeptSquare> covariance(covariance_.data());
  std::array<Estimate, refined_count> out;
  for (std::size_t k = 0; k < refined_count; ++k) {
    const auto i = static_cast<Eigen::Index>(k);
    out[k] = {mean_[k], std::sqrt(covariance(i, i))};
  }
  out[static_cast<std::size_t>(mass)].sd = with_inertia_scale(out[static_cast<std::size_t>(mass)].sd);
  return out;
}

robot::RobotModel Refinement::refined(double departing) const {
  const Kept file = parameters_of(robot_);
  const Eigen::Map<const Kept> mean(mean_.data());
  const Eigen::Map<const KeptSquare> covariance(covariance_.data());
  const auto now = estimates();
  std::vector<Eigen::Index> moved, held;
  for (Eigen::Index k = 0; k < m; ++k) {
    const Estimate& e = now[static_cast<std::size_t>(k)];
    (std::abs(e.value - file[k]) > departing * e.sd ? moved : held).push_back(k);
  }
  Kept value = file;
  value(moved) = mean(moved) + covariance(moved, held) *
                                   covariance(held, held).ldlt().solve(Eigen::VectorXd((file - mean)(held)));
  value = value.cwiseMax(0).eval();
  robot::RobotModel robot = robot_;
  robot.motor.friction_torque_nm = {value[0], value[1]};
  robot.motor.viscous_friction_nm_s_rad = value[2];
  robot.idle_power_w = value[3];
  robot.mass.chassis_kg += value[4] - file[4];
  robot.battery.internal_resistance_ohm = value[5];
  return robot;
}

double Refinement::significance() const {
  const Kept file = parameters_of(robot_);
  const auto now = estimates();
  double most = 0;
  for (std::size_t k = 0; k < refined_count; ++k)
    most = std::max(most, std::abs(now[k].value - file[static_cast<Eigen::Index>(k)]) / now[k].sd);
  return most;
}

bool Refinement::recall(Memory memory) {
  for (const MissionParameters& mission : memory.learned) {
    const Eigen::LLT<KeptSquare> factor(Eigen::Map<const KeptSquare>(mission.covariance.data()));
    if (!Eigen::Map<const Kept>(mission.value.data()).allFinite() ||
        !Eigen::Map<const KeptSquare>(mission.covariance.data()).allFinite() ||
        factor.info() != Eigen::Success || !std::isfinite(mission.declared_kg))
      return false;
  }
  learned_ = std::move(memory.learned);
  mass_changed_ = memory.mass_changed;
  relearn();
  return true;
}

}  // namespace joulecast::energy

#include "energy/refinement.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <limits>

#include "base/median.h"

namespace joulecast::energy {
namespace {

constexpr auto n = static_cast<Eigen::Index>(unknown_count);
constexpr auto m = static_cast<Eigen::Index>(refined_count);
using ParameterRow = Eigen::Matrix<double, n, 1>;
using ParameterSquare = Eigen::Matrix<double, n, n>;
using Kept = Eigen::Matrix<double, m, 1>;
using KeptSquare = Eigen::Matrix<double, m, m>;

constexpr auto payload = static_cast<Eigen::Index>(Unknown::payload);
constexpr auto mass = static_cast<Eigen::Index>(Unknown::mass);

constexpr std::size_t fewest_equations = 60;
constexpr std::size_t block = 24;  // equations that err together: about 2.5 s
constexpr double huber = 2.5;
constexpr int reweightings = 4;
constexpr double surprise_memory = 0.1;  // weight of the latest mission in the scatter's factor
constexpr double least_factor = 0.1, greatest_factor = 30;

Eigen::Map<const ParameterRow> row_of(const DriveEquation& e) {
  return Eigen::Map<const ParameterRow>(e.row.data());
}

// Solution of one mission's equations under a Gaussian prior of zero mean offset.
struct MissionSolution {
  ParameterRow value;
  ParameterSquare covariance;
  double torque_rms = std::numeric_limits<double>::quiet_NaN();
};

// Robust least squares with a noise level for each kind of equation, taken from the residuals, and covariance
// by blocks of neighbours, since their errors are correlated.
MissionSolution solve(std::span<const DriveEquation> equations, const ParameterRow& prior_mean,
                      const ParameterSquare& prior_precision) {
  constexpr std::size_t kinds = 3;
  std::array<double, kinds> noise{};
  for (std::size_t kind = 0; kind < kinds; ++kind) {
    double square = 0, count = 0;
    for (const DriveEquation& e : equations)
      if (static_cast<std::size_t>(e.kind) == kind) square += e.value * e.value, ++count;
    noise[kind] = count > 0 ? std::sqrt(square / count) : 0;
  }
  MissionSolution out{prior_mean, ParameterSquare::Zero()};
  std::vector<double> weight(equations.size());
  ParameterSquare normal;
  for (int pass = 0; pass < reweightings; ++pass) {
    normal = prior_precision;
    ParameterRow target = prior_precision * prior_mean;
    std::array<std::vector<double>, kinds> sizes;
    for (const DriveEquation& e : equations)
      sizes[static_cast<std::size_t>(e.kind)].push_back(std::abs(e.value - row_of(e).dot(out.value)));
    for (std::size_t kind = 0; kind < kinds; ++kind) {
      const auto& of_kind = sizes[kind];
      if (of_kind.empty()) continue;
      // The median of |x| is 0.6745 standard deviations of a normal variable.
      if (pass > 0) noise[kind] = std::max(upper_median(of_kind) / 0.6745, 1e-9);
      noise[kind] = std::max(noise[kind], 1e-9);
    }
    for (std::size_t k = 0; k < equations.size(); ++k) {
      const DriveEquation& e = equations[k];
      const double sd = noise[static_cast<std::size_t>(e.kind)];
      const double size = std::abs(e.value - row_of(e).dot(out.value)) / sd;
      weight[k] = (pass > 0 && size > huber ? huber / size : 1) / (sd * sd);
      const ParameterRow r = row_of(e);
      normal.noalias() += weight[k] * r * r.transpose();
      target += weight[k] * e.value * r;
    }
    out.value = normal.ldlt().solve(target);
  }
  const ParameterSquare inverse = normal.ldlt().solve(ParameterSquare::Identity());
  ParameterSquare meat = prior_precision;
  ParameterRow sum = ParameterRow::Zero();
  double square = 0, count = 0;
  for (std::size_t k = 0; k < equations.size(); ++k) {
    const DriveEquation& e = equations[k];
    const double residual = e.value - row_of(e).dot(out.value);
    sum += weight[k] * residual * row_of(e);
    if (k % block == block - 1 || k + 1 == equations.size()) {
      meat.noalias() += sum * sum.transpose();
      sum.setZero();
    }
    if (e.kind == DriveEquation::Kind::torque) square += residual * residual, ++count;
  }
  if (count > 0) out.torque_rms = std::sqrt(square / count);
  // Few blocks underestimate it: at least the deviation by independent errors.
  const ParameterSquare sandwich = inverse * meat * inverse;
  out.covariance = 0.5 * (sandwich + inverse);
  out.covariance = (0.5 * (out.covariance + out.covariance.transpose())).eval();
  return out;
}

Kept parameters_of(const robot::RobotModel& robot) {
  Kept out;
  out << robot.motor.friction_torque_nm[0], robot.motor.friction_torque_nm[1],
      robot.motor.viscous_friction_nm_s_rad, robot.idle_power_w, 0;
  return out;
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
  return s;
}

}  // namespace

Refinement::Refinement(const robot::RobotModel& robot, const RefinementTrust& trust)
    : robot_(robot), trust_(trust) {
  Eigen::Map<Kept>(mean_.data()) = parameters_of(robot);
  Kept sd;
  sd << trust.file_friction * robot.motor.friction_torque_nm[0],
      trust.file_friction * robot.motor.friction_torque_nm[1],
      trust.file_viscous * robot.motor.viscous_friction_nm_s_rad + small_viscous(robot),
      trust.file_idle * robot.idle_power_w, trust.file_mass * robot.total_mass_kg(0);
  Eigen::Map<KeptSquare>(covariance_.data()) = sd.cwiseAbs2().cwiseMax(1e-12).asDiagonal();
}

void Refinement::rebase(const robot::RobotModel& robot) {
  // Mass counts from the file's.
  mean_[static_cast<std::size_t>(mass)] += robot_.total_mass_kg(0) - robot.total_mass_kg(0);
  robot_ = robot;
}

MissionFinding Refinement::judge(std::span<const DriveEquation> equations, double declared_kg, bool learn) {
  MissionFinding out;
  out.equations = equations.size();
  out.torque_rms_nm = std::numeric_limits<double>::quiet_NaN();
  if (equations.size() < fewest_equations) return out;
  out.enough = true;

  Eigen::Map<Kept> mean(mean_.data());
  Eigen::Map<KeptSquare> covariance(covariance_.data());
  const KeptSquare scatter = scatter_of(robot_, trust_);
  const KeptSquare drifted = covariance + scatter / trust_.memory_missions;
  const Kept file = parameters_of(robot_);

  ParameterRow prior_mean = ParameterRow::Zero();
  ParameterSquare prior_precision = ParameterSquare::Zero();
  const auto narrow = [&](Unknown unknown, double sd) {
    const auto k = static_cast<Eigen::Index>(unknown);
    prior_precision(k, k) = 1 / (sd * sd);
  };
  narrow(Unknown::payload, trust_.payload_wide * robot_.limits.payload_kg + 1e-3);
  narrow(Unknown::slope_cos, trust_.slope_rad);
  narrow(Unknown::slope_sin, trust_.slope_rad);
  narrow(Unknown::scrub, trust_.scrub);
  narrow(Unknown::yaw_inertia, trust_.yaw_inertia);
  narrow(Unknown::current_bias, trust_.current_bias * robot_.limits.current_a);
  narrow(Unknown::driver_loss, trust_.driver_loss);

  // Payload: with the estimate of the robot.
  const KeptSquare expected = drifted + scatter_factor_ * scatter;
  ParameterSquare informed = prior_precision;
  informed.topLeftCorner<m, m>() = expected.inverse();
  prior_mean.head<m>() = mean - file;
  const MissionSolution whole = solve(equations, prior_mean, informed);
  out.torque_rms_nm = whole.torque_rms;
  const double scale_kg = trust_.payload_scale * (declared_kg + std::abs(whole.value[payload]));
  out.undeclared_kg = {whole.value[payload],
                       std::hypot(std::sqrt(whole.covariance(payload, payload)), scale_kg)};
  out.inseparable = out.undeclared_kg.sd > 0.5 * robot_.limits.payload_kg;
  out.undeclared = std::abs(out.undeclared_kg.value) > trust_.payload_certain * out.undeclared_kg.sd &&
                   std::abs(out.undeclared_kg.value) > trust_.payload_least * robot_.limits.payload_kg;

  // Parameters: from this mission alone, almost free; the payload is the declared one unless another was
  // found.
  if (!out.undeclared) narrow(Unknown::payload, trust_.scatter_mass * robot_.total_mass_kg(0));
  prior_mean.setZero();
  for (Eigen::Index k = 0; k < m; ++k) prior_precision(k, k) = 1e-4 / drifted(k, k);
  const MissionSolution alone = solve(equations, prior_mean, prior_precision);
  const KeptSquare of_mission = alone.covariance.topLeftCorner<m, m>();
  for (Eigen::Index k = 0; k < m; ++k)
    out.parameters[static_cast<std::size_t>(k)] = {file[k] + alone.value[k], std::sqrt(of_mission(k, k))};

  out.parameters.back().sd = with_inertia_scale(out.parameters.back().sd);

  const Kept innovation = file + alone.value.head<m>() - mean;
  const KeptSquare total = drifted + of_mission + scatter_factor_ * scatter;
  out.surprise = innovation.dot(total.ldlt().solve(innovation)) / static_cast<double>(m);
  if (!learn) return out;
  const KeptSquare gain = total.ldlt().solve(drifted).transpose();
  mean += gain * innovation;
  covariance = drifted - gain * drifted;
  covariance = (0.5 * (covariance + covariance.transpose())).eval();
  ++missions_;
  // The first missions' surprise is the file's error.
  if (missions_ > 3)
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
  out.back().sd = with_inertia_scale(out.back().sd);
  return out;
}

robot::RobotModel Refinement::refined() const {
  robot::RobotModel robot = robot_;
  robot.motor.friction_torque_nm = {std::max(0.0, mean_[0]), std::max(0.0, mean_[1])};
  robot.motor.viscous_friction_nm_s_rad = std::max(0.0, mean_[2]);
  robot.idle_power_w = std::max(0.0, mean_[3]);
  return robot;
}

double Refinement::significance() const {
  const Kept file = parameters_of(robot_);
  const auto now = estimates();
  double most = 0;
  for (std::size_t k = 0; k + 1 < refined_count; ++k)
    most = std::max(most, std::abs(now[k].value - file[static_cast<Eigen::Index>(k)]) / now[k].sd);
  return most;
}

Refinement::Memory Refinement::memory() const {
  return {mean_, covariance_, scatter_factor_, missions_};
}

bool Refinement::recall(const Memory& memory) {
  const Eigen::Map<const Kept> mean(memory.mean.data());
  const Eigen::Map<const KeptSquare> covariance(memory.covariance.data());
  if (!mean.allFinite() || !covariance.allFinite() || !(covariance.diagonal().minCoeff() > 0) ||
      !(memory.scatter_factor >= least_factor && memory.scatter_factor <= greatest_factor))
    return false;
  mean_ = memory.mean;
  covariance_ = memory.covariance;
  scatter_factor_ = memory.scatter_factor;
  missions_ = memory.missions;
  return true;
}

}  // namespace joulecast::energy

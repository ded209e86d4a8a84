#include "ingest/refinement_watch.h"

#include <fmt/format.h>

#include <algorithm>
#include <cassert>
#include <cmath>
#include <nlohmann/json.hpp>
#include <utility>

#include "base/json_number.h"
#include "robot/robot_file.h"

namespace joulecast::ingest {
namespace {

using Json = nlohmann::json;

constexpr std::int64_t held_out_every = 3;
constexpr std::size_t fewest_missions = 6;    // before anything is proposed
constexpr std::size_t missions_between = 4;   // proposals
constexpr double least_significance = 3;      // standard deviations from the model in force
constexpr double least_change = 0.02;         // of the friction torque or the idle power
constexpr std::size_t most_remembered = 100;  // missions used for training
constexpr double payload_memory = 0.9;        // of the weights, with each mission
constexpr double payload_certain = 3.3;       // standard deviations, as of one mission's payload
constexpr double pound_kg = 0.45359237;

energy::DriveEquations equations_of(const robot::RobotModel& robot) {
  auto equations = energy::DriveEquations::make(robot);
  assert(equations);
  return std::move(*equations);
}

constexpr std::array<std::string_view, energy::refined_count> units{"N m", "N m", "N m s/rad", "W", "kg"};

}  // namespace

RefinementWatch::RefinementWatch(const robot::RobotModel& robot, std::int64_t version)
    : robot_(robot), version_(version), equations_(equations_of(robot)), refinement_(robot) {}

void RefinementWatch::use(const robot::RobotModel& robot, std::int64_t version) {
  // With other effects the same parameters would explain a different share of the missions used so far.
  if (robot.effects == robot_.effects) {
    refinement_.rebase(robot);
  } else {
    refinement_ = energy::Refinement(robot);
    learned_from_.clear();
    proposed_at_ = 0;
  }
  robot_ = robot;
  version_ = version;
  equations_ = equations_of(robot);
}

void RefinementWatch::begin_mission() {
  equations_.take();
}

RefinementWatch::Judgement RefinementWatch::end_mission(const history::Mission& mission) {
  Judgement out;
  const std::vector<energy::DriveEquation> equations = equations_.take();
  const double declared_kg = equations_.mean_payload_kg();
  const bool learn = judged_ % held_out_every != held_out_every - 1;
  const energy::MissionFinding finding = refinement_.judge(equations, declared_kg, learn);
  if (!finding.enough) return out;
  ++judged_;
  if (learn) {
    if (learned_from_.size() == most_remembered) learned_from_.erase(learned_from_.begin());
    learned_from_.push_back(mission.key);
  }
  const char* verdict = finding.inseparable  ? "inseparable"
                        : finding.undeclared ? "undeclared"
                                             : "as_declared";
  const Json payload{{"verdict", verdict},
                     {"declared_kg", declared_kg},
                     {"undeclared_kg", finding.undeclared_kg.value},
                     {"undeclared_sd_kg", finding.undeclared_kg.sd}};
  Json document{{"equations", finding.equations},
                {"learned_from", learn},
                {"payload", payload},
                {"torque_rms_nm", json_number(finding.torque_rms_nm)},
                {"surprise", finding.surprise},
                {"parameters", Json::object()}};
  for (std::size_t k = 0; k < energy::refined_count; ++k)
    document["parameters"][std::string(energy::unknown_names[k])] = {{"value", finding.parameters[k].value},
                                                                     {"sd", finding.parameters[k].sd}};
  out.findings_json = document.dump();
  if (finding.undeclared && !finding.inseparable) {
    Json event = payload;
    event["mission"] = mission.key;
    event["mission_id"] = mission.mission_id;
    out.payload_event_json = event.dump(-1, ' ', false, Json::error_handler_t::replace);
  }
  if (!finding.inseparable && finding.undeclared_kg.sd > 0) {
    const double weight = 1 / (finding.undeclared_kg.sd * finding.undeclared_kg.sd);
    const double carried_kg = declared_kg + finding.undeclared_kg.value;
    const std::array<double, 5> terms{1, declared_kg, carried_kg, declared_kg * declared_kg,
                                      declared_kg * carried_kg};
    for (std::size_t k = 0; k < terms.size(); ++k)
      payload_sums_[k] = payload_memory * payload_sums_[k] + weight * terms[k];
  }
  out.payload_unit = payload_unit();
  if (learn && worth_proposing()) {
    out.proposal = proposal();
    proposed_at_ = refinement_.missions();
  }
  return out;
}

// Whether the carried payload grows with the declared one as pounds do, and not as kilograms. Load that is
// carried always is the constant of the line.
std::optional<Contradiction> RefinementWatch::payload_unit() const {
  const auto [w, x, y, xx, xy] = payload_sums_;
  const double spread = xx - x * x / w;
  if (!(spread > 1e-9 * xx)) return std::nullopt;  // one declared payload
  const double slope = (xy - x * y / w) / spread, sd = 1 / std::sqrt(spread);
  if (1 - slope < payload_certain * sd || sd > (1 - pound_kg) / payload_certain ||
      std::abs(slope - pound_kg) > payload_certain * sd)
    return std::nullopt;
  Contradiction c;
  c.kind = ContradictionKind::scale;
  c.id = "payload_scale";
  c.channel = "payload_mass";
  c.value = slope;
  c.says = fmt::format(
      "payload_mass looks given in lb: by the motors, the robot carries {:.2f} ({:.2f} to {:.2f}) "
      "times what its missions declare; joulecast expects kg.",
      slope, slope - 1.96 * sd, slope + 1.96 * sd);
  return c;
}

bool RefinementWatch::worth_proposing() const {
  const std::size_t missions = refinement_.missions();
  if (missions < fewest_missions || (proposed_at_ > 0 && missions < proposed_at_ + missions_between))
    return false;
  if (refinement_.significance() < least_significance) return false;
  const robot::RobotModel refined = refinement_.refined();
  const auto& before = robot_.motor;
  const auto& after = refined.motor;
  // Against the friction at top speed, dry and viscous, of which there is always some.
  const double top_rad_s = robot_.limits.speed_m_s / robot_.kinematics.wheel_radius_m;
  const double scale_nm = std::max(before.friction_torque_nm[0], before.friction_torque_nm[1]) +
                          before.viscous_friction_nm_s_rad * top_rad_s;
  double change = std::abs(refined.idle_power_w - robot_.idle_power_w) / std::max(robot_.idle_power_w, 1e-9);
  for (std::size_t side : {0u, 1u})
    change = std::max(change,
                      std::abs(after.friction_torque_nm[side] - before.friction_torque_nm[side]) / scale_nm);
  change = std::max(change, std::abs(after.viscous_friction_nm_s_rad - before.viscous_friction_nm_s_rad) *
                                top_rad_s / scale_nm);
  return change > least_change;
}

history::Proposal RefinementWatch::proposal() const {
  const robot::RobotModel refined = refinement_.refined();
  history::Proposal p;
  p.robot_id = robot_.robot_id;
  p.kind = "calibration";
  p.note = "friction and idle power from " + std::to_string(refinement_.missions()) + " missions";
  p.base_version = version_;
  p.fitted_on = learned_from_;
  p.model_json = robot::to_json_text(refined);
  Json detail{{"missions", refinement_.missions()},
              {"significance_sd", refinement_.significance()},
              {"scatter_factor", refinement_.scatter_factor()},
              {"parameters", Json::array()}};
  const auto estimates = refinement_.estimates();
  const double in_force[] = {robot_.motor.friction_torque_nm[0], robot_.motor.friction_torque_nm[1],
                             robot_.motor.viscous_friction_nm_s_rad, robot_.idle_power_w};
  for (std::size_t k = 0; k < std::size(in_force); ++k)
    detail["parameters"].push_back({{"name", energy::unknown_names[k]},
                                    {"unit", units[k]},
                                    {"in_force", in_force[k]},
                                    {"value", estimates[k].value},
                                    {"sd", estimates[k].sd}});
  p.detail_json = detail.dump();
  return p;
}

std::string RefinementWatch::memory_json() const {
  const energy::Refinement::Memory memory = refinement_.memory();
  return Json{{"mean", memory.mean},
              {"covariance", memory.covariance},
              {"scatter_factor", memory.scatter_factor},
              {"missions", memory.missions},
              {"file_mass_kg", robot_.total_mass_kg(0)},
              {"judged", judged_},
              {"payload_sums", payload_sums_},
              {"proposed_at", proposed_at_},
              {"learned_from", learned_from_}}
      .dump();
}

void RefinementWatch::recall(const std::string& text) {
  const Json document = Json::parse(text, nullptr, false);
  if (!document.is_object()) return;
  try {
    energy::Refinement::Memory memory;
    memory.mean = document.at("mean").get<decltype(memory.mean)>();
    memory.covariance = document.at("covariance").get<decltype(memory.covariance)>();
    memory.scatter_factor = document.at("scatter_factor").get<double>();
    memory.missions = document.at("missions").get<std::size_t>();
    // The mass counts from the file's, which may be another one by now.
    memory.mean.back() += document.at("file_mass_kg").get<double>() - robot_.total_mass_kg(0);
    auto learned_from = document.at("learned_from").get<std::vector<history::MissionKey>>();
    const auto judged = document.at("judged").get<std::int64_t>();
    const auto proposed_at = document.at("proposed_at").get<std::size_t>();
    if (document.contains("payload_sums"))
      payload_sums_ = document["payload_sums"].get<decltype(payload_sums_)>();
    if (!refinement_.recall(memory)) return;
    learned_from_ = std::move(learned_from);
    judged_ = judged;
    proposed_at_ = proposed_at;
  } catch (const Json::exception&) {
    // Written by another version: training begins again.
  }
}

}  // namespace joulecast::ingest

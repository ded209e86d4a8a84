#include "ingest/refinement_watch.h"

#include <fmt/format.h>

#include <cassert>
#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>
#include <utility>

#include "base/json_number.h"
#include "robot/robot_file.h"

namespace joulecast::ingest {

NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE(RefinementProgress, judged, payload_sums, changed_utime_us, tests,
                                   tested_at, learned_from)

namespace {

using Json = nlohmann::json;

constexpr std::int64_t held_out_every = 2;
constexpr std::size_t fewest_missions = drift::Settings().least_missions;  // on either side of a back-test
// Standard deviations from the model in force; halved and doubled: the same proposals (calibrate.md).
constexpr double least_significance = 3;
// The same, of the parameters that a candidate changes. Of robots with one changed parameter, at 1 half of
// the proposals change the mass too; at 3 one after three missions omits a side whose friction changed.
constexpr double least_departure = 2;
// Of the weights, with each mission, so that the slope's deviation stays above errors that all missions have
// in common. At 0.81, 0.95 (16 missions) and 1 (60) a unit is named at the same missions.
constexpr double payload_memory = 0.9;
// Halved: the same; doubled: named after one and four more missions for two of five robots.
constexpr double payload_certain = energy::RefinementTrust().payload_certain;
constexpr double pound_kg = 0.45359237;

energy::DriveEquations equations_of(const robot::RobotModel& robot) {
  auto equations = energy::DriveEquations::make(robot);
  assert(equations);
  return std::move(*equations);
}

struct Words {
  std::string_view name, unit;
};
constexpr std::array<Words, energy::refined_count> words{{{"friction torque right", "N m"},
                                                          {"friction torque left", "N m"},
                                                          {"viscous friction", "N m s/rad"},
                                                          {"idle power", "W"},
                                                          {"mass", "kg"},
                                                          {"battery resistance", "ohm"}}};

}  // namespace

RefinementWatch::RefinementWatch(const robot::RobotModel& robot, std::int64_t version)
    : robot_(robot), version_(version), equations_(equations_of(robot)), refinement_(robot) {}

void RefinementWatch::use(const robot::RobotModel& robot, std::int64_t version) {
  // With other effects the same parameters would explain a different share of the missions used so far.
  if (robot.effects == robot_.effects) {
    refinement_.rebase(robot);
  } else {
    refinement_ = energy::Refinement(robot);
    progress_.learned_from.clear();
  }
  begin_tests();
  robot_ = robot;
  version_ = version;
  equations_ = equations_of(robot);
}

RefinementWatch::Judgement RefinementWatch::end_mission(const history::Mission& mission) {
  Judgement out;
  const std::vector<energy::DriveEquation> equations = equations_.take();
  const double declared_kg = equations_.mean_payload_kg();
  const bool learn = progress_.judged % held_out_every != held_out_every - 1;
  const energy::MissionFinding finding =
      refinement_.judge(equations, declared_kg, mission.start_utime_us, learn);
  if (!finding.enough) return out;
  ++progress_.judged;
  if (learn) progress_.learned_from.push_back(mission.key);
  while (progress_.learned_from.size() > refinement_.missions()) progress_.learned_from.pop_front();
  if (!finding.inseparable && finding.undeclared_kg.sd > 0) {
    const double weight = 1 / (finding.undeclared_kg.sd * finding.undeclared_kg.sd);
    const double carried_kg = declared_kg + finding.undeclared_kg.value;
    const std::array<double, 5> terms{1, declared_kg, carried_kg, declared_kg * declared_kg,
                                      declared_kg * carried_kg};
    for (std::size_t k = 0; k < terms.size(); ++k)
      progress_.payload_sums[k] = payload_memory * progress_.payload_sums[k] + weight * terms[k];
  }
  const PayloadLine line = payload_line();
  // Less than nothing is an error of the file.
  const bool inseparable =
      finding.inseparable ||
      (finding.undeclared && line.unloaded_kg < -least_significance * line.unloaded_sd_kg);
  const char* verdict = inseparable ? "inseparable" : finding.undeclared ? "undeclared" : "as_declared";
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
  const auto in_force = energy::refined_values(robot_);
  for (std::size_t k = 0; k < energy::refined_count; ++k)
    document["parameters"][std::string(energy::refined_names[k])] = {
        {"value", finding.parameters[k].value}, {"sd", finding.parameters[k].sd}, {"in_force", in_force[k]}};
  out.findings_json = document.dump();
  if (finding.undeclared && !inseparable) {
    Json event = payload;
    event["mission"] = mission.key;
    event["mission_id"] = mission.mission_id;
    out.payload_event_json = json_text(event);
  }
  out.payload_unit = payload_unit(line);
  return out;
}

RefinementWatch::PayloadLine RefinementWatch::payload_line() const {
  const auto [w, x, y, xx, xy] = progress_.payload_sums;
  const double spread = xx - x * x / w;
  // Of one declared payload: the unloaded robot carries this at most.
  if (!(spread > 1e-9 * xx)) return {0, std::numeric_limits<double>::infinity(), y / w, 1 / std::sqrt(w)};
  const double slope = (xy - x * y / w) / spread, sd = 1 / std::sqrt(spread);
  return {slope, sd, (y - slope * x) / w, std::sqrt(1 / w + x * x / (w * w * spread))};
}

// Whether the carried payload grows with the declared one as pounds do, and not as kilograms, while the file
// explains the unloaded robot.
std::optional<Contradiction> RefinementWatch::payload_unit(const PayloadLine& line) {
  const auto& [slope, sd, unloaded_kg, unloaded_sd_kg] = line;
  if (1 - slope < payload_certain * sd || sd > (1 - pound_kg) / payload_certain ||
      std::abs(slope - pound_kg) > payload_certain * sd ||
      std::abs(unloaded_kg) > least_significance * unloaded_sd_kg)
    return std::nullopt;
  return Contradiction{
      ContradictionKind::scale, "payload_scale", "payload_mass", slope,
      fmt::format(
          "payload_mass looks given in lb: by the motors, the robot carries {:.2f} ({:.2f} to {:.2f}) "
          "times what its missions declare; joulecast expects kg.",
          slope, slope - 1.96 * sd, slope + 1.96 * sd)};
}

void RefinementWatch::set_change(const std::optional<drift::Mark>& change) {
  if (!change || change->utime_us <= progress_.changed_utime_us) return;
  progress_.changed_utime_us = change->utime_us;
  refinement_.restart(change->utime_us, change->quantity == drift::Quantity::mass);
  while (progress_.learned_from.size() > refinement_.missions()) progress_.learned_from.pop_front();
  begin_tests();
}

// One that failed its back-test is tried again with a quarter more missions.
std::optional<history::Proposal> RefinementWatch::suggestion() {
  const std::size_t missions = refinement_.missions();
  if (missions < fewest_missions || missions <= progress_.tested_at + progress_.tested_at / 4 ||
      !(refinement_.significance() > least_significance))
    return std::nullopt;
  ++progress_.tests;
  progress_.tested_at = missions;
  const robot::RobotModel refined = refinement_.refined(least_departure);
  history::Proposal p;
  p.robot_id = robot_.robot_id;
  p.kind = "calibration";
  p.base_version = version_;
  p.fitted_on = {progress_.learned_from.begin(), progress_.learned_from.end()};
  p.model_json = robot::to_json_text(refined);
  Json detail{{"missions", refinement_.missions()},
              {"tests", progress_.tests},
              {"fitted_until_utime_us", refinement_.memory().learned.back().utime_us},
              {"significance_sd", refinement_.significance()},
              {"scatter_factor", refinement_.scatter_factor()},
              {"parameters", Json::array()}};
  const auto estimates = refinement_.estimates();
  const auto in_force = energy::refined_values(robot_), value = energy::refined_values(refined);
  std::string names;
  for (std::size_t k = 0; k < energy::refined_count; ++k) {
    if (value[k] == in_force[k]) continue;
    names.append(names.empty() ? "" : ", ").append(words[k].name);
    detail["parameters"].push_back({{"name", energy::refined_names[k]},
                                    {"unit", words[k].unit},
                                    {"in_force", in_force[k]},
                                    {"value", value[k]},
                                    {"sd", estimates[k].sd}});
  }
  p.note = names + " from " + std::to_string(refinement_.missions()) + " missions";
  p.detail_json = detail.dump();
  return p;
}

std::string RefinementWatch::memory_json() const {
  const energy::Refinement::Memory memory = refinement_.memory();
  Json learned = Json::array();
  for (const energy::MissionParameters& m : memory.learned)
    learned.push_back({m.utime_us, m.declared_kg, m.value, m.covariance});
  Json document = progress_;
  document["learned"] = std::move(learned);
  document["mass_changed"] = memory.mass_changed;
  return document.dump();
}

void RefinementWatch::recall(const std::string& text) {
  const Json document = Json::parse(text, nullptr, false);
  if (!document.is_object()) return;
  try {
    energy::Refinement::Memory memory;
    for (const Json& m : document.at("learned"))
      memory.learned.push_back({m.at(0), m.at(1), m.at(2), m.at(3)});
    memory.mass_changed = document.at("mass_changed").get<bool>();
    auto progress = document.get<RefinementProgress>();
    if (progress.learned_from.size() == memory.learned.size() && refinement_.recall(std::move(memory)))
      progress_ = std::move(progress);
  } catch (const Json::exception&) {
    // Written by another version: training begins again.
  }
}

}  // namespace joulecast::ingest

// Changes found and models proposed on virtual robots, through the service's own parts: a pipeline on a
// store, the detector, forecasts and the review of proposals, one after the other at each mission's end.
// Prints a line of JSON for each robot.
//
// proposal_trial KIND EFFECT STRENGTH UNCHANGED CHANGED FIRST_SEED LAST_SEED
// EFFECT: one that virtual robots know, or none; it begins after UNCHANGED missions and lasts for CHANGED.
#include <cstdio>
#include <cstdlib>
#include <nlohmann/json.hpp>
#include <span>
#include <string>
#include <string_view>

#include "client/virtual_robot/fleet.h"
#include "server/diagnosis/drift_view.h"
#include "server/diagnosis/proposal_review.h"
#include "signals/sample.h"
#include "tests/ingest/harness.h"

namespace joulecast::server {
namespace {

using nlohmann::json;

struct Trial {
  std::string_view robot_json;
  std::vector<virtual_robot::EffectStrength> effects;
  int unchanged = 0, changed = 0;
};

json run(const Trial& trial, std::uint64_t seed) {
  const robot::RobotModel robot = robot::parse_robot(trial.robot_json).value();
  joulecast::testing::PipelineHarness harness;
  harness.add_robot(robot);
  history::Writer writer(*harness.store, history::WriterOptions{});
  const DriftView drift(*harness.store, harness.models, {});
  const Parts parts{*harness.store, writer, harness.models, drift, [] { return 42; }};
  ModelAdoption adoption(parts, {});
  ReviewOptions options;
  options.warn = [](const std::string&, const std::string& text) {
    std::fprintf(stderr, "%s\n", text.c_str());
  };
  ProposalReview review(parts, adoption, options);

  json out{{"robot", robot.robot_id}, {"seed", seed}, {"unchanged", trial.unchanged}};
  out["marks"] = out["proposals"] = out["dismissed"] = json::array();
  std::size_t ended = 0, marked = 0;
  std::int64_t last_proposal = 0, last_event = 0;
  const auto end_mission = [&] {
    ++ended;
    const auto marks = drift.marks(robot.robot_id).value();
    if (!marks.empty()) harness.last_change = marks.back();
    for (; marked < marks.size(); ++marked)
      out["marks"].push_back({{"found_after", ended},
                              {"first_mission", marks[marked].mission_key},
                              {"quantity", marks[marked].quantity_name()},
                              {"change", marks[marked].change()}});
    for (history::Proposal& candidate : harness.candidates) review.suggest(std::move(candidate));
    harness.candidates.clear();
    review.mission_ended(robot.robot_id);
    review.look();
    (void)writer.flush();
    const auto proposals = harness.store->proposals(robot.robot_id, history::whole_future, 1).value();
    if (!proposals.empty() && proposals[0].id != last_proposal) {
      last_proposal = proposals[0].id;
      const json detail = json::parse(proposals[0].detail_json);
      json back_test = detail["back_test"];
      back_test["missions"] = back_test["missions"].size();
      out["proposals"].push_back({{"after", ended},
                                  {"parameters", detail["parameters"]},
                                  {"back_test", back_test},
                                  {"tests", detail["tests"]}});
    }
    const auto events = harness.store->events(last_event, 100).value();
    for (const history::Event& event : events) {
      last_event = event.id;
      if (event.kind == "proposal_dismissed")
        out["dismissed"].push_back({{"after", ended}, {"reason", json::parse(event.detail_json)["reason"]}});
    }
  };

  std::int64_t last_us = 1'700'000'000'000'000;
  double charge = 0.8;
  for (const bool changed : {false, true}) {
    virtual_robot::SimulationSpec spec;
    spec.robot = virtual_robot::parse_robot(std::string(trial.robot_json)).value();
    spec.missions = changed ? trial.changed : trial.unchanged;
    if (spec.missions == 0) continue;
    spec.script.pickup_share = 0.3;
    spec.start_utime_us = last_us + 60'000'000;
    spec.run = changed ? "b" : "a";
    spec.initial_charge = charge;
    if (changed) spec.imperfections = virtual_robot::make_imperfections(trial.effects).value();
    virtual_robot::VirtualRobot machine(spec, 2 * seed + (changed ? 1 : 0));
    while (auto emission = machine.next()) {
      last_us = emission->utime_us;
      std::visit(
          [&](auto& message) {
            harness.pipeline->handle({robot.robot_id, message, emission->utime_us});
          },
          emission->message);
      const auto* event = std::get_if<signals::MissionEvent>(&emission->message);
      if (event != nullptr && event->phase != signals::MissionPhase::started) end_mission();
    }
    charge = machine.state_of_charge();
  }
  const auto missions = drift.missions(robot.robot_id, 100).value();
  for (const drift::MissionRatio& m : missions) out["ratios"].push_back(m.ratios());
  return out;
}

}  // namespace
}  // namespace joulecast::server

int main(int argc, char** argv) {
  using namespace joulecast;
  const std::span<char*> arguments(argv, static_cast<std::size_t>(argc));
  if (arguments.size() != 8) return 2;
  server::Trial trial;
  for (const auto& shipped : virtual_robot::shipped_robots())
    if (shipped.kind == arguments[1]) trial.robot_json = shipped.json_text;
  if (const std::string effect = arguments[2]; effect != "none")
    trial.effects = {{effect, std::atof(arguments[3])}};
  trial.unchanged = std::atoi(arguments[4]);
  trial.changed = std::atoi(arguments[5]);
  for (int seed = std::atoi(arguments[6]); seed <= std::atoi(arguments[7]); ++seed) {
    std::printf("%s\n", server::run(trial, static_cast<std::uint64_t>(seed)).dump().c_str());
    std::fflush(stdout);
  }
}

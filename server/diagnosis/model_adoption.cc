#include "server/diagnosis/model_adoption.h"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "answers/mission.h"
#include "base/json_number.h"
#include "base/try.h"
#include "robot/robot_file.h"

namespace joulecast::server {
namespace {

using Json = nlohmann::json;

std::string percent(double share) {
  char text[32];
  std::snprintf(text, sizeof text, "%.2f %%", 100 * share);
  return text;
}

std::string refusal_of(const energy::BackTest& test) {
  if (test.runs.empty())
    return "there is no mission to test it on: none with stored telemetry and measured energy that it was "
           "not fitted on";
  if (test.improves()) return {};
  const std::string errors = "energy error " + percent(test.error_before) + " before, " +
                             percent(test.error_after) + " after, on " + std::to_string(test.runs.size()) +
                             " missions",
                    power = percent(test.power_gap_before) + " before, " + percent(test.power_gap_after) +
                            " after";
  if (test.voltage_gap_after > test.voltage_gap_before)
    return "the error of the battery's voltage is larger with it: " + percent(test.voltage_gap_before) +
           " before, " + percent(test.voltage_gap_after) + " after (" + errors + ")";
  if (test.power_gap_after > test.power_gap_before)
    return "the error of power is larger with it: " + power + " (" + errors + ")";
  const auto interval = [](const std::array<double, 2>& of) {
    return percent(of[0]) + " to " + percent(of[1]);
  };
  if (test.improvement_interval[1] < 0)
    return "the error of missions' energy is larger with it: " + errors + " (power " + power + ")";
  return "no improvement is shown: " + errors + ", 95 % interval of its fall " +
         interval(test.improvement_interval) + "; power off by " + power + ", of its fall " +
         interval(test.power_gap_fall_interval);
}

Error as_of_request(Error error, const gap::Offer& offer) {
  if (error.field == "effect") error.field = "/effect";
  if (!error.field.empty()) return error;
  error.field = "/diagnosis_id";
  error.message = "Not adopted: " + error.message + ".";
  if (!offer.effects.empty()) error.message += " To adopt it anyway, set force.";
  return error;
}

}  // namespace

Result<StoredRecordings> ModelAdoption::history(const AdoptionRequest& request,
                                                const ingest::ModelInForce& before,
                                                std::optional<std::int64_t>& since_utime_us) const {
  constexpr std::size_t enough_missions = 3;
  RecordingsWanted wanted;
  wanted.robot_id = request.model.robot_id;
  wanted.except = {request.fitted_on.begin(), request.fitted_on.end()};
  wanted.max_missions = options_.max_missions;
  wanted.max_samples = options_.max_samples;
  wanted.battery_capacity_ah = before.robot.battery.capacity_ah;
  since_utime_us = request.since_utime_us;
  if (!since_utime_us) {
    for (const history::MissionKey key : request.fitted_on)
      if (const auto mission = parts_.store.mission(key))
        since_utime_us = std::min(since_utime_us.value_or(mission->start_utime_us), mission->start_utime_us);
    TRY_ASSIGN(const auto change, parts_.drift.last_change(wanted.robot_id, before.version));
    if (change && change > since_utime_us) {
      wanted.since_utime_us = change;
      Result<StoredRecordings> recent = read_recordings(parts_.store, wanted);
      if (!recent || recent->missions.size() >= enough_missions) {
        since_utime_us = change;
        return recent;
      }
    }
  }
  wanted.since_utime_us = since_utime_us;
  return read_recordings(parts_.store, wanted);
}

Result<void> ModelAdoption::test(const AdoptionRequest& request, const ingest::ModelInForce& before,
                                 const std::function<bool()>& go_on, Adoption& adoption) {
  const std::unique_lock lock(testing_, std::try_to_lock);
  if (!lock) return fail(Fault::unavailable, "", "another model is being tested; try again in some seconds");
  TRY_ASSIGN(const StoredRecordings history, this->history(request, before, adoption.since_utime_us));
  adoption.left_out = history.left_out;
  std::vector<energy::DriveRun> runs;
  for (const StoredRecording& mission : history.missions) {
    const double payload_kg = mission.recording.payload_kg;
    // The key names the run: mission ids may repeat.
    runs.push_back(
        {std::to_string(mission.key), mission.recording.samples, std::isfinite(payload_kg) ? payload_kg : 0});
  }
  energy::BackTestSettings settings;
  settings.meter = options_.meter;
  settings.go_on = go_on;
  settings.comparisons = request.comparisons;
  TRY_ASSIGN(energy::BackTest test, energy::back_test(runs, request.against ? *request.against : before.robot,
                                                      request.model, settings));
  adoption.test = std::move(test);
  for (energy::RunComparison& run : adoption.test.runs) {
    const history::MissionKey key = std::stoll(run.name);
    run.id = key;
    for (const StoredRecording& mission : history.missions)
      if (mission.key == key) run.name = mission.recording.mission_id;
  }
  return {};
}

const described::Table<Adoption>& back_test_table() {
  using A = Adoption;
  static const auto left_out =
      described::Table<LeftOut>()
          .value("fitted_on", &LeftOut::excepted, "missions used to fit the new model")
          .value("open", &LeftOut::open, "missions that have not ended")
          .value("no_telemetry", &LeftOut::no_telemetry, "missions without stored raw telemetry")
          .value("contradicted", &LeftOut::contradicted,
                 "missions with channels that contradict each other or the robot file")
          .value("annulled", &LeftOut::annulled, "annulled missions")
          .value("beyond_limits", &LeftOut::too_many,
                 "missions beyond adoption.max_missions or adoption.max_samples")
          .value("charging_samples", &LeftOut::charging_samples,
                 "samples of the tested missions received at a charger, which are excluded from the test");
  static const auto table =
      described::Table<A>("Test of a model on missions that were not used to fit it")
          .value("tested_against", &A::previous_version, "model version of `before`")
          .include(answers::back_test_table(), &A::test)
          .object("left_out", &A::left_out, "missions excluded from the test, by reason", left_out)
          .value("since_utime_us", &A::since_utime_us,
                 "missions that started earlier are excluded: those before the first one used for the fit, "
                 "and those before the robot's last change of consumption if at least three missions "
                 "followed it; null: none excluded");
  return table;
}

Result<Adoption> ModelAdoption::adopt(const AdoptionRequest& request, const std::function<bool()>& go_on,
                                      const std::function<history::Change(const Adoption&)>& closing) {
  const std::string& robot_id = request.model.robot_id;
  const std::shared_ptr<const ingest::ModelInForce> before = parts_.models.find(robot_id);
  if (before == nullptr)
    return fail(Fault::not_found, "id",
                "robot " + robot_id + " has no model to test a new one against: add its robot file");
  const auto in_force_not = [&](std::int64_t version) {
    return "version " + std::to_string(before->version) + " is in force, not " + std::to_string(version);
  };
  if (const auto& version = request.expected_version; version && *version != before->version)
    return fail(Fault::conflict, "/expected_version", in_force_not(*version));
  if (const auto& version = request.diagnosed_version; version && *version != before->version)
    return fail(
        Fault::conflict, "/diagnosis_id",
        "the diagnosis is about another model: " + in_force_not(*version) + "; set force to adopt it anyway");
  TRY(robot::validate(request.model));

  Adoption adoption;
  adoption.previous_version = adoption.version = before->version;
  TRY(test(request, *before, go_on, adoption));
  adoption.back_test_json = back_test_table().text(adoption);
  const Json report = Json::parse(adoption.back_test_json);
  adoption.refusal = refusal_of(adoption.test);
  if (request.dry_run) return adoption;
  if (!adoption.refusal.empty() && !request.force) return ++refused_, adoption;

  const bool forced = !adoption.refusal.empty() || !request.overridden.empty();
  Json evidence = {{"back_test", report}, {"forced", forced}};
  if (!request.overridden.empty()) evidence["overridden"] = request.overridden;
  if (request.diagnosis_id) evidence["diagnosis_id"] = *request.diagnosis_id;
  if (request.proposal_id) evidence["proposal_id"] = *request.proposal_id;
  history::AddModel command;
  command.robot_id = robot_id;
  command.utime_us = parts_.now_utime_us();
  command.origin = request.origin;
  command.note = request.note;
  command.model_json = robot::to_json_text(request.model);
  command.expected_active = before->version;
  command.evidence_json = evidence.dump();
  adoption.adopted = true;
  evidence.erase("back_test");
  evidence.update({{"previous_version", adoption.previous_version},
                   {"origin", history::name(request.origin)},
                   {"tested_on_missions", adoption.test.runs.size()},
                   {"error_before", report["error_before"]},
                   {"error_after", report["error_after"]}});
  history::Change change = closing ? closing(adoption) : history::Change{};
  change.add_before([event = history::Event{0, command.utime_us, robot_id, "model_adopted", {}}, evidence,
                     proposal = request.proposal_id](std::int64_t version) mutable {
    evidence["model_version"] = version;
    event.detail_json = evidence.dump();
    std::vector<history::Command> commands{history::AppendEvent{event}};
    if (proposal)
      commands.emplace_back(history::CloseProposal{*proposal, history::ProposalState::adopted, version});
    return commands;
  });
  change.command = std::move(command);
  TRY_ASSIGN(adoption.version, put(std::move(change), request.model));
  ++(forced ? forced_ : adopted_);
  return adoption;
}

Result<std::int64_t> ModelAdoption::put(history::Change change, const robot::RobotModel& model) {
  const std::lock_guard lock(putting_);
  TRY_ASSIGN(const std::int64_t version, parts_.writer.execute(std::move(change)));
  TRY(parts_.models.put(model, version));
  return version;
}

Result<std::int64_t> ModelAdoption::put(const robot::RobotModel& model, history::Change closing) {
  if (parts_.models.find(model.robot_id) == nullptr && parts_.models.size() >= options_.most_robots)
    return fail(Fault::conflict, "id",
                std::to_string(parts_.models.size()) +
                    " robots have a model, and no more may (robots.most): DELETE one that is gone, or raise "
                    "robots.most");
  history::AddModel command;
  command.robot_id = model.robot_id;
  command.utime_us = parts_.now_utime_us();
  command.origin = history::ModelOrigin::http;
  command.model_json = robot::to_json_text(model);
  closing.command = std::move(command);
  return put(std::move(closing), model);
}

Result<std::int64_t> ModelAdoption::activate(const std::string& robot_id, std::int64_t version,
                                             const std::string& note,
                                             const std::function<history::Change(std::int64_t)>& closing) {
  TRY_ASSIGN(history::ModelVersion stored, parts_.store.model(robot_id, version));
  TRY_ASSIGN(robot::RobotModel robot, robot::parse_robot(stored.model_json));
  const std::lock_guard lock(putting_);
  const std::shared_ptr<const ingest::ModelInForce> before = parts_.models.find(robot_id);
  const std::int64_t previous = before != nullptr ? before->version : 0;
  if (previous == version) return previous;
  const Json detail = {{"model_version", version}, {"previous_version", previous}, {"note", note}};
  history::Change change = closing ? closing(previous) : history::Change{};
  change.command = history::ActivateModel{robot_id, version};
  change.add_before(
      [event = history::Event{0, parts_.now_utime_us(), robot_id, "model_activated", json_text(detail)}](
          std::int64_t) { return std::vector<history::Command>{history::AppendEvent{event}}; });
  TRY(parts_.writer.execute(std::move(change)));
  TRY(parts_.models.put(std::move(robot), version));
  return previous;
}

Result<DiagnosedModel> diagnosed_model(const history::Store& store, const history::DiagnosisRecord& diagnosis,
                                       const gap::Choice& choice) {
  if (diagnosis.result_json.empty() || !diagnosis.model_version)
    return fail(Fault::conflict, "/diagnosis_id", "holds nothing to adopt");
  const auto result = nlohmann::json::parse(diagnosis.result_json, nullptr, false);
  TRY_ASSIGN(const gap::Offer offer, gap::offer_from_json(result));
  TRY_ASSIGN(const history::ModelVersion version, store.model(diagnosis.robot_id, diagnosis.model_version));
  TRY_ASSIGN(const robot::RobotModel robot, robot::parse_robot(version.model_json));
  Result<robot::RobotModel> model = gap::take(offer, robot, choice);
  if (!model) return tl::unexpected(as_of_request(std::move(model.error()), offer));
  return DiagnosedModel{std::move(*model), offer.refusal};
}

}  // namespace joulecast::server

#include "server/api/requests.h"

#include <algorithm>
#include <nlohmann/json.hpp>

#include "describe/input.h"

namespace joulecast::api {
namespace {

using described::Input;
using described::Presence;
using server::DiagnosisRequest;
using Json = nlohmann::json;

constexpr std::int64_t greatest_id = std::int64_t{1} << 53;  // what JSON numbers hold exactly
constexpr std::size_t longest_note = 1000;
constexpr std::size_t most_effects = 16;
constexpr described::Count diagnosed_missions{1, 1000, "mission ids"};
constexpr double most_held_back = 0.9;

void read_effects(Fields& fields, ModelRequest& request, described::Nothing&) {
  const Json* given = fields.member("effect");
  if (given == nullptr) return;
  const Json ids = given->is_string() ? Json::array({*given}) : *given;
  const auto is_text = [](const Json& id) { return id.is_string(); };
  if (!ids.is_array() || ids.size() > most_effects || !std::ranges::all_of(ids, is_text)) {
    fields.fault("effect",
                 "must be the id of an effect, or an array of at most " + std::to_string(most_effects));
    return;
  }
  request.effects = ids.get<std::vector<std::string>>();
}

void check_model_request(Fields& fields, ModelRequest& r, described::Nothing&) {
  const int given =
      (r.model != nullptr) + r.diagnosis_id.has_value() + r.proposal_id.has_value() + r.version.has_value();
  if (fields.ok() && given != 1)
    fields.fault("model", "exactly one of model, diagnosis_id, proposal_id and version must be given, not " +
                              std::to_string(given));
  if (fields.ok() && !r.effects.empty() && !r.diagnosis_id)
    fields.fault("effect", "goes with diagnosis_id alone");
  if (fields.ok() && r.version && (r.force || r.dry_run || r.since_utime_us))
    fields.fault("version", "is put in force without a back-test: leave out force, dry_run and since");
}

const auto model_input =
    Input<ModelRequest>(
        "Source of a robot's new model: exactly one of model, diagnosis_id, proposal_id and version")
        .custom("model", described::of_reference("robot"), "the model to adopt, as a robot file",
                [](Fields& fields, ModelRequest& request, described::Nothing&) {
                  request.model = fields.member("model");
                })
        .integer("diagnosis_id", &ModelRequest::diagnosis_id, 1, greatest_id,
                 "adopt the result of this diagnosis")
        .custom("effect",
                {{"type", {"string", "array", "null"}},
                 {"items", {{"type", "string"}}},
                 {"maxItems", most_effects}},
                "with diagnosis_id: the effect to adopt among those that the diagnosis does not "
                "distinguish; one for each such group",
                read_effects)
        .integer("proposal_id", &ModelRequest::proposal_id, 1, greatest_id, "adopt this proposal")
        .integer("version", &ModelRequest::version, 1, greatest_id,
                 "stored version to put in force again, without a back-test")
        .time("since", &ModelRequest::since_utime_us,
              "start of the missions of the back-test; default: the first one used for the fit")
        .integer("expected_version", &ModelRequest::expected_version, 1, greatest_id,
                 "reject the request if another version is in force")
        .text("note", &ModelRequest::note, longest_note, "note for the list of versions")
        .boolean("force", &ModelRequest::force,
                 "adopt also if the diagnosis contains a reason against it or the back-test shows no "
                 "improvement",
                 false)
        .boolean("dry_run", &ModelRequest::dry_run, "run the back-test without adopting", false)
        .check(check_model_request);

void read_missions(Fields& fields, DiagnosisRequest& wanted, described::Nothing&) {
  const Json* missions = described::read_array(fields, "missions", diagnosed_missions, Presence::optional);
  for (std::size_t k = 0; missions != nullptr && fields.ok() && k < missions->size(); ++k) {
    if (!(*missions)[k].is_number_integer() || (*missions)[k] < 1) {
      fields.fault("missions/" + std::to_string(k), "must be a positive integer, the id of a mission");
    } else {
      wanted.missions.push_back((*missions)[k].get<std::int64_t>());
    }
  }
}

const auto diagnosis_input =
    Input<DiagnosisRequest>("A diagnosis to start")
        .text("robot_id", &DiagnosisRequest::robot_id, 64, "the robot to diagnose")
        .custom("missions",
                described::of_array({{"type", "integer"}, {"minimum", 1}},
                                    described::of_count(diagnosed_missions)),
                "ids of the missions to diagnose; default: the newest ones", read_missions)
        .time("since", &DiagnosisRequest::since_utime_us,
              "only missions that started from then on; default: from the last drift of the gap on")
        .integer("max_missions", &DiagnosisRequest::max_missions, 1,
                 static_cast<std::int64_t>(diagnosed_missions.maximum),
                 "largest number of missions, newest first",
                 static_cast<std::int64_t>(DiagnosisRequest{}.max_missions))
        .number("hold_back", &DiagnosisRequest::hold_back, {0, most_held_back},
                "share of the missions held back for a back-test", DiagnosisRequest{}.hold_back);

}  // namespace

described::Schemas request_schemas() {
  return {{"model-request", model_input.schema()}, {"diagnosis-request", diagnosis_input.schema()}};
}

Result<ModelRequest> read_model_request(const Json& body) {
  return model_input.read(body);
}

Result<DiagnosisRequest> read_diagnosis_request(const Json& body) {
  return diagnosis_input.read(body);
}

}  // namespace joulecast::api

#include <map>
#include <nlohmann/json.hpp>
#include <set>
#include <utility>

#include "base/json_writer.h"
#include "base/try.h"
#include "robot/robot_file.h"
#include "server/api/change.h"
#include "server/api/common_parameters.h"
#include "server/api/requests.h"
#include "server/api/services.h"
#include "server/diagnosis/model_adoption.h"
#include "server/http/problem.h"

// Adopting models, comparing their versions, and rolling back.
namespace joulecast::api {
namespace {

using Json = nlohmann::json;

// The reason why an open proposal is obsolete: the version that it changes is no longer in force.
std::optional<std::string> moot_of(const Services& services, const history::Proposal& p) {
  const auto now = services.models.find(p.robot_id);
  if (p.state != history::ProposalState::open || !p.base_version || now == nullptr ||
      now->version == *p.base_version)
    return std::nullopt;
  return "the proposal was made for version " + std::to_string(*p.base_version) + ", and version " +
         std::to_string(now->version) + " is in force";
}

// Why proposals were dismissed, as in the events about it.
std::map<std::int64_t, std::string> dismissals(const Services& services,
                                               const std::vector<history::Proposal>& proposals) {
  std::map<std::int64_t, std::string> reasons;
  std::set<std::string> robots;
  for (const history::Proposal& p : proposals)
    if (p.state == history::ProposalState::dismissed) robots.insert(p.robot_id);
  if (robots.empty()) return reasons;
  const auto events = services.store.events(
      0, history::max_page_size,
      {.robot_ids = {robots.begin(), robots.end()}, .kinds = {"proposal_dismissed"}, .newest_first = true});
  if (!events) return reasons;
  for (const history::Event& event : *events) {
    const Json detail = Json::parse(event.detail_json, nullptr, false);
    if (detail.is_object())
      reasons.emplace(detail.value("proposal_id", std::int64_t{0}), detail.value("reason", ""));
  }
  return reasons;
}

// The reason why a proposal is not offered; absent for one that is.
std::optional<std::string> closed_reason(const Services& services, const history::Proposal& p,
                                         const std::map<std::int64_t, std::string>& dismissed) {
  switch (p.state) {
    case history::ProposalState::adopted:
      return "adopted" + (p.adopted_version ? " as version " + std::to_string(*p.adopted_version) : "");
    case history::ProposalState::dismissed:
      return "dismissed" + (dismissed.contains(p.id) ? ": " + dismissed.at(p.id) : " by a person");
    case history::ProposalState::superseded:
      return "a later proposal took its place";
    case history::ProposalState::open:
      break;
  }
  return moot_of(services, p);
}

Result<server::AdoptionRequest> adoption_of(const Services& services, const std::string& robot_id,
                                            const ModelRequest& r) {
  server::AdoptionRequest adoption;
  adoption.force = r.force;
  adoption.dry_run = r.dry_run;
  adoption.since_utime_us = r.since_utime_us;
  adoption.expected_version = r.expected_version;
  adoption.diagnosis_id = r.diagnosis_id;
  adoption.proposal_id = r.proposal_id;
  std::vector<history::MissionKey> fitted_on;
  Result<robot::RobotModel> model = invalid("/model", "is missing");
  if (r.model != nullptr) {
    model = robot::read_robot(*r.model);
    if (!model) model.error().field = "/model" + model.error().field;
    if (model && model->robot_id != robot_id)
      return invalid("/model/robot_id",
                     "is \"" + model->robot_id + "\", must equal the id in the path, \"" + robot_id + "\"");
    adoption.note = r.note.value_or("");
  } else if (r.diagnosis_id) {
    TRY_ASSIGN(history::DiagnosisRecord diagnosis, services.store.diagnosis(*r.diagnosis_id));
    if (diagnosis.robot_id != robot_id)
      return invalid("/diagnosis_id", "belongs to robot " + diagnosis.robot_id + ", not to " + robot_id);
    // A test does not require a model that can be adopted.
    TRY_ASSIGN(server::DiagnosedModel diagnosed,
               server::diagnosed_model(services.store, diagnosis, {r.effects, r.force || r.dry_run}));
    model = std::move(diagnosed.model);
    adoption.overridden = std::move(diagnosed.overridden);
    adoption.origin = history::ModelOrigin::diagnosis;
    adoption.note = r.note.value_or("diagnosis " + std::to_string(*r.diagnosis_id));
    fitted_on = std::move(diagnosis.fitted_on);
    // The effects found apply to the model that was diagnosed; another one may contain some of them already.
    if (!r.expected_version && !r.force) adoption.diagnosed_version = diagnosis.model_version;
  } else {
    TRY_ASSIGN(history::Proposal proposal, services.store.proposal(*r.proposal_id));
    if (proposal.state != history::ProposalState::open)
      return fail(Fault::conflict, "/proposal_id",
                  "the proposal is " + std::string(history::name(proposal.state)) + " already");
    adoption.origin = history::ModelOrigin::calibration;
    adoption.note = r.note.value_or(proposal.note);
    fitted_on = std::move(proposal.fitted_on);
    if (const auto moot = moot_of(services, proposal); moot && !r.force)
      return fail(Fault::conflict, "/proposal_id", *moot + "; set force to adopt it anyway");
    if (proposal.robot_id != robot_id)
      return invalid("/proposal_id", "belongs to robot " + proposal.robot_id + ", not to " + robot_id);
    if (proposal.model_json.empty()) return fail(Fault::conflict, "/proposal_id", "holds nothing to adopt");
    model = robot::parse_robot(proposal.model_json);
  }
  if (!model) return tl::unexpected(std::move(model.error()));
  if (auto effects = dynamics::active_effects(*model); !effects) {
    effects.error().field = "/model" + effects.error().field;
    return tl::unexpected(std::move(effects.error()));
  }
  adoption.model = std::move(*model);
  adoption.fitted_on = std::move(fitted_on);
  return adoption;
}

Response refused(const Request& request, const server::Adoption& adoption) {
  Response response = http::problem(409, "no-improvement",
                                    "Not adopted: " + adoption.refusal + ". To adopt it anyway, set force.",
                                    request.id, "/force", adoption.refusal);
  Json document = Json::parse(response.body);
  document["back_test"] = Json::parse(adoption.back_test_json);
  response.body = document.dump();
  return response;
}

struct AdoptionAnswer {
  std::string robot_id;
  bool adopted;
  std::int64_t version, previous;
  std::string back_test_json = {};
};

const auto adoption_table =
    Table<AdoptionAnswer>("Result of adopting a model")
        .value("robot_id", AT(robot_id), "the robot's id, as in its telemetry and its file")
        .value("adopted", AT(adopted), "false: the back-test showed no improvement, or no parameter changes")
        .value("model_version", AT(version), "in force now")
        .value(
            "previous_version",
            [](const AdoptionAnswer& a) { return a.previous > 0 ? std::optional(a.previous) : std::nullopt; },
            "version in force before; null: none")
        .json("back_test", AT(back_test_json), "errors of both models on past missions; null: no back-test",
              described::or_null(described::of_reference("back-test"), true));

Result<Response> roll(Services& services, const Request& request, const ModelRequest& r) {
  const std::string& id = request.param("id");
  if (r.expected_version) {
    const auto now = services.models.find(id);
    if (now == nullptr || now->version != *r.expected_version)
      return fail(Fault::conflict, "/expected_version",
                  "version " + std::to_string(now == nullptr ? 0 : now->version) + " is in force, not " +
                      std::to_string(*r.expected_version));
  }
  const auto answer = [id, version = *r.version](std::int64_t previous) {
    return http::json_response(adoption_table.text({id, true, version, previous}));
  };
  RequestChange change(services, request);
  Result<std::int64_t> previous =
      services.adoption.activate(id, *r.version, r.note.value_or(""), [&](std::int64_t before) {
        return change.answered_by([answer, before](std::int64_t) { return answer(before); });
      });
  if (!previous && previous.error().fault == Fault::not_found) previous.error().field = "/version";
  if (previous && *previous == *r.version) return answer(*previous);  // it was in force
  return change.result(previous);
}

Result<Response> post_model(Services& services, const Request& request) {
  const std::string& id = request.param("id");
  TRY(model_of(services, id));
  TRY_ASSIGN(const ModelRequest read, read_model_request(*request.json));
  if (read.version) return roll(services, request, read);
  TRY_ASSIGN(const server::AdoptionRequest wanted, adoption_of(services, id, read));
  const auto answer = [id](const server::Adoption& adoption, std::int64_t version) {
    return http::json_response(adoption_table.text(
        {id, adoption.adopted, version, adoption.previous_version, adoption.back_test_json}));
  };
  RequestChange change(services, request);
  const Result<server::Adoption> adoption = services.adoption.adopt(
      wanted, [&request] { return !request.stop.stop_requested(); },
      [&](const server::Adoption& about_to) {
        return change.answered_by(
            [answer, about_to](std::int64_t version) { return answer(about_to, version); });
      });
  if (adoption && !adoption->adopted && !read.dry_run) return refused(request, *adoption);
  if (adoption && !adoption->adopted) return answer(*adoption, adoption->version);
  return change.result(adoption.map(&server::Adoption::version));
}

// Both documents' differences by JSON pointer; numbers of equal value are equal.
void compare(const Json& from, const Json& to, const std::string& at, Json& changes) {
  if (from == to) return;
  if (from.is_object() && to.is_object()) {
    for (const auto& [name, value] : from.items())
      compare(value, to.contains(name) ? to[name] : Json(nullptr), at + "/" + name, changes);
    for (const auto& [name, value] : to.items())
      if (!from.contains(name)) compare(Json(nullptr), value, at + "/" + name, changes);
    return;
  }
  changes.push_back({{"path", at}, {"from", from}, {"to", to}});
}

struct Difference {
  std::string robot_id;
  std::int64_t from, to;
  std::string changes_json;
};

const Schema change_schema = described::of_object(
    {}, {},
    {{"path", described::with_words(described::of_type("string"), "JSON pointer into the robot file")},
     {"from", described::with_words(Schema::object(), "null: absent")},
     {"to", described::with_words(Schema::object(), "null: absent")}});
const auto difference_table =
    Table<Difference>("Differences between two versions of a robot's model")
        .value("robot_id", AT(robot_id), "the robot's id, as in its telemetry and its file")
        .value("from", AT(from), "the earlier version")
        .value("to", AT(to), "the later version")
        .json("changes", AT(changes_json), "differences, one entry per value",
              described::of_array(change_schema));

Result<Response> diff(const Services& services, const Request& request) {
  const std::string& id = request.param("id");
  TRY(model_of(services, id));
  const auto version_of = [&](std::optional<std::int64_t> version, const char* field) {
    return services.store.model(id, version).map_error([field](Error error) {
      error.field = field;
      return error;
    });
  };
  TRY_ASSIGN(const history::ModelVersion to, version_of(request.query_integer("to"), "to"));
  const std::optional<std::int64_t> before =
      request.query_value("from") ? request.query_integer("from") : to.parent_version;
  TRY_ASSIGN(const history::ModelVersion from, before ? version_of(before, "from") : to);
  Json changes = Json::array();
  compare(Json::parse(from.model_json), Json::parse(to.model_json), "", changes);
  return http::json_response(difference_table.text({id, from.version, to.version, changes.dump()}));
}

history::ProposalState state_of(const Services& services, const history::Proposal& p) {
  return moot_of(services, p) ? history::ProposalState::superseded : p.state;
}

struct ProposalAnswer {
  const Services& services;
  const history::Proposal& proposal;
  const std::map<std::int64_t, std::string>& dismissed;
};

const auto proposal_table =
    Table<ProposalAnswer>()
        .value("id", AT(proposal.id), "number of the proposal")
        .value("robot_id", AT(proposal.robot_id), "robot with the model to change")
        .time("created", AT(proposal.created_utime_us),
              "time of creation, microseconds since 1970 by the host's clock")
        .value("kind", AT(proposal.kind), "calibration: refined by the robot's own missions")
        .word(
            "state", [](const ProposalAnswer& a) { return history::name(state_of(a.services, a.proposal)); },
            history::names_of<history::ProposalState>,
            "superseded: a later one or another version took its place")
        .value(
            "closed_reason",
            [](const ProposalAnswer& a) { return closed_reason(a.services, a.proposal, a.dismissed); },
            "why it is not offered: closed, or made for another version; null for one that is offered")
        .value("note", AT(proposal.note), "summary of the change, in a sentence")
        .value("base_version", AT(proposal.base_version), "version of the model that it changes")
        .value("adopted_version", AT(proposal.adopted_version),
               "version that it became; null: it was not adopted")
        .integers("fitted_on", AT(proposal.fitted_on),
                  "missions used to fit it, and excluded from its back-test")
        .json("model", AT(proposal.model_json), "the proposed model, as a robot file",
              described::of_type("object"))
        .json("detail", AT(proposal.detail_json), "the parameters that it changes, and its back_test",
              described::of_type("object"));

Result<Response> proposals_of(const Services& services, const Request& request,
                              const std::optional<std::string>& id) {
  TRY_ASSIGN(const auto cursor, id_cursor(request));
  const std::int64_t limit = *request.query_integer("limit");
  TRY_ASSIGN(const auto found, services.store.proposals(id, cursor.value_or(history::whole_future), limit));
  const std::string next = next_id_cursor(found, limit, &history::Proposal::id);
  const auto dismissed = dismissals(services, found);
  const auto write = [&](JsonWriter& out, const history::Proposal& proposal) {
    proposal_table.write(out, {services, proposal, dismissed});
  };
  if (request.csv)
    return csv_response(
        request, "proposals",
        "id robot_id created created_utime_us kind state closed_reason note base_version adopted_version",
        found, write, next);
  return page_response("proposals", found, write, next, [&](JsonWriter& out) { out.field("robot_id", id); });
}

Result<Response> proposals(const Services& services, const Request& request) {
  const std::string& id = request.param("id");
  TRY(model_of(services, id));
  return proposals_of(services, request, id);
}

}  // namespace

Part model_part() {
  using Type = Parameter::Type;
  const Schema robot =
      described::with_words(described::of_type("string", true), "null in the list of the fleet");
  Part part;
  part.add(Method::post, "/v1/robots/{id}/models", "adoptModel", Role::operate,
           "Adopts a robot file, a diagnosis or a proposal as the next model version, after a back-test on "
           "missions that it was not fitted on; or puts an earlier version in force",
           {"model-adoption", adoption_table.schema()}, post_model,
           {.former_path = "/v1/robots/{id}/model",
            .request_schema = "model-request",
            .rounded = true,
            .error_statuses = {404, 409},
            .run = Run::write});
  part.add(Method::get, "/v1/robots/{id}/models/diff", "compareModels", Role::read,
           "Differences between two versions of a robot's model", {"model-diff", difference_table.schema()},
           diff,
           {.former_path = "/v1/robots/{id}/versions/diff",
            .parameters = {bounded(Type::integer, "from",
                                   "version before; default: the one that `to` was made from", 1),
                           bounded(Type::integer, "to", "version after; default: the one in force", 1)},
            .etag = true,
            .error_statuses = {404}});
  part.add(
      Method::get, "/v1/robots/{id}/proposals", "listProposals", Role::read,
      "Model proposals for a robot, newest first",
      {"proposal-list",
       described::of_page("Model proposals, newest first", "proposals", "the proposals, newest first",
                          proposal_table.of_member(), {{"robot_id", robot}})},
      proposals,
      {.parameters = {limit_parameter("proposals a page", 50, history::max_page_size), cursor_parameter()},
       .csv = true,
       .error_statuses = {404}});
  part.add(
      Method::get, "/v1/proposals", "listFleetProposals", Role::read,
      "Model proposals for the robots of the fleet, newest first", {"proposal-list"},
      [](const Services& services, const Request& request) {
        return proposals_of(services, request, std::nullopt);
      },
      {.parameters = {limit_parameter("proposals a page", 50, history::max_page_size), cursor_parameter()},
       .csv = true});
  return part;
}

}  // namespace joulecast::api

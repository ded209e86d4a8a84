#include <fmt/format.h>

#include <optional>
#include <string>
#include <vector>

#include "base/try.h"
#include "client/commands/print.h"
#include "client/commands/server_answer.h"
#include "client/commands/table.h"

// The commands proposals and adopt: model proposals, and the model to put in force.
namespace joulecast::client {
namespace {

struct AdoptOptions : ServerOptions {
  std::vector<Given> given;
  std::optional<std::int64_t> proposal, diagnosis, version;
  std::optional<std::string> model_file;
  std::vector<std::string> effects;
  bool force = false, dry_run = false;
};

void print_proposals(const Json& page) {
  print_rows(member_at(page, "proposals"),
             {{"id", "id", 0},
              {"robot", "robot_id"},
              time_column("created (UTC)", "created"),
              {"state", "state"},
              {"model", "base_version", 0},
              {"change", "note"}},
             "no proposal");
}

Result<Exit> list_proposals(ServerOptions& options) {
  const std::string path =
      options.robot_id.empty() ? "/v1/proposals" : robot_target(options.robot_id, "/proposals");
  return show(options.server, path, {{"id", "--robot-id"}}, options.json, print_proposals);
}

Result<Json> adoption_request(const AdoptOptions& options) {
  Json request = Json::object();
  if (options.proposal) request["proposal_id"] = *options.proposal;
  if (options.diagnosis) request["diagnosis_id"] = *options.diagnosis;
  if (options.version) request["version"] = *options.version;
  if (options.model_file) {
    TRY_ASSIGN(request["model"], read_json(*options.model_file));
  }
  if (!options.effects.empty()) request["effect"] = options.effects;
  for (const Given& note : options.given) request[note.member] = note.value;
  if (options.force) request["force"] = true;
  if (options.dry_run) request["dry_run"] = true;
  return request;
}

void print_model_adoption(const Json& a, bool dry_run) {
  if (const Json& test = a["back_test"]; test.is_object())
    fmt::print("back-test on {}: error {} % before, {} % after\n",
               count_of(test["missions"].size(), "mission"), number_of(test, "error_before", 2, 100),
               number_of(test, "error_after", 2, 100));
  if (a.value("adopted", false)) {
    fmt::print("{}: model version {} is in force (was {})\n", text_of(a["robot_id"]),
               text_of(a["model_version"]), text_of(a["previous_version"]));
  } else {
    fmt::print("{}: nothing changed, version {} stays in force{}\n", text_of(a["robot_id"]),
               text_of(a["model_version"]), dry_run ? " (dry run)" : "");
  }
}

Result<Exit> adopt_model(AdoptOptions& options) {
  TRY_ASSIGN(const auto request, adoption_request(options));
  const Renamed renamed{
      {"id", "--robot-id"},          {"/proposal_id", "--proposal"}, {"/diagnosis_id", "--diagnosis"},
      {"/version", "--version"},     {"/effect", "--effect"},        {"/note", "--note"},
      {"/model/robot_id", "--model"}};
  return show(
      options.server, robot_target(options.robot_id, "/models"), renamed, options.json,
      [&options](const Json& answer) { print_model_adoption(answer, options.dry_run); }, HttpMethod::post,
      request.dump());
}

}  // namespace

void add_proposals(CLI::App& program, Exit& exit) {
  using O = ServerOptions;
  add_command<O>(program, exit, "proposals",
                 "List models that the daemon proposes from missions, newest first", list_proposals,
                 {server_row<O>(), robot_row<O>("only proposals for this robot"), json_row<O>()},
                 "joulecast proposals --server http://127.0.0.1:8080");
}

void add_adopt(CLI::App& program, Exit& exit) {
  using O = AdoptOptions;
  add_command<O>(program, exit, "adopt",
                 "Put a model into force, after a back-test on missions that it was not fitted to",
                 adopt_model,
                 {server_row<O>(),
                  robot_row<O>("robot that gets the model", required),
                  {"--proposal", &O::proposal, "number of a proposal", positive(), alternative},
                  {"--diagnosis", &O::diagnosis, "number of a diagnosis, for the effects that it found",
                   positive(), alternative},
                  {"--version", &O::version, "number of an earlier version, without a back-test", positive(),
                   alternative},
                  {"--model", &O::model_file, "a robot file", file_of("json"), alternative},
                  {"--effect", &O::effects,
                   "with --diagnosis: which of several indistinguishable effects to adopt", named("EFFECT")},
                  {"--note", Text{"note"}, "reason, shown in the list of versions", named("WORDS")},
                  {"--force", &O::force, "adopt in spite of the back-test or the diagnosis"},
                  {"--dry-run", &O::dry_run, "run the back-test without adopting"},
                  json_row<O>()},
                 "joulecast adopt amr --server http://127.0.0.1:8080 --model amr.json --dry-run\n"
                 "joulecast adopt --server http://127.0.0.1:8080 --robot-id amr --version 1");
}

}  // namespace joulecast::client

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <cstdio>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <vector>

#include "base/json_text.h"
#include "client/commands/accepts.h"
#include "client/commands/server_answer.h"
#include "client/commands/table.h"
#include "client/files.h"

// The commands proposals and adopt: model proposals, and the model to put in force.
namespace joulecast::client {
namespace {

using Json = nlohmann::json;

struct AdoptOptions {
  std::string server;
  std::optional<std::string> robot_id;
  std::optional<std::int64_t> proposal, diagnosis, version;
  std::optional<std::string> model_file, note;
  std::vector<std::string> effects;
  bool force = false, dry_run = false, json = false;
};

void print_proposals(const Json& page) {
  fmt::print("{:>5} {:<20} {:<19} {:<11} {:>6}  {}\n", "id", "robot", "created (UTC)", "state", "model",
             "change");
  for (const Json& p : page["proposals"])
    fmt::print("{:>5} {:<20} {:<19} {:<11} {:>6}  {}\n", text_of(p["id"]), text_of(p["robot_id"]),
               to_second(p["created"]), text_of(p["state"]), text_of(p["base_version"]), text_of(p["note"]));
  if (page["proposals"].empty()) fmt::print("no proposal\n");
}

Exit list_proposals(const AdoptOptions& options) {
  const std::string path =
      options.robot_id ? "/v1/robots/" + percent_encoded(*options.robot_id) + "/proposals" : "/v1/proposals";
  return show(options.server, path, {{"id", "--robot-id"}}, options.json, print_proposals);
}

Result<Json> adoption_request(const AdoptOptions& options) {
  Json request = Json::object();
  if (options.proposal) request["proposal_id"] = *options.proposal;
  if (options.diagnosis) request["diagnosis_id"] = *options.diagnosis;
  if (options.version) request["version"] = *options.version;
  if (options.model_file) {
    const auto text = read_file(*options.model_file);
    if (!text) return tl::unexpected(text.error());
    auto model = parse_json(*text);
    if (!model) return invalid(*options.model_file, describe(model.error()));
    request["model"] = std::move(*model);
  }
  if (!options.effects.empty()) request["effect"] = options.effects;
  if (options.note) request["note"] = *options.note;
  if (options.force) request["force"] = true;
  if (options.dry_run) request["dry_run"] = true;
  return request;
}

std::string percent_of(const Json& test, const char* name) {
  return number_of(test, name, 2, 100) + " %";
}

void print_model_adoption(const Json& a, bool dry_run) {
  const Json& test = a["back_test"];
  if (test.is_object())
    fmt::print("back-test on {} missions: error {} before, {} after\n", test["missions"].size(),
               percent_of(test, "error_before"), percent_of(test, "error_after"));
  if (a.value("adopted", false)) {
    fmt::print("{}: model version {} is in force (was {})\n", text_of(a["robot_id"]),
               text_of(a["model_version"]), text_of(a["previous_version"]));
  } else {
    fmt::print("{}: nothing changed, version {} stays in force{}\n", text_of(a["robot_id"]),
               text_of(a["model_version"]), dry_run ? " (a test only)" : "");
  }
}

Exit adopt_model(const AdoptOptions& options) {
  const auto request = adoption_request(options);
  if (!request) return report(request.error());
  const Renamed renamed{
      {"id", "--robot-id"},          {"/proposal_id", "--proposal"}, {"/diagnosis_id", "--diagnosis"},
      {"/version", "--version"},     {"/effect", "--effect"},        {"/note", "--note"},
      {"/model/robot_id", "--model"}};
  const auto reply = ask(options.server, HttpMethod::post,
                         "/v1/robots/" + percent_encoded(options.robot_id.value_or("")) + "/model",
                         request->dump(), renamed);
  if (!reply) return report(reply.error());
  if (options.json) {
    print_answer(reply->body + '\n');
    return Exit::ok;
  }
  const auto answer = object_of(*reply, options.server);
  if (!answer) return report(answer.error());
  print_model_adoption(*answer, options.dry_run);
  return Exit::ok;
}

}  // namespace

void add_proposals(CLI::App& program, Exit& exit) {
  auto options = std::make_shared<AdoptOptions>();
  auto* command = program.add_subcommand("proposals", "List models that missions suggest, newest first");
  add_server(*command, options->server);
  command->add_option("--robot-id", options->robot_id, "only of this robot");
  command->add_flag("--json", options->json, "print the answer as the server sends it");
  command->callback([options, &exit] { exit = list_proposals(*options); });
}

void add_adopt(CLI::App& program, Exit& exit) {
  auto options = std::make_shared<AdoptOptions>();
  auto* command = program.add_subcommand(
      "adopt", "Put a model in force, after a back-test on missions that it was not made from");
  add_server(*command, options->server);
  command->add_option("--robot-id", options->robot_id, "robot that gets the model")->required();
  auto* what = command->add_option_group("what");
  what->add_option("--proposal", options->proposal, "a proposal, by its number")->check(positive());
  what->add_option("--diagnosis", options->diagnosis, "a diagnosis, by its number: the effects that it found")
      ->check(positive());
  what->add_option("--version", options->version, "a stored version again, without a back-test")
      ->check(positive());
  what->add_option("--model", options->model_file, "a robot file");
  what->require_option(1);
  command->add_option("--effect", options->effects,
                      "with --diagnosis: the one to adopt of effects that it does not distinguish");
  command->add_option("--note", options->note, "why, for the list of versions");
  command->add_flag("--force", options->force, "also against the back-test or the diagnosis");
  command->add_flag("--dry-run", options->dry_run, "test only");
  command->add_flag("--json", options->json, "print the answer as the server sends it");
  command->callback([options, &exit] { exit = adopt_model(*options); });
}

}  // namespace joulecast::client

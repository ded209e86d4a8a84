#include <fmt/format.h>

#include <chrono>
#include <nlohmann/json.hpp>
#include <utility>
#include <vector>

#include "base/json_number.h"
#include "base/try.h"
#include "client/commands/gap_output.h"
#include "client/commands/print.h"
#include "client/commands/server_answer.h"
#include "client/files.h"
#include "client/interrupt.h"
#include "client/progress.h"
#include "robot/robot_file.h"

namespace joulecast::client {
namespace {

constexpr std::chrono::milliseconds between_looks{250};

std::string diagnosis_target(const Json& job, const char* part = "") {
  return fmt::format("/v1/diagnoses/{}{}", job["id"].get<std::int64_t>(), part);
}

Result<Json> follow(const std::string& server, Json job) {
  InterruptGuard interrupt;
  Progress progress("diagnosing", "%", 100);
  const std::string target = diagnosis_target(job);
  while (job["state"] == "queued" || job["state"] == "running") {
    progress.reach(static_cast<std::uint64_t>(100 * number_or_nan(job["progress"])));
    if (interrupt.wait_until(std::chrono::steady_clock::now() + between_looks)) {
      if (const auto cancelled = ask(server, HttpMethod::del, target); !cancelled)
        return fail(Fault::conflict, "",
                    "interrupted; the diagnosis continues: " + describe(cancelled.error()));
      return fail(Fault::conflict, "", "interrupted; the diagnosis is cancelled");
    }
    TRY_ASSIGN(job, ask_object(server, target));
  }
  if (job["state"] != "done") {
    const std::string why = job["error"].is_string() ? job["error"].get<std::string>() : "";
    return fail(Fault::infeasible, "",
                fmt::format("the diagnosis {}: {}", job["state"].get<std::string>(), why));
  }
  return job;
}

void print_result(const Json& job) {
  fmt::print("diagnosis {} against model version {}, {} held back for the back-test\n",
             job["id"].get<std::int64_t>(), job["model_version"].get<std::int64_t>(),
             count_of(job["held_back"].size(), "mission"));
  print_diagnosis(job["result"]);
}

// Writes the diagnosed robot file with the effects found.
Result<void> write_model(const GapOptions& options, const Json& job) {
  TRY_ASSIGN(const gap::Offer offer, gap::offer_from_json(job["result"]));
  TRY_ASSIGN(const auto now, ask_object(options.server, robot_target(options.robot_id)));
  if (now["model_version"] != job["model_version"])
    return fail(Fault::conflict, "--apply", "another version of the model has come into force since");
  TRY_ASSIGN(const auto robot, robot::read_robot(now["model"]));
  return apply_offer(options, offer, robot);
}

// The result of the adoption; of a refused one, the problem with its back-test.
Result<Json> adopt_diagnosis(const GapOptions& options, const Json& job) {
  Json wanted = {{"diagnosis_id", job["id"]}, {"force", options.force}};
  if (!options.effect.empty()) wanted["effect"] = options.effect;
  TRY_ASSIGN(const auto address, parse_server_url(options.server));
  TRY_ASSIGN(const auto reply,
             http_request(address, HttpMethod::post, robot_target(options.robot_id, "/models"), wanted.dump(),
                          std::chrono::minutes(1)));
  if (!reply.ok() && reply.status != 409) return tl::unexpected(error_of(reply));
  return object_of(reply.body, options.server);
}

void print_adopted_version(const Json& adoption, const std::string& unit) {
  if (adoption.contains("back_test")) print_back_test(adoption["back_test"], unit);
  if (adoption.value("adopted", false))
    fmt::print("adopted as model version {}\n", adoption["model_version"].get<std::int64_t>());
}

Result<Exit> carry_out(const GapOptions& options) {
  const Json wanted = {{"robot_id", options.robot_id}, {"max_missions", options.max_missions}};
  TRY_ASSIGN(const auto begun, ask(options.server, HttpMethod::post, "/v1/diagnoses", wanted.dump()));
  TRY_ASSIGN(auto first, object_of(begun.body, options.server));
  TRY_ASSIGN(const auto job, follow(options.server, std::move(first)));
  if (!options.report.empty()) {
    TRY_ASSIGN(const auto page, ask(options.server, HttpMethod::get, diagnosis_target(job, "/report")));
    TRY(write_text_file(options.report, page.body, existing(options.force)));
  }
  if (!options.json) print_result(job);
  Json out = job["result"];
  out["diagnosis_id"] = job["id"];
  std::vector<Error> refusals;
  if (!options.apply.empty()) {
    if (const auto written = write_model(options, job); !written) refusals.push_back(written.error());
  }
  if (options.adopt) {
    TRY_ASSIGN(const auto adoption, adopt_diagnosis(options, job));
    out["adopted"] = adoption;
    if (!options.json) print_adopted_version(adoption, options.unit);
    if (!adoption.value("adopted", false))
      refusals.push_back({Fault::conflict, "--adopt", adoption.value("detail", "was refused")});
  }
  if (options.json) print_json(out);
  Exit exit = Exit::ok;
  for (const Error& refusal : refusals) exit = report(refusal);
  return exit;
}

}  // namespace

Result<Exit> gap_from_server(const GapOptions& options) {
  return carry_out(options).map_error([](Error error) {
    for (const auto& [field, flag] :
         {std::pair{"/robot_id", "--robot-id"}, {"/max_missions", "--max-missions"}, {"/effect", "--effect"}})
      if (error.field == field) error.field = flag;
    return error;
  });
}

}  // namespace joulecast::client

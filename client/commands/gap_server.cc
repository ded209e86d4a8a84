#include <fmt/format.h>

#include <chrono>
#include <cmath>
#include <cstdio>
#include <nlohmann/json.hpp>
#include <utility>
#include <vector>

#include "base/json_number.h"
#include "base/try.h"
#include "client/commands/gap_output.h"
#include "client/commands/gap_parts.h"
#include "client/files.h"
#include "client/http_client.h"
#include "client/interrupt.h"
#include "client/progress.h"
#include "robot/robot_file.h"

namespace joulecast::client {
namespace {

using std::chrono::milliseconds;

constexpr milliseconds poll_timeout{60'000};
constexpr milliseconds between_looks{250};

struct Daemon {
  ServerAddress address;

  Result<HttpReply> ask(HttpMethod method, const std::string& target, const Json& body = {}) const {
    auto reply =
        http_request(address, method, target, method == HttpMethod::get ? "" : body.dump(), poll_timeout);
    if (!reply) return reply;
    if (!reply->ok() && reply->status != 409) return tl::unexpected(error_of(*reply));
    return reply;
  }
  Result<Json> json_of(HttpMethod method, const std::string& target, const Json& body = {}) const {
    TRY_ASSIGN(const auto reply, ask(method, target, body));
    Json document = Json::parse(reply.body, nullptr, false);
    if (!document.is_object()) return fail(Fault::corrupt, target, "did not answer with a JSON object");
    return document;
  }
};

std::string diagnosis_target(const Json& job, const char* part = "") {
  return fmt::format("/v1/diagnoses/{}{}", job["id"].get<std::int64_t>(), part);
}

Result<Json> follow(const Daemon& daemon, Json job) {
  InterruptGuard interrupt;
  Progress progress("diagnosing", "%", 100);
  const std::string target = diagnosis_target(job);
  while (job["state"] == "queued" || job["state"] == "running") {
    progress.reach(static_cast<std::uint64_t>(100 * number_or_nan(job["progress"])));
    if (interrupt.wait_until(std::chrono::steady_clock::now() + between_looks)) {
      if (const auto cancelled = daemon.ask(HttpMethod::del, target); !cancelled)
        return fail(Fault::conflict, "",
                    "interrupted; the diagnosis goes on: " + describe(cancelled.error()));
      return fail(Fault::conflict, "", "interrupted; the diagnosis is cancelled");
    }
    auto now = daemon.json_of(HttpMethod::get, target);
    if (!now) return now;
    job = std::move(*now);
  }
  if (job["state"] != "done") {
    const std::string why = job["error"].is_string() ? job["error"].get<std::string>() : "";
    return fail(Fault::infeasible, "",
                fmt::format("the diagnosis {}: {}", job["state"].get<std::string>(), why));
  }
  return job;
}

void print_result(const Json& job) {
  fmt::print("diagnosis {} against model version {}, {} missions held back\n", job["id"].get<std::int64_t>(),
             job["model_version"].get<std::int64_t>(), job["held_back"].size());
  print_diagnosis(job["result"]);
}

// Writes the diagnosed robot file with the effects found.
Result<void> write_model(const Daemon& daemon, const GapOptions& options, const Json& job) {
  TRY_ASSIGN(const gap::Offer offer, gap::offer_from_json(job["result"]));
  TRY_ASSIGN(const auto now, daemon.json_of(HttpMethod::get, "/v1/robots/" + options.robot_id));
  if (now["model_version"] != job["model_version"])
    return fail(Fault::conflict, "--apply", "another version of the model came in force meanwhile");
  TRY_ASSIGN(const auto robot, robot::read_robot(now["model"]));
  return apply_offer(options, offer, robot);
}

// The result of the adoption; Fault::conflict if the daemon refuses it.
Result<Json> adopt_diagnosis(const Daemon& daemon, const GapOptions& options, const Json& job) {
  Json wanted = {{"diagnosis_id", job["id"]}, {"force", options.force}};
  if (!options.effect.empty()) wanted["effect"] = options.effect;
  return daemon.json_of(HttpMethod::post, "/v1/robots/" + options.robot_id + "/model", wanted);
}

void print_adopted_version(const Json& adoption, const std::string& unit) {
  if (adoption.contains("back_test")) print_back_test(adoption["back_test"], unit);
  if (adoption.value("adopted", false))
    fmt::print("adopted as model version {}\n", adoption["model_version"].get<std::int64_t>());
}

Result<Exit> carry_out(const GapOptions& options) {
  TRY_ASSIGN(const auto address, parse_server_url(options.server));
  const Daemon daemon{address};
  Json wanted = {{"robot_id", options.robot_id}, {"max_missions", options.max_missions}};
  TRY_ASSIGN(auto begun, daemon.json_of(HttpMethod::post, "/v1/diagnoses", wanted));
  TRY_ASSIGN(const auto job, follow(daemon, std::move(begun)));
  if (!options.report.empty()) {
    TRY_ASSIGN(const auto page, daemon.ask(HttpMethod::get, diagnosis_target(job, "/report")));
    TRY(write_page(options, page.body));
  }
  if (!options.json) print_result(job);
  Json out = job["result"];
  out["diagnosis_id"] = job["id"];
  std::vector<Error> refusals;
  if (!options.apply.empty()) {
    if (const auto written = write_model(daemon, options, job); !written) refusals.push_back(written.error());
  }
  if (options.adopt) {
    TRY_ASSIGN(const auto adoption, adopt_diagnosis(daemon, options, job));
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

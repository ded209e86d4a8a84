#include "client/commands/gap_server.h"

#include <fmt/format.h>

#include <chrono>
#include <cmath>
#include <cstdio>
#include <nlohmann/json.hpp>

#include "client/commands/gap_output.h"
#include "client/commands/table.h"
#include "client/files.h"
#include "client/http_client.h"
#include "client/interrupt.h"
#include "client/progress.h"

namespace joulecast::client {
namespace {

using nlohmann::json;
using std::chrono::milliseconds;

constexpr milliseconds patience{60'000};
constexpr milliseconds between_looks{250};

struct Daemon {
  ServerAddress address;

  Result<HttpReply> ask(HttpMethod method, const std::string& target, const json& body = {}) const {
    auto reply =
        http_request(address, method, target, method == HttpMethod::get ? "" : body.dump(), patience);
    if (!reply) return reply;
    if (!reply->ok() && reply->status != 409) return tl::unexpected(error_of(*reply));
    return reply;
  }
  Result<json> json_of(HttpMethod method, const std::string& target, const json& body = {}) const {
    const auto reply = ask(method, target, body);
    if (!reply) return tl::unexpected(reply.error());
    json document = json::parse(reply->body, nullptr, false);
    if (!document.is_object()) return fail(Fault::corrupt, target, "did not answer with a JSON object");
    return document;
  }
};

double number(const json& value) {
  return value.is_number() ? value.get<double>() : std::nan("");
}

Result<json> follow(const Daemon& daemon, json job) {
  InterruptGuard interrupt;
  Progress progress("diagnosing", "%", 100);
  const std::string target = fmt::format("/v1/diagnoses/{}", job["id"].get<std::int64_t>());
  while (job["state"] == "queued" || job["state"] == "running") {
    progress.reach(static_cast<std::uint64_t>(100 * number(job["progress"])));
    if (interrupt.wait_until(std::chrono::steady_clock::now() + between_looks)) {
      (void)daemon.ask(HttpMethod::del, target);
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

void print_result(const json& job) {
  fmt::print("diagnosis {} against model version {}, {} missions held back\n", job["id"].get<std::int64_t>(),
             job["model_version"].get<std::int64_t>(), job["held_back"].size());
  print_diagnosis(job["result"]);
}

void print_test(const json& test) {
  fmt::print("{:<24} {:>12} {:>14} {:>14}\n", "tested on mission", "measured J", "error before",
             "error after");
  for (const json& m : test["missions"])
    fmt::print("{:<24} {:>12.2f} {:>12.2f} % {:>12.2f} %\n", m["mission_id"].get<std::string>(),
               number(m["measured_j"]), 100 * number(m["before"]["relative"]),
               100 * number(m["after"]["relative"]));
  fmt::print("energy error {:.2f} % -> {:.2f} %, power gap {:.2f} % -> {:.2f} %\n",
             100 * number(test["error_before"]), 100 * number(test["error_after"]),
             100 * number(test["power_gap_before"]), 100 * number(test["power_gap_after"]));
}

Result<json> adopt(const Daemon& daemon, const GapServerOptions& options, const json& job) {
  return daemon.json_of(HttpMethod::post, "/v1/robots/" + options.robot_id + "/model",
                        {{"diagnosis_id", job["id"]}, {"force", options.force}});
}

Result<Exit> carry_out(const GapServerOptions& options) {
  const auto address = parse_server_url(options.server);
  if (!address) return tl::unexpected(address.error());
  const Daemon daemon{*address};
  auto begun = daemon.json_of(HttpMethod::post, "/v1/diagnoses",
                              {{"robot_id", options.robot_id}, {"max_missions", options.max_missions}});
  if (!begun) return tl::unexpected(begun.error());
  auto job = follow(daemon, std::move(*begun));
  if (!job) return tl::unexpected(job.error());
  if (!options.report.empty()) {
    const auto page =
        daemon.ask(HttpMethod::get, fmt::format("/v1/diagnoses/{}/report", (*job)["id"].get<std::int64_t>()));
    if (!page) return tl::unexpected(page.error());
    if (const auto written = write_file(options.report, page->body); !written)
      return tl::unexpected(written.error());
  }
  if (!options.apply.empty()) {
    if ((*job)["model"].is_null()) return fail(Fault::infeasible, "--apply", "nothing was found to adopt");
    if (const auto written = write_file(options.apply, (*job)["model"].dump(2) + '\n'); !written)
      return tl::unexpected(written.error());
  }
  json out = (*job)["result"];
  out["diagnosis_id"] = (*job)["id"];
  if (!options.json) print_result(*job);
  Exit exit = Exit::ok;
  if (options.adopt) {
    if ((*job)["model"].is_null()) return fail(Fault::infeasible, "--adopt", "nothing was found to adopt");
    const auto adoption = adopt(daemon, options, *job);
    if (!adoption) return tl::unexpected(adoption.error());
    out["adoption"] = *adoption;
    const bool adopted = adoption->value("adopted", false);
    if (!adopted) exit = report({Fault::infeasible, "--adopt", adoption->value("detail", "was refused")});
    if (!options.json) {
      if (adoption->contains("back_test")) print_test((*adoption)["back_test"]);
      if (adopted)
        fmt::print("adopted as model version {}\n", (*adoption)["model_version"].get<std::int64_t>());
    }
  }
  if (options.json) std::puts(out.dump(2).c_str());
  return exit;
}

}  // namespace

Exit gap_from_server(const GapServerOptions& options) {
  const Result<Exit> done = carry_out(options);
  if (done) return *done;
  Error error = done.error();
  if (error.field == "/robot_id") error.field = "--robot-id";
  if (error.field == "/max_missions") error.field = "--max-missions";
  return report(error);
}

}  // namespace joulecast::client

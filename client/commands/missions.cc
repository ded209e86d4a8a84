#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <array>
#include <cstdio>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "client/commands/accepts.h"
#include "client/commands/parse_time.h"
#include "client/commands/server_answer.h"
#include "client/commands/table.h"

namespace joulecast::client {
namespace {

using Json = nlohmann::json;

struct MissionsOptions {
  std::string server;
  // A query parameter of GET /v1/missions.
  struct Parameter {
    std::string flag, name;
    std::optional<std::string> value = std::nullopt;
  };
  std::vector<Parameter> query;
  bool json = false;
};

std::string state_of(const Json& mission) {
  if (!mission.value("annulled", Json()).is_null()) return "annulled";
  return text_of(mission["state"]) + (mission.value("incomplete", false) ? "*" : "");
}

std::string joules(const Json& energy, const char* name) {
  const auto found = energy.find(name);
  return found != energy.end() && found->is_number() ? fmt::format("{:.2f}", found->get<double>()) : "-";
}

void print_missions(const Json& page) {
  fmt::print("{:>6} {:<20} {:<28} {:<12} {:<19} {:>9} {:>9} {:>12} {:>12}\n", "id", "robot", "mission",
             "state", "start (UTC)", "time s", "driven m", "battery J", "modelled J");
  for (const Json& m : page["missions"]) {
    const Json& energy = m["energy"];
    fmt::print("{:>6} {:<20} {:<28} {:<12} {:<19} {:>9} {:>9} {:>12} {:>12}\n", text_of(m["id"]),
               text_of(m["robot_id"]), text_of(m["mission_id"]), state_of(m), to_second(m["start"]),
               joules(energy, "duration_s"), joules(energy, "distance_m"), joules(energy, "battery_j"),
               joules(energy, "modelled_j"));
  }
  if (page["missions"].empty()) fmt::print("no mission matches\n");
  if (const auto next = page.find("next_cursor"); next != page.end() && next->is_string())
    fmt::print("more: --cursor {}\n", next->get<std::string>());
}

Exit run_missions(const MissionsOptions& options) {
  Query query;
  Renamed renamed;
  for (const auto& [flag, name, value] : options.query) {
    renamed.emplace_back(name, flag);
    if (!value) continue;
    std::string sent = *value;
    if (name.ends_with("_utime_us")) {
      const auto utime_us = flag == "--to" ? parse_end_time(sent, flag) : parse_time(sent, flag);
      if (!utime_us) return report(utime_us.error());
      sent = std::to_string(*utime_us);
    }
    query.emplace_back(name, std::move(sent));
  }
  const auto reply = ask(options.server, HttpMethod::get, target_of("/v1/missions", query), {}, renamed);
  if (!reply) return report(reply.error());
  if (options.json) {
    print_answer(reply->body + '\n');
    return Exit::ok;
  }
  const Json page = Json::parse(reply->body, nullptr, false);
  if (!page.is_object() || !page.contains("missions"))
    return report({Fault::corrupt, options.server, "did not answer with missions"});
  print_missions(page);
  return Exit::ok;
}

}  // namespace

void add_missions(CLI::App& program, Exit& exit) {
  auto options = std::make_shared<MissionsOptions>();
  auto* command = program.add_subcommand("missions", "List missions with their energy, newest first");
  add_server(*command, options->server);
  constexpr std::array<std::array<const char*, 3>, 10> filters{{
      {"--robot-id", "robot_id", "only this robot's"},
      {"--mission-id", "mission_id", "only those with this mission id"},
      {"--state", "state", "only those in this state"},
      {"--incomplete", "incomplete", "true: only those with unmeasured parts; false: only those without"},
      {"--from", "from_utime_us",
       "started at or after: 2024-07-18, 2024-07-18T09:10:45Z or microseconds since 1970"},
      {"--to", "to_utime_us", "started before, the same; a day alone is in it"},
      {"--payload-min", "payload_min_kg", "kg"},
      {"--payload-max", "payload_max_kg", "kg"},
      {"--limit", "limit", "missions on the page"},
      {"--cursor", "cursor", "continue where an earlier page ended"},
  }};
  options->query.reserve(filters.size());
  for (const auto& [flag, name, help] : filters) {
    options->query.push_back({flag, name});
    command->add_option(flag, options->query.back().value, help);
  }
  command->get_option("--state")->check(
      one_of({"open", "finished", "aborted", "unfinished", "superseded", "interrupted"}));
  command->get_option("--incomplete")->check(one_of({"true", "false"}));
  command->add_flag("--json", options->json, "print the page as the server sends it");
  command->callback([options, &exit] { exit = run_missions(*options); });
}

}  // namespace joulecast::client

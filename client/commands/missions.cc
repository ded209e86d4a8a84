#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <chrono>
#include <cstdio>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "client/commands/parse_time.h"
#include "client/commands/table.h"
#include "client/http_client.h"

namespace joulecast::client {
namespace {

using nlohmann::json;

struct Options {
  std::string server;
  // A query parameter of GET /v1/missions.
  struct Parameter {
    std::string flag, name;
    std::optional<std::string> value = std::nullopt;
  };
  std::vector<Parameter> query;
  bool json = false;
};

std::string percent_encoded(const std::string& text) {
  std::string out;
  for (const char c : text) {
    const auto byte = static_cast<unsigned char>(c);
    const bool plain = (c >= '0' && c <= '9') || (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') ||
                       std::string_view("-._~").find(c) != std::string_view::npos;
    plain ? out.push_back(c) : static_cast<void>(out += fmt::format("%{:02X}", byte));
  }
  return out;
}

std::string text_of(const json& value) {
  return value.is_string() ? value.get<std::string>() : value.is_null() ? "-" : value.dump();
}

// "2026-11-22T16:45:00.25Z" -> "2026-11-22 16:45:00"
std::string to_second(const json& time) {
  if (!time.is_string()) return "-";
  std::string text = time.get<std::string>().substr(0, std::string_view("2026-11-22T16:45:00").size());
  std::ranges::replace(text, 'T', ' ');
  return text;
}

std::string joules(const json& energy, const char* name) {
  const auto found = energy.find(name);
  return found != energy.end() && found->is_number() ? fmt::format("{:.2f}", found->get<double>()) : "-";
}

void print_table(const json& page) {
  fmt::print("{:>6} {:<20} {:<28} {:<12} {:<19} {:>9} {:>9} {:>12} {:>12}\n", "id", "robot", "mission",
             "state", "start (UTC)", "time s", "way m", "battery J", "modelled J");
  for (const json& m : page["missions"]) {
    const json& energy = m["energy"];
    fmt::print("{:>6} {:<20} {:<28} {:<12} {:<19} {:>9} {:>9} {:>12} {:>12}\n", text_of(m["id"]),
               text_of(m["robot_id"]), text_of(m["mission_id"]),
               text_of(m["state"]) + (m.value("incomplete", false) ? "*" : ""), to_second(m["start"]),
               joules(energy, "duration_s"), joules(energy, "distance_m"), joules(energy, "battery_j"),
               joules(energy, "modelled_j"));
  }
  if (page["missions"].empty()) fmt::print("no mission matches\n");
  if (const auto next = page.find("next_cursor"); next != page.end() && next->is_string())
    fmt::print("more: --cursor {}\n", next->get<std::string>());
}

Exit run(const Options& options) {
  const auto server = parse_server_url(options.server);
  if (!server) return report(server.error());
  std::string target = "/v1/missions";
  for (const auto& [flag, name, value] : options.query) {
    if (!value) continue;
    std::string sent = *value;
    if (name.ends_with("_utime_us")) {
      const auto utime_us = parse_time(sent, flag);
      if (!utime_us) return report(utime_us.error());
      sent = std::to_string(*utime_us);
    }
    target += (target.find('?') == std::string::npos ? '?' : '&') + name + '=' + percent_encoded(sent);
  }
  const auto reply = http_request(*server, HttpMethod::get, target, {}, std::chrono::seconds(30));
  if (!reply) return report(reply.error());
  if (!reply->ok()) {
    Error error = error_of(*reply);
    const auto by_name = std::ranges::find(options.query, error.field, &Options::Parameter::name);
    if (by_name != options.query.end()) error.field = by_name->flag;
    return report(error);
  }
  if (options.json) {
    std::puts(reply->body.c_str());
    return Exit::ok;
  }
  const json page = json::parse(reply->body, nullptr, false);
  if (!page.is_object() || !page.contains("missions"))
    return report({Fault::corrupt, options.server, "did not answer with missions"});
  print_table(page);
  return Exit::ok;
}

}  // namespace

void add_missions(CLI::App& program, Exit& exit) {
  auto options = std::make_shared<Options>();
  auto* command = program.add_subcommand("missions", "List missions with their energy, newest first");
  command->add_option("--server", options->server, "joulecastd to ask, host:port")->required();
  constexpr std::array<std::array<const char*, 3>, 10> filters{{
      {"--robot-id", "robot_id", "only this robot's"},
      {"--mission-id", "mission_id", "only those with this mission id"},
      {"--state", "state", "only those in this state"},
      {"--incomplete", "incomplete", "true: only those with unmeasured parts; false: only those without"},
      {"--from", "from_utime_us",
       "started at or after: 2024-07-18, 2024-07-18T09:10:45Z or microseconds since 1970"},
      {"--to", "to_utime_us", "started before, the same"},
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
      CLI::IsMember({"open", "finished", "aborted", "unfinished", "superseded", "interrupted"}));
  command->get_option("--incomplete")->check(CLI::IsMember({"true", "false"}));
  command->add_flag("--json", options->json, "print the page as the server sends it");
  command->callback([options, &exit] { exit = run(*options); });
}

}  // namespace joulecast::client

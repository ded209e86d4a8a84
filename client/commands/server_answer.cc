#include "client/commands/server_answer.h"

#include <fmt/format.h>
#include <unistd.h>

#include <algorithm>
#include <cctype>
#include <cstdio>
#include <cstdlib>

#include "base/json_text.h"
#include "base/text.h"
#include "base/try.h"
#include "client/files.h"

namespace joulecast::client {
namespace {

std::string environment(const char* name) {
  const char* value = std::getenv(name);
  return value != nullptr ? value : "";
}

}  // namespace

std::string target_of(std::string_view path, const Query& query) {
  std::string target(path);
  for (const auto& [name, value] : query)
    target += (target.find('?') == std::string::npos ? '?' : '&') + name + '=' + percent_encoded(value);
  return target;
}

std::string robot_target(const std::string& robot_id, const std::string& part) {
  return "/v1/robots/" + percent_encoded(robot_id) + part;
}

std::string fault_text(const Json& state, const std::string& reason) {
  const Json& notes = state["fault_notes"];
  const auto note = notes.find(reason);
  return state["faults"][reason].dump() + ' ' + reason + (note == notes.end() ? "" : ": " + text_of(*note));
}

Query query_of(const std::vector<Given>& given) {
  Query query;
  for (const Given& each : given) query.emplace_back(each.member, text_of(each.value));
  return query;
}

Renamed renamed_by(const std::vector<Given>& given) {
  Renamed renamed;
  for (const Given& each : given) renamed.emplace_back(each.member, each.flag);
  return renamed;
}

Result<HttpReply> ask(const std::string& server, HttpMethod method, const std::string& target,
                      const std::string& body, const Renamed& renamed, const std::string& accept,
                      std::chrono::milliseconds timeout) {
  auto reply = http_request(server, method, target, body, timeout, accept);
  if (!reply || reply->ok()) return reply;
  Error error = error_of(*reply);
  if (reply->status == 404 && (error.field.empty() || error.field == "path"))
    return fail(Fault::not_found, "--server",
                server + " is no joulecastd, or one of another version (the server answered 404)");
  const auto by_name = std::ranges::find(renamed, error.field, &Renamed::value_type::first);
  if (by_name != renamed.end()) error.field = by_name->second;
  // Messages contain names of times too.
  for (const auto& [name, flag] : renamed)
    if (const auto at = error.message.find(name); name.ends_with("_utime_us") && at != std::string::npos)
      error.message.replace(at, name.size(), flag);
  return tl::unexpected(std::move(error));
}

Result<Json> object_of(std::string_view text, const std::string& server) {
  Json answer = Json::parse(text, nullptr, false);
  if (!answer.is_object()) return fail(Fault::corrupt, server, "did not answer with a JSON object");
  return answer;
}

Result<Json> ask_object(const std::string& server, const std::string& target, const Renamed& renamed) {
  TRY_ASSIGN(const auto reply, ask(server, HttpMethod::get, target, {}, renamed));
  return object_of(reply.body, server);
}

Result<Json> read_json(const std::string& path) {
  TRY_ASSIGN(const auto text, read_file(path));
  return parse_json(text).map_error([&](const Error& error) {
    return Error{Fault::invalid, path, describe(error)};
  });
}

Result<std::string> mission_number(const std::string& server, const std::string& mission) {
  if (std::ranges::all_of(mission, [](unsigned char c) { return std::isdigit(c) != 0; })) return mission;
  const std::string target = target_of("/v1/missions", {{"mission_id", mission}, {"limit", "2"}});
  TRY_ASSIGN(const auto page, ask_object(server, target, {{"mission_id", "mission"}}));
  const Json& found = member_at(page, "missions");
  if (found.empty()) return fail(Fault::not_found, "mission", "no mission has the id " + mission);
  if (found.size() > 1)
    return fail(Fault::conflict, "mission",
                fmt::format("{} and {} have the id {}: give the number of one", text_of(found[0]["id"]),
                            text_of(found[1]["id"]), mission));
  return text_of(found[0]["id"]);
}

std::string without_controls(std::string_view text) {
  std::string shown;
  for (std::size_t at = 0; at < text.size(); ++at) {
    auto code = static_cast<unsigned char>(text[at]);
    const auto next = static_cast<unsigned char>(at + 1 < text.size() ? text[at + 1] : 0);
    const bool upper = code == 0xC2 && next >= 0x80 && next < 0xA0;  // U+0080 to U+009F in UTF-8
    if (upper) code = next, ++at;
    const bool line_end = code == '\n' || (code == '\r' && next == '\n');
    const bool control = upper || code == 0x7F || (code < 0x20 && code != '\t' && !line_end);
    shown += control ? fmt::format("\\u{:04x}", code) : std::string(1, text[at]);
  }
  return shown;
}

void print_answer(std::string_view text) {
  const std::string shown = isatty(STDOUT_FILENO) == 1 ? without_controls(text) : std::string(text);
  std::fwrite(shown.data(), 1, shown.size(), stdout);
}

Result<Exit> show(const std::string& server, const std::string& target, const Renamed& renamed, bool as_json,
                  const std::function<void(const Json&)>& print, HttpMethod method, const std::string& body) {
  TRY_ASSIGN(const auto reply, ask(server, method, target, body, renamed));
  if (as_json) {
    print_answer(reply.body + '\n');
    return Exit::ok;
  }
  TRY_ASSIGN(const auto answer, object_of(reply.body, server));
  print(answer);
  return Exit::ok;
}

Result<HttpReply> http_request(const std::string& server, HttpMethod method, std::string_view target,
                               std::string json_body, std::chrono::milliseconds timeout,
                               const std::string& accept) {
  TRY_ASSIGN(const auto address, http_client::parse_url(server, "--server"));
  http_client::HttpRequest request{method, std::string(target), std::move(json_body), {{"Accept", accept}}};
  if (const std::string token = environment("JOULECAST_TOKEN"); !token.empty())
    request.headers.emplace_back("Authorization", "Bearer " + token);
  request.certificate = {environment("JOULECAST_CLIENT_CERTIFICATE"), environment("JOULECAST_CLIENT_KEY")};
  return http_client::exchange(address, request, timeout);
}

Error error_of(const HttpReply& reply) {
  Fault fault = Fault::unavailable;
  if (reply.status == 404) {
    fault = Fault::not_found;
  } else if (reply.status == 409 || reply.status == 412) {
    fault = Fault::conflict;
  } else if (reply.status == 413) {
    fault = Fault::too_large;
  } else if (reply.status >= 400 && reply.status < 500 && reply.status != 429) {
    fault = Fault::invalid;
  }
  const std::string answered = "the server answered " + std::to_string(reply.status);
  const auto problem = nlohmann::json::parse(reply.body, nullptr, false);
  const auto text = [&problem](const char* key) {
    if (!problem.is_object()) return std::string();
    const auto at = problem.find(key);
    return at != problem.end() && at->is_string() ? at->get<std::string>() : std::string();
  };
  if (text("type") == "urn:joulecast:problem:infeasible") fault = Fault::infeasible;
  // An error of one field has the form of an error detected by the client.
  if (const std::string field = text("field"), constraint = text("constraint");
      !field.empty() && !constraint.empty())
    return {fault, field, constraint + " (" + answered + ")"};
  std::string message = answered;
  for (const char* key : {"title", "detail"})
    if (const std::string said = text(key); !said.empty()) message += ": " + said;
  return {fault, {}, message};
}

}  // namespace joulecast::client

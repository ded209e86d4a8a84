#include "client/commands/server_answer.h"

#include <fmt/format.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <chrono>
#include <cstdio>
#include <nlohmann/json.hpp>

namespace joulecast::client {
namespace {

using Json = nlohmann::json;
constexpr std::chrono::seconds timeout{60};

}  // namespace

void add_server(CLI::App& command, std::string& server) {
  command.add_option("--server", server, "joulecastd to send the request to, host:port")
      ->envname("JOULECAST_SERVER")
      ->required();
}

std::string percent_encoded(std::string_view text) {
  std::string out;
  for (const char c : text) {
    const auto byte = static_cast<unsigned char>(c);
    const bool plain = (c >= '0' && c <= '9') || (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') ||
                       std::string_view("-._~").find(c) != std::string_view::npos;
    plain ? out.push_back(c) : static_cast<void>(out += fmt::format("%{:02X}", byte));
  }
  return out;
}

std::string target_of(std::string_view path, const Query& query) {
  std::string target(path);
  for (const auto& [name, value] : query)
    if (value)
      target += (target.find('?') == std::string::npos ? '?' : '&') + name + '=' + percent_encoded(*value);
  return target;
}

Result<HttpReply> ask(const std::string& server, HttpMethod method, const std::string& target,
                      std::string body, const Renamed& renamed, const std::string& accept) {
  const auto address = parse_server_url(server);
  if (!address) return tl::unexpected(address.error());
  auto reply = http_request(*address, method, target, std::move(body), timeout, accept);
  if (!reply || reply->ok()) return reply;
  Error error = error_of(*reply);
  const auto by_name = std::ranges::find(renamed, error.field, &Renamed::value_type::first);
  if (by_name != renamed.end()) error.field = by_name->second;
  // Messages contain names of times too.
  for (const auto& [name, flag] : renamed)
    if (const auto at = error.message.find(name); name.ends_with("_utime_us") && at != std::string::npos)
      error.message.replace(at, name.size(), flag);
  return tl::unexpected(std::move(error));
}

Result<Json> object_of(const HttpReply& reply, const std::string& server) {
  Json answer = Json::parse(reply.body, nullptr, false);
  if (!answer.is_object()) return fail(Fault::corrupt, server, "did not answer with a JSON object");
  return answer;
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

Exit show(const std::string& server, const std::string& target, const Renamed& renamed, bool as_json,
          void (*print)(const Json&)) {
  const auto reply = ask(server, HttpMethod::get, target, {}, renamed);
  if (!reply) return report(reply.error());
  if (as_json) {
    print_answer(reply->body + '\n');
    return Exit::ok;
  }
  const auto answer = object_of(*reply, server);
  if (!answer) return report(answer.error());
  print(*answer);
  return Exit::ok;
}

std::string text_of(const Json& value) {
  return value.is_string() ? value.get<std::string>() : value.is_null() ? "-" : value.dump();
}

std::string number_of(const Json& object, const char* name, int decimals, double scale) {
  if (!object.is_object()) return "-";
  const auto found = object.find(name);
  if (found == object.end() || !found->is_number()) return "-";
  return fmt::format("{:.{}f}", scale * found->get<double>(), decimals);
}

std::string to_second(const Json& time) {
  if (!time.is_string()) return "-";
  std::string text = time.get<std::string>().substr(0, std::string_view("2026-11-22T16:45:00").size());
  std::ranges::replace(text, 'T', ' ');
  return text;
}

}  // namespace joulecast::client

#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <nlohmann/json.hpp>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "base/error.h"
#include "client/commands/option.h"
#include "client/commands/print.h"
#include "http_client/http_client.h"

// Functions shared by the commands that read from a daemon.
namespace joulecast::client {

using http_client::HttpMethod;
using http_client::HttpReply;

inline constexpr const char* accept_json = "application/json, application/problem+json, text/html;q=0.5";

// http_client::exchange() with the `server` of --server. The environment gives the token (JOULECAST_TOKEN)
// and the PEM files of a client certificate (JOULECAST_CLIENT_CERTIFICATE) and its key
// (JOULECAST_CLIENT_KEY).
[[nodiscard]] Result<HttpReply> http_request(const std::string& server, HttpMethod method,
                                             std::string_view target, std::string json_body,
                                             std::chrono::milliseconds timeout,
                                             const std::string& accept = accept_json);

// The error of a reply other than 2xx: title and detail of its problem+json, and the fault of its status.
[[nodiscard]] Error error_of(const HttpReply& reply);

// Options that most commands of a daemon share; not every command has a row for each.
struct ServerOptions {
  std::string server, robot_id, unit = energy_units.front();
  bool json = false;
};

// Rows of the tables of options; the Options have members of these names.
inline constexpr const char* server_help = "joulecastd to send the request to, host:port";
inline constexpr const char* mission_help = "number or id of the mission, as joulecast missions lists it";
template <class Options>
Row<Options> server_row() {
  return {"--server", &Options::server, server_help, Value{.name = "URL", .variable = "JOULECAST_SERVER"},
          required};
}
template <class Options, class... Traits>
Row<Options> robot_row(const char* help, const Traits&... traits) {
  return {"robot,--robot-id", &Options::robot_id, help, named("ROBOT"), traits...};
}
template <class Options>
Row<Options> json_row(const char* help = "print the answer as the server sends it") {
  return {"--json", &Options::json, help};
}
template <class Options>
Row<Options> unit_row() {
  return {"--unit", &Options::unit, "unit of the printed energies; JSON contains joules",
          one_of(energy_units)};
}

// "3 bad_event: mission b ends, ...", of one of the faults of a robot's state.
[[nodiscard]] std::string fault_text(const Json& state, const std::string& reason);

// Keys and values of a query.
using Query = std::vector<std::pair<std::string, std::string>>;

// "/v1/missions" -> "/v1/missions?robot_id=amr", percent-encoded.
[[nodiscard]] std::string target_of(std::string_view path, const Query& query);
// "/v1/robots/amr/state"
[[nodiscard]] std::string robot_target(const std::string& robot_id, const std::string& part = {});

// Fields of an error and the options to name instead.
using Renamed = std::vector<std::pair<std::string, std::string>>;

// A member of a request, or a parameter of a query, that an option gave.
struct Given {
  std::string flag, member;
  Json value;
};
[[nodiscard]] Query query_of(const std::vector<Given>& given);
[[nodiscard]] Renamed renamed_by(const std::vector<Given>& given);

[[nodiscard]] inline std::chrono::milliseconds milliseconds_of(double seconds) {
  return std::chrono::milliseconds(static_cast<std::int64_t>(1e3 * seconds));
}

// A reply with 2xx; the problem of any other, in which `renamed` fields are called by their flags.
[[nodiscard]] Result<HttpReply> ask(const std::string& server, HttpMethod method, const std::string& target,
                                    const std::string& body = {}, const Renamed& renamed = {},
                                    const std::string& accept = accept_json,
                                    std::chrono::milliseconds timeout = std::chrono::seconds(60));
// The same with a JSON object as its body; Fault::corrupt when it is none.
[[nodiscard]] Result<Json> object_of(std::string_view text, const std::string& server);
[[nodiscard]] Result<Json> ask_object(const std::string& server, const std::string& target,
                                      const Renamed& renamed = {});

// A JSON file, or standard input for "-". Errors name the file.
[[nodiscard]] Result<Json> read_json(const std::string& path);

// The number of a mission that is given by its number or by its id, if only one has that id.
[[nodiscard]] Result<std::string> mission_number(const std::string& server, const std::string& mission);

// Without control characters that a terminal would carry out, which become \\u001b and the like.
[[nodiscard]] std::string without_controls(std::string_view text);
// Prints a daemon's text to standard output, to a terminal without_controls().
void print_answer(std::string_view text);

// Requests `target` and prints the returned object: as received if `as_json`, else by `print`.
[[nodiscard]] Result<Exit> show(const std::string& server, const std::string& target, const Renamed& renamed,
                                bool as_json, const std::function<void(const Json&)>& print,
                                HttpMethod method = HttpMethod::get, const std::string& body = {});

}  // namespace joulecast::client

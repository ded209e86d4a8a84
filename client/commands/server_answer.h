#pragma once

#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "base/error.h"
#include "client/commands/outcome.h"
#include "client/http_client.h"

namespace CLI {
class App;
}

// Functions shared by the commands that read from a daemon.
namespace joulecast::client {

// --server, required.
void add_server(CLI::App& command, std::string& server);

// Keys and values of a query; those without a value are left out.
using Query = std::vector<std::pair<std::string, std::optional<std::string>>>;

// "/v1/missions" -> "/v1/missions?robot_id=amr", percent-encoded.
[[nodiscard]] std::string target_of(std::string_view path, const Query& query);
[[nodiscard]] std::string percent_encoded(std::string_view text);

// A reply with 2xx; the problem of any other, in which `renamed` fields are called by their flags.
using Renamed = std::vector<std::pair<std::string, std::string>>;
[[nodiscard]] Result<HttpReply> ask(const std::string& server, HttpMethod method, const std::string& target,
                                    std::string body = {}, const Renamed& renamed = {},
                                    const std::string& accept = accept_json);
// The same with a JSON object as its body; Fault::corrupt when it is none.
[[nodiscard]] Result<nlohmann::json> object_of(const HttpReply& reply, const std::string& server);

// Without control characters that a terminal would carry out, which become \\u001b and the like.
[[nodiscard]] std::string without_controls(std::string_view text);
// Prints a daemon's text to standard output, to a terminal without_controls().
void print_answer(std::string_view text);

// Requests `target` by GET and prints the returned object: as received if `as_json`, else by `print`.
Exit show(const std::string& server, const std::string& target, const Renamed& renamed, bool as_json,
          void (*print)(const nlohmann::json&));

// "-" for null.
[[nodiscard]] std::string text_of(const nlohmann::json& value);
// The number with `decimals` decimals; "-" if it is not a number.
[[nodiscard]] std::string number_of(const nlohmann::json& object, const char* name, int decimals,
                                    double scale = 1);
// "2026-11-22T16:45:00.25Z" -> "2026-11-22 16:45:00"; "-" for null.
[[nodiscard]] std::string to_second(const nlohmann::json& time);

// The change of the sum by a term of a ledger: recovered energy is stated positive and subtracted.
inline double effect_on_sum(std::string_view term, double joules) {
  return term == "recovered" ? -joules : joules;
}

}  // namespace joulecast::client

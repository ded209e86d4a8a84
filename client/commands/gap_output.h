#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

#include "client/commands/listen.h"
#include "client/commands/outcome.h"
#include "report/report.h"

namespace joulecast::client {

// Prints the JSON of a diagnosis of recordings, made offline or by a daemon.
void print_diagnosis(const nlohmann::json& diagnosis);

// `error` of an adoption as an error of `option`, which requested it; of --effect for a choice among effects.
Error of_option(Error error, const std::string& option);

// The origin of a report: names of files without their folders, and the present time.
report::ReportOrigin report_origin(const std::vector<std::string>& sources, const std::string& robot_file);

// {"channels": [{"channel", "robot_id", "messages", "rate_hz", ..., "fields": [...], "faults": {...}}]};
// numbers that are not available are null.
[[nodiscard]] nlohmann::json to_json(const telemetry::ChannelWatch& watch);
// The same with {"dropped_datagrams": {...}}.
[[nodiscard]] nlohmann::json to_json(const Listened& listened);

}  // namespace joulecast::client

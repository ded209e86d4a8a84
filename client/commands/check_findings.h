#pragma once

#include <cstddef>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <vector>

#include "client/commands/outcome.h"
#include "gap/checks/check.h"
#include "robot/robot_model.h"
#include "telemetry/channel_watch.h"
#include "telemetry/csv_import.h"
#include "telemetry/recording_set.h"

// What `joulecast check` finds, whatever it looks at.
namespace joulecast::client {

struct Finding {
  bool fault = false;  // what joulecastd refuses or books wrongly; else a warning
  std::string about;   // file, robot or channel
  std::string field;   // JSON pointer, field of a message, or empty
  std::string says;
  std::optional<double> value = std::nullopt;  // the number that says it
};

using Findings = std::vector<Finding>;

// Of a channel as transported: what cannot be taken, rates, silences, senders, clock. `live`: received just
// now, so that the robot's clock may be held against this one's.
void judge(const std::string& channel, const telemetry::ChannelTally& tally, bool live, Findings& findings);

// Of a robot's recordings against its file: signs, units, dead, held and constant channels.
void judge(const telemetry::RecordingSet& recordings, const robot::RobotModel& robot, Findings& findings);

// Of channels alone, where no robot file says what to expect: those that never move though the robot does.
void judge_fields(const std::string& channel, const telemetry::ChannelTally& tally, Findings& findings);

// Of a table as read: what was dropped, filled, out of its limits or could not be joined.
void judge(const telemetry::Import& import, const std::string& table, Findings& findings);

// Of a robot's state as a daemon answers it (schemas/robot-state.schema.json): what it holds against the
// robot, which may be silent by now.
void judge_state(const nlohmann::json& state, const std::string& robot_id, Findings& findings);

// What is wrong with a channel as transported, in a line; empty: nothing.
[[nodiscard]] std::string faults_of(const telemetry::ChannelTally& tally);

[[nodiscard]] nlohmann::json to_json(const Findings& findings);
void print(const Findings& findings);
// ok, fault, or warned where there are only warnings.
[[nodiscard]] Exit exit_of(const Findings& findings);

}  // namespace joulecast::client

#pragma once

#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>
#include <vector>

#include "client/commands/option.h"
#include "plausibility/check.h"
#include "robot/robot_model.h"
#include "telemetry/channel_watch.h"
#include "telemetry/csv_import.h"
#include "telemetry/log_recordings.h"

// Findings of `joulecast check`, for every kind of input.
namespace joulecast::client {

struct Finding {
  bool fault = false;  // joulecastd rejects it or accounts it wrongly; else a warning
  std::string about;   // file, robot or channel
  std::string field;   // JSON pointer, field of a message, or empty
  std::string says;
  std::optional<double> value = std::nullopt;  // the evidence as a number
};

using Findings = std::vector<Finding>;

// For a channel as transported: rejected messages, rates, silences, senders, clock. `live`: received just
// now, so that the robot's clock can be compared with this one's.
void judge(const std::string& channel, const telemetry::ChannelTally& tally, bool live, Findings& findings);

// Of a robot's recordings against its file: signs, units, dead, held and constant channels.
void judge(telemetry::RecordingSet recordings, const robot::RobotModel& robot, Findings& findings);

// For channels alone: wheels that never turn, battery power that is not measured; without a robot file also
// fields that never change in motion.
void judge_fields(const std::string& channel, const telemetry::ChannelTally& tally, bool robot_file,
                  Findings& findings);

// For a table as read: values that were dropped, filled, out of their limits or could not be joined.
void judge(const telemetry::Import& import, const std::string& table, Findings& findings);

// For a robot's state in a daemon's answer: its findings on the robot, which may be silent by now.
void judge_state(const nlohmann::json& state, const std::string& robot_id, Findings& findings);

// The faults of a channel as transported, in a line; empty: none.
[[nodiscard]] std::string faults_of(const telemetry::ChannelTally& tally);

[[nodiscard]] nlohmann::json to_json(const Findings& findings);
void print(const Findings& findings);
// ok, fault, or warned where there are only warnings.
[[nodiscard]] Exit exit_of(const Findings& findings);

}  // namespace joulecast::client

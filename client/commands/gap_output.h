#pragma once

#include <nlohmann/json_fwd.hpp>
#include <span>
#include <string>
#include <vector>

#include "client/commands/outcome.h"
#include "report/report.h"
#include "robot/robot_model.h"

namespace joulecast::client {

// One effect of a diagnosis's JSON with its strength and what it cannot be distinguished from.
void print_effect(const nlohmann::json& effect);

// A diagnosis of recordings as its JSON has it, offline or by a daemon.
void print_diagnosis(const nlohmann::json& diagnosis);

// What is wrong with adopting, as of the option that asked for it; a choice among effects is --effect's.
Error of_option(Error error, const std::string& option);

Exit write_robot(const robot::RobotModel& robot, const std::string& path, bool force);

// What a report says of where it comes from: names of files without their folders, and now.
report::ReportOrigin report_origin(const std::vector<std::string>& sources, const std::string& robot_file);

}  // namespace joulecast::client

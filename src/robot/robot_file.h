#pragma once

#include <filesystem>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <string_view>
#include <vector>

#include "base/error.h"
#include "robot/robot_model.h"

namespace joulecast::robot {

// The robot file (schemas/robot.schema.json) in and out; read_robot takes a document parsed already. All
// problems of a file are found in one go: the error's field is the JSON pointer of the first, its message
// lists every violated constraint with the value and the bound. Effects are checked for shape and finite
// numbers only; their catalogue checks the rest.
Result<RobotModel> parse_robot(std::string_view json_text);
Result<RobotModel> read_robot(const nlohmann::json& document);

// The problems that read_robot reports in one message, one by one; empty: no problem.
std::vector<FieldFault> problems_of(const nlohmann::json& document);

// As parse_robot; an unreadable file is Fault::not_found, and its path stands before the message.
Result<RobotModel> load_robot(const std::filesystem::path& path);

// Checks a model built in code against the same constraints as a file's.
Result<void> validate(const RobotModel& model);

// The battery of a robot file, or its battery object alone, checked by the same rows of the table.
Result<Battery> parse_battery(std::string_view json_text);
Result<Battery> load_battery(const std::filesystem::path& path);

// Doubles are written so that reading them back gives the same bits. Optional members at their absent value
// are left out. indent < 0 gives one line.
nlohmann::json robot_to_json(const RobotModel& model);
nlohmann::json battery_to_json(const Battery& battery);
std::string to_json_text(const RobotModel& model, int indent = 2);
std::string to_json_text(const Battery& battery, int indent = 2);

}  // namespace joulecast::robot

#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>

#include "answers/json/drive_json.h"
#include "answers/profile.h"

namespace joulecast::answers {

// "profile-request" and "profile".
described::Schemas profile_schemas();
// Errors name the field.
Result<ProfileInput> read_profile(const nlohmann::json& request, const robot::RobotModel& robot);
std::string profile_json(const ProfileInput& input, const ProfileOutput& output, const ModelInForce& model);

// From request to answer.
Result<std::string> profile_answer(const nlohmann::json& request, const ModelInForce& model);

}  // namespace joulecast::answers

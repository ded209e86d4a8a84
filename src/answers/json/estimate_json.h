#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>

#include "answers/estimate.h"
#include "answers/json/drive_json.h"

namespace joulecast::answers {

// "estimate-request" and "estimate".
described::Schemas estimate_schemas();
// Errors name the field.
Result<EstimateInput> read_estimate(const nlohmann::json& request, const robot::RobotModel& robot);
std::string estimate_json(const EstimateInput& input, const EstimateOutput& output,
                          const ModelInForce& model);

// From request to answer.
Result<std::string> estimate_answer(const nlohmann::json& request, const RobotOutlook& robot);

}  // namespace joulecast::answers

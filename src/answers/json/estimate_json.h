#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>

#include "answers/estimate.h"
#include "answers/json/drive_json.h"

namespace joulecast::answers {

// estimate-request.schema.json
const described::Input<EstimateInput, PathContext>& estimate_input();
// Errors name the field.
Result<EstimateInput> read_estimate(const nlohmann::json& request, const robot::RobotModel& robot);
// schemas/estimate.schema.json
std::string estimate_json(const EstimateInput& input, const EstimateOutput& output,
                          const ModelInForce& model);

// From request to answer.
Result<std::string> estimate_answer(const nlohmann::json& request, const RobotOutlook& robot);

}  // namespace joulecast::answers

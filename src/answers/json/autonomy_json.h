#pragma once

#include <nlohmann/json_fwd.hpp>
#include <stop_token>
#include <string>

#include "answers/autonomy.h"
#include "answers/json/battery_dialects.h"
#include "base/json_writer.h"
#include "describe/schema.h"

namespace joulecast::answers {

struct AutonomyRequest {
  AutonomyInput input;
  Dialect dialect = Dialect::joulecast;
};

// autonomy-request.schema.json, and those to which it refers.
described::Schemas autonomy_request_schemas();
// `single`: the request is for one robot, so that the comparison with minimum-energy profiles is made unless
// it is declined. Errors name the field, with the JSON pointer `at` of the request in front.
Result<AutonomyRequest> read_autonomy(const nlohmann::json& body, bool single, const std::string& at = {});

// schemas/autonomy.schema.json, or the dialect's
std::string autonomy_json(const AutonomyRequest& request, const AutonomyOutput& output,
                          const RobotOutlook& robot, const LiveRobot& now);

// From request to answer, of one robot.
Result<std::string> autonomy_answer(const nlohmann::json& request, const RobotOutlook& robot,
                                    const LiveRobot& now, planning::CostTableCache& tables,
                                    const std::stop_token& stop = {});

// {"since_utime_us", "detected_utime_us", "ratio", "missions"}
void write_drift(JsonWriter& json, const forecast::Drift& drift);

}  // namespace joulecast::answers

#pragma once

#include <nlohmann/json_fwd.hpp>
#include <stop_token>
#include <string>

#include "answers/autonomy.h"
#include "answers/json/battery_dialects.h"
#include "describe/schema.h"

namespace joulecast::answers {

struct AutonomyRequest {
  AutonomyInput input;
  Dialect dialect = Dialect::joulecast;

  bool former() const;  // members of the version before are used
};

// "autonomy-request", "autonomy" and those to which they refer.
described::Schemas autonomy_schemas();
// `single`: the request is for one robot, so that the comparison with minimum-energy profiles is made unless
// it is declined. Errors name the field, with the JSON pointer `at` of the request in front.
Result<AutonomyRequest> read_autonomy(const nlohmann::json& body, bool single, const std::string& at = {});

// In the dialect of the request.
std::string autonomy_json(const AutonomyRequest& request, const AutonomyOutput& output,
                          const RobotOutlook& robot, const LiveRobot& now);

// From request to answer, of one robot.
Result<std::string> autonomy_text(const AutonomyRequest& request, const RobotOutlook& robot,
                                  const LiveRobot& now, planning::CostTableCache& tables,
                                  const std::stop_token& stop = {});
Result<std::string> autonomy_answer(const nlohmann::json& request, const RobotOutlook& robot,
                                    const LiveRobot& now, planning::CostTableCache& tables);

}  // namespace joulecast::answers

#pragma once

#include "describe/schema.h"

namespace joulecast::robot {

// The JSON Schema of the robot file, from robot_fields.h; schemas/robot.schema.json is this.
described::Schema robot_schema();

}  // namespace joulecast::robot

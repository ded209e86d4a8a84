#pragma once

#include <span>
#include <utility>
#include <vector>

#include "describe/schema.h"
#include "server/embedded.h"

namespace joulecast::api {

// Schemas of requests and answers that are read and written from a table, by the file that has the table.
described::Schemas diagnosis_schemas();
described::Schemas fleet_autonomy_schemas();
described::Schema audit_schema();
described::Schema event_log_schema();
described::Schemas mission_request_schemas();
described::Schemas mission_schemas();
described::Schemas model_schemas();
described::Schema recent_values_schema();
described::Schema cluster_schema();
described::Schema floor_map_schema();
described::Schema gap_history_schema();
described::Schemas robot_schemas();
described::Schema tariff_schema();
described::Schema totals_schema();
described::Schemas maps_schemas();

// These and the shared ones, with the files of schemas/: the schemas of all endpoints, each as
// NAME.schema.json.
std::span<const EmbeddedFile> schemas();

}  // namespace joulecast::api

#pragma once

#include <span>

#include "describe/schema.h"
#include "server/embedded.h"

namespace joulecast::api {

// Schemas of answers that are written from a table (describe/table.h), by the file that has the table.
described::Schema cluster_schema();
described::Schema gap_history_schema();
described::Schema totals_schema();

// These and the shared ones, with the files of schemas/: the schemas of all endpoints, each as
// NAME.schema.json.
std::span<const EmbeddedFile> schemas();

}  // namespace joulecast::api

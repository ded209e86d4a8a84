#pragma once

#include "base/try.h"
#include "telemetry/csv_import.h"

namespace joulecast::telemetry {

// The only mission of a table; Fault::invalid where there are several.
inline Result<Import> import_csv(std::string_view csv, const ImportMapping& mapping,
                                 const ImportOptions& options = {}) {
  TRY_ASSIGN(auto missions, import_missions(csv, mapping, options));
  if (missions.size() > 1)
    return invalid(options.source_name, "holds " + std::to_string(missions.size()) + " missions");
  return std::move(missions.front());
}

}  // namespace joulecast::telemetry

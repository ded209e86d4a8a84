#pragma once

#include <string>

#include "base/error.h"
#include "history/store.h"
#include "history/writer.h"
#include "server/ingest/model_registry.h"

namespace joulecast::server {

// Puts the store's active models in force. A stored model that no longer reads is an error naming robot and
// version.
Result<void> load_stored_models(const history::Store& store, ModelRegistry& models);

// Adds the robot files (*.json) of a directory as new versions, where a file says something else than the
// last version that came from a file; so a model adopted since stays in force. Returns the number of files
// read. Any bad file is an error.
Result<int> load_robot_files(const std::string& directory, history::Store& store, history::Writer& writer,
                             std::int64_t now_utime_us);

}  // namespace joulecast::server

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

// Adds a robot file as a new version where it says something else than the last version that came from a
// file; so a model adopted since stays in force. An effect that the catalogue rejects is an error.
Result<void> load_robot_file(const std::string& path, history::Store& store, history::Writer& writer,
                             std::int64_t now_utime_us);

// The same for all robot files (*.json) of a directory. Returns their number. Any bad file is an error.
Result<int> load_robot_files(const std::string& directory, history::Store& store, history::Writer& writer,
                             std::int64_t now_utime_us);

}  // namespace joulecast::server

#include "client/commands/import_tables.h"

#include <utility>

#include "client/files.h"

namespace joulecast::client {
namespace {

constexpr std::size_t max_line_bytes = std::size_t{1} << 20;

}  // namespace

Result<telemetry::ImportMapping> read_mapping(const std::string& path) {
  const auto text = read_file(path);
  if (!text) return tl::unexpected(text.error());
  return telemetry::ImportMapping::parse(*text).map_error([&](Error error) {
    error.field = path + (error.field.empty() ? "" : "#" + error.field);
    return error;
  });
}

Result<std::vector<telemetry::Import>> import_table(const std::string& path,
                                                    const telemetry::ImportMapping& mapping,
                                                    telemetry::ImportOptions how) {
  const auto text = read_file(path, max_line_bytes);
  if (!text) return tl::unexpected(text.error());
  for (const telemetry::JoinedFile& file : telemetry::joined_files(mapping, path)) {
    auto joined = read_file(file.path, max_line_bytes);
    if (!joined) return tl::unexpected(joined.error());
    how.joined[file.table] = std::move(*joined);
  }
  how.source_name = path;
  return telemetry::import_missions(*text, mapping, how);
}

void number_on(telemetry::Recording& recording, std::map<std::string, std::int64_t>& next) {
  for (signals::Sample& sample : recording.samples) sample.sequence = next[recording.robot_id]++;
}

}  // namespace joulecast::client

#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "base/error.h"
#include "telemetry/recording.h"

// Tables of foreign robots to samples, through a mapping file (schemas/import-mapping.schema.json).
namespace joulecast::telemetry {

// A mapping file, parsed and checked; immutable and shareable.
class ImportMapping {
 public:
  // On a fault the error's field is the JSON pointer of the offending member.
  static Result<ImportMapping> parse(std::string_view json);

  struct Content;
  [[nodiscard]] const Content& content() const noexcept { return *content_; }

 private:
  explicit ImportMapping(std::shared_ptr<const Content> content) : content_(std::move(content)) {}

  std::shared_ptr<const Content> content_;
};

// What the caller knows better than the mapping.
struct ImportOptions {
  std::string source_name;  // file name, for {stem} and {folder} in mission_id, and for messages
  std::optional<std::string> robot_id;
  std::optional<std::string> mission_id;
  std::optional<std::int64_t> start_utime_us;  // robot clock of the first row
};

struct Glitch {
  std::size_t line = 0;  // 1 = header
  std::string column;
  double value = 0;    // as read
  std::string action;  // "hold", "clamp", "unmeasured" or "drop_row", as the mapping says
};

struct ImportReport {
  std::size_t rows = 0;
  std::size_t samples = 0;
  std::size_t rows_without_motion = 0;  // dropped: a wheel velocity is not known (yet)
  std::size_t rows_out_of_time = 0;     // dropped: time did not advance
  std::size_t rows_glitched = 0;        // dropped by a limit's policy
  std::size_t cells_filled = 0;         // empty cells of used columns that repeat the value before
  std::vector<Glitch> glitches;         // every value out of its column's limits
};

struct Import {
  Recording recording;
  ImportReport report;
};

// On bad input the error's field is "<source name>: line N" and its message names the column and the text in
// it.
[[nodiscard]] Result<Import> import_csv(std::string_view csv, const ImportMapping& mapping,
                                        const ImportOptions& options = {});

}  // namespace joulecast::telemetry

#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "base/error.h"
#include "telemetry/import_mapping.h"
#include "telemetry/recording.h"

// Tables of foreign robots to samples, through a mapping file (schemas/import-mapping.schema.json).
namespace joulecast::telemetry {

// Real clocks are later; tables without a date count from zero.
inline constexpr std::int64_t year_2000_utime_us = 946'684'800'000'000;

// Values that the caller gives instead of the mapping.
struct ImportOptions {
  std::string source_name;  // file name, for {stem} and {folder} in mission_id, and for messages
  std::optional<std::string> robot_id;
  std::optional<std::string> mission_id;
  std::optional<std::int64_t> start_utime_us;                             // robot clock of the first row
  std::function<Result<std::string>(const std::string&)> read_file = {};  // of joined tables, by path
  // With a start: before a mission that begins where the time column starts again.
  std::int64_t pause_us = 60'000'000;
};

struct Glitch {
  std::size_t line = 0;  // from 1; 0 of a rate, which depends on several lines
  std::string column;
  double value = 0;    // as read
  std::string action;  // "hold" or "unmeasured", according to the mapping; "thrown": a jump of a position
};

// How the readings of a joined table met the main one's rows.
struct JoinReport {
  std::string table;
  std::size_t rows = 0;              // of it
  std::size_t matched = 0;           // rows of the main table that found a reading of every column ...
  std::size_t beyond_tolerance = 0;  // ... and that did not, for the nearest one is too far
  double median_lag_s = 0;           // from the reading to the row that uses it
};

struct ImportReport {
  std::size_t rows = 0;
  std::size_t samples = 0;              // `samples_added` among them
  std::size_t samples_added = 0;        // between rows of changes
  std::size_t rows_without_motion = 0;  // dropped: a wheel velocity is not available (yet)
  std::size_t rows_unsorted = 0;        // before the row before; put in order
  std::size_t rows_out_of_time = 0;     // dropped: the time of the row before
  std::size_t cells_filled = 0;         // empty cells of used columns that repeat the value before
  std::vector<Glitch> glitches;         // every value out of its column's limits
  std::vector<JoinReport> joins;        // of the whole main table
  // Of the whole main table: detected settings, which come first, omitted rows, beginnings of missions.
  std::vector<std::string> notes;
  std::size_t settings_detected = 0;
};

struct Import {
  Recording recording;
  ImportReport report;
};

// The missions of a main table with its joined tables, in order of time; one where no column names them and
// the time column does not start again. On bad input the error's field is "<source name>: line N" and its
// message names the column and the text in it; a table that loses more than half of its rows is an error that
// gives the reason. With several missions, the first report also contains the findings on the whole table.
[[nodiscard]] Result<std::vector<Import>> import_missions(std::string_view csv, const ImportMapping& mapping,
                                                          const ImportOptions& options = {});

}  // namespace joulecast::telemetry

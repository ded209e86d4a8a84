#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "telemetry/csv_import.h"
#include "telemetry/import_mapping.h"

// A table's columns as functions of time, to be read at the times of another. Only the import's own sources
// use this.
namespace joulecast::telemetry {

struct SeriesColumn {
  std::string name;                     // in its table
  const ValueLimits* limits = nullptr;  // null: finite values
};

class TableSeries {
 public:
  // Reads every row; empty cells and values outside the limits, which join `glitches`, give no reading.
  // `shown` stands before column names in messages ("battery:"). Errors name `source` and line.
  static Result<TableSeries> read(std::string_view csv, const TableLayout& layout,
                                  std::vector<SeriesColumn> columns, const std::string& source,
                                  const std::string& shown, std::vector<Glitch>& glitches);

  // The reading of a column that holds then, not older than the tolerance. lag_us: from it.
  struct Reading {
    double value = signals::unmeasured;
    std::int64_t lag_us = 0;
    bool beyond = false;  // there is one, but too far
  };
  [[nodiscard]] Reading at(std::size_t column, std::int64_t utime_us, std::int64_t tolerance_us) const;

  [[nodiscard]] std::size_t rows() const noexcept { return rows_; }
  [[nodiscard]] std::size_t rows_unsorted() const noexcept { return rows_unsorted_; }
  void shift(std::int64_t by_us);

 private:
  struct Point {
    std::int64_t utime_us = 0;
    double value = 0;
  };

  std::vector<std::vector<Point>> columns_;  // of one time the last
  std::size_t rows_ = 0, rows_unsorted_ = 0;
};

}  // namespace joulecast::telemetry

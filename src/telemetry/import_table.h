#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "base/error.h"
#include "telemetry/csv_table.h"
#include "telemetry/import_mapping.h"
#include "telemetry/stamp.h"

// A table as its mapping describes it: rows, cells, times. Only the import's own sources use this.
namespace joulecast::telemetry {

inline constexpr std::int64_t latest_import_utime_us = 4'102'444'800'000'000;  // the year 2100

struct CellPlace {
  std::size_t column = 0;
  std::optional<std::size_t> element = {};  // of a list in the cell
};

class ImportTable : public CsvTable {
 public:
  // The text is referenced. Errors name the source and the line.
  static Result<ImportTable> open(std::string_view text, const TableLayout& layout, std::string source);

  // By the name as written, then with the prefix before it; "name#2" is the second column of that name,
  // "name[0]" the first element of its list. Errors name the columns that there are.
  [[nodiscard]] Result<CellPlace> find(const std::string& column) const;

  // The next row, repeated headers left out; false at the end.
  Result<bool> next();
  // The time of the next row; empty at the end. Damaged rows, and those without a time in a table in which
  // most have one, are passed over and noted.
  Result<std::optional<std::int64_t>> next_time();
  // Whether the row cannot be read since the logger stopped in it: it has zero bytes, or is the last line and
  // cut; where its cells are at fault (`cell`), also without a line end. It is noted and passed over.
  bool pass_damaged(bool cell);

  // Without the blanks around it; of a list that is too short empty.
  [[nodiscard]] std::string_view text(CellPlace place) const;
  // NaN for the words that mean no value; empty for an empty cell. A unit behind the numbers is noted.
  [[nodiscard]] Result<std::optional<double>> number(CellPlace place, const std::string& column);
  // Microseconds since the zero of the time column, of ISO 8601 since 1970; of rows in their order.
  Result<std::int64_t> time();

  // An error at the row's line.
  [[nodiscard]] tl::unexpected<Error> refuse(const std::string& column, std::string_view text,
                                             const std::string& what) const;
  // Detected settings, and omitted rows, as sentences.
  [[nodiscard]] std::vector<std::string> settings() const;
  [[nodiscard]] std::vector<std::string> notes() const;

 private:
  ImportTable(CsvTable table, const TableLayout& layout, StampReader stamps, std::string source)
      : CsvTable(std::move(table)), layout_(layout), stamps_(std::move(stamps)), source_(std::move(source)) {}
  void detect_decimal();

  TableLayout layout_;
  bool decimal_comma_ = false, grouped_ = false;
  StampReader stamps_;
  std::string source_;
  std::vector<CellPlace> time_places_;
  std::vector<std::string_view> row_;
  Unwrapped unwrapped_;
  std::size_t rows_ = 0, headers_ = 0;
  std::vector<std::size_t> damaged_lines_;
  std::size_t timeless_ = 0;
  std::optional<Error> first_timeless_;
  std::map<std::size_t, std::string> units_;  // of the numbers in a column, by its place
  std::vector<std::string> notes_;
};

}  // namespace joulecast::telemetry

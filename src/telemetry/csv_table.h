#pragma once

#include <cstddef>
#include <deque>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "base/error.h"

namespace joulecast::telemetry {

// Reads a table row by row: any one-byte separator, RFC 4180 quotes (doubled inside), LF or CRLF, a UTF-8
// byte order mark skipped, blank lines skipped. Copies nothing but quoted fields.
class CsvTable {
 public:
  // The text is referenced, not copied.
  static Result<CsvTable> open(std::string_view text, char separator);

  [[nodiscard]] const std::vector<std::string>& header() const noexcept { return header_; }
  // Place of the column with exactly this name; empty when absent. Of equal names the first.
  [[nodiscard]] std::optional<std::size_t> find(std::string_view name) const noexcept;

  // The next row with exactly as many fields as the header; false at the end. Views are valid until the next
  // call.
  Result<bool> next(std::vector<std::string_view>& fields);
  // Of the row read last; the header begins on line 1.
  [[nodiscard]] std::size_t line() const noexcept { return row_line_; }

 private:
  CsvTable(std::string_view text, char separator) : text_(text), separator_(separator) {}
  Result<bool> read_row(std::vector<std::string_view>& fields);

  std::string_view text_;
  char separator_;
  std::size_t at_ = 0;
  std::size_t line_ = 1;
  std::size_t row_line_ = 0;
  std::vector<std::string> header_;
  std::deque<std::string> unquoted_;  // fields whose quotes hid doubled quotes
};

}  // namespace joulecast::telemetry

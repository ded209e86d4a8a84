#pragma once

#include <cstddef>
#include <deque>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

#include "base/error.h"

namespace joulecast::telemetry {

struct CsvFormat {
  CsvFormat(char one = ',') : separator(one) {}  // NOLINT: a separator alone is the usual format

  char separator;                   // 0: found by the first two lines; a blank: any run of blanks and tabs
  std::string comment;              // a line that begins with one of these characters is skipped
  std::size_t skip_lines = 0;       // before the header, with any content
  std::vector<std::string> header;  // names of the columns of a table without a header line
};

// Reads a table row by row: any one-byte separator, RFC 4180 quotes (doubled inside), LF or CRLF, blank
// lines, a byte order mark and Excel's line `sep=;` skipped. Text in UTF-16 or Latin-1 is converted to UTF-8;
// else nothing but quoted fields is copied.
class CsvTable {
 public:
  // The text is referenced, not copied.
  static Result<CsvTable> open(std::string_view text, const CsvFormat& format);

  [[nodiscard]] const std::vector<std::string>& header() const noexcept { return header_; }
  // The next row with exactly as many fields as the header, empty ones behind them left out; false at the
  // end. Views are valid until the next call.
  Result<bool> next(std::vector<std::string_view>& fields);
  // Where a row begins, to come back to.
  struct Place {
    std::size_t line = 1;   // counted from 1
    std::string_view text;  // from there on
  };
  // Of the row read last, or that could not be read.
  [[nodiscard]] const Place& place() const noexcept { return row_; }
  [[nodiscard]] std::size_t line() const noexcept { return row_.line; }
  void go_to(const Place& place) noexcept { at_ = place; }
  void skip_line() noexcept;

 protected:
  [[nodiscard]] const CsvFormat& format() const noexcept { return format_; }
  // Of the text before its conversion; empty: UTF-8.
  [[nodiscard]] const std::string& encoding() const noexcept { return encoding_; }

 private:
  CsvTable(std::string_view text, const CsvFormat& format) : format_(format), at_{1, text} {}
  Result<bool> read_row(std::vector<std::string_view>& fields);
  Result<std::string_view> quoted_field();
  void skip_blanks() noexcept;
  [[nodiscard]] bool at_line_end() const noexcept;
  [[nodiscard]] bool at_separator() const noexcept;
  [[nodiscard]] bool blanks() const noexcept { return format_.separator == ' '; }

  std::shared_ptr<const std::string> converted_;
  std::string encoding_;
  CsvFormat format_;
  Place at_, row_;
  std::vector<std::string> header_;
  std::deque<std::string> unquoted_;  // quoted fields that contain doubled quotes
};

}  // namespace joulecast::telemetry

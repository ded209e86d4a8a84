#pragma once

#include <cstddef>
#include <deque>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "base/error.h"

namespace joulecast::telemetry {

struct CsvFormat {
  CsvFormat(char one = ',') : separator(one) {}  // NOLINT: a separator alone is the usual format

  char separator;
  bool blanks = false;              // any run of blanks and tabs separates instead
  std::string comment;              // a line that begins with one of these characters is skipped
  std::size_t skip_lines = 0;       // before the header, whatever they hold
  std::vector<std::string> header;  // names of the columns of a table without a header line
};

// Without the blanks and tabs around it.
[[nodiscard]] std::string_view trimmed(std::string_view text) noexcept;

// Reads a table row by row: any one-byte separator, RFC 4180 quotes (doubled inside), LF or CRLF, a UTF-8
// byte order mark skipped, blank lines skipped. Copies nothing but quoted fields.
class CsvTable {
 public:
  // The text is referenced, not copied.
  static Result<CsvTable> open(std::string_view text, const CsvFormat& format);

  [[nodiscard]] const std::vector<std::string>& header() const noexcept { return header_; }
  // Place of the column with this name, blanks around names left out; empty when absent. Of equal names the
  // first.
  [[nodiscard]] std::optional<std::size_t> find(std::string_view name) const noexcept;

  // The next row with exactly as many fields as the header; false at the end. Views are valid until the next
  // call.
  Result<bool> next(std::vector<std::string_view>& fields);
  // Where next() goes on, to come back to.
  struct Place {
    std::size_t at = 0, line = 1;
  };
  [[nodiscard]] Place place() const noexcept { return {at_, line_}; }
  void go_to(Place place) noexcept {
    at_ = place.at;
    line_ = place.line;
  }
  // Of the row read last, counted from 1.
  [[nodiscard]] std::size_t line() const noexcept { return row_line_; }

 private:
  CsvTable(std::string_view text, const CsvFormat& format) : text_(text), format_(format) {}
  Result<bool> read_row(std::vector<std::string_view>& fields);
  Result<std::string_view> quoted_field();
  void skip_line() noexcept;
  void skip_blanks() noexcept;
  [[nodiscard]] bool at_line_end() const noexcept;
  [[nodiscard]] bool at_separator() const noexcept;

  std::string_view text_;
  CsvFormat format_;
  std::size_t at_ = 0;
  std::size_t line_ = 1;
  std::size_t row_line_ = 0;
  std::vector<std::string> header_;
  std::deque<std::string> unquoted_;  // fields whose quotes hid doubled quotes
};

}  // namespace joulecast::telemetry

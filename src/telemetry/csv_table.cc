#include "telemetry/csv_table.h"

#include <algorithm>

namespace joulecast::telemetry {
namespace {

std::string line_name(std::size_t line) {
  return "line " + std::to_string(line);
}

}  // namespace

Result<CsvTable> CsvTable::open(std::string_view text, char separator) {
  if (text.starts_with("\xEF\xBB\xBF")) text.remove_prefix(3);
  CsvTable table(text, separator);
  std::vector<std::string_view> names;
  auto read = table.read_row(names);
  if (!read) return tl::unexpected(std::move(read.error()));
  if (!*read) return fail(Fault::corrupt, "line 1", "the table is empty; a header is needed");
  table.header_.assign(names.begin(), names.end());
  return table;
}

std::optional<std::size_t> CsvTable::find(std::string_view name) const noexcept {
  const auto found = std::find(header_.begin(), header_.end(), name);
  if (found == header_.end()) return std::nullopt;
  return static_cast<std::size_t>(found - header_.begin());
}

Result<bool> CsvTable::next(std::vector<std::string_view>& fields) {
  auto read = read_row(fields);
  if (read && *read && fields.size() != header_.size()) {
    return fail(Fault::corrupt, line_name(row_line_),
                "has " + std::to_string(fields.size()) + " fields where the header has " +
                    std::to_string(header_.size()));
  }
  return read;
}

Result<bool> CsvTable::read_row(std::vector<std::string_view>& fields) {
  fields.clear();
  unquoted_.clear();
  while (at_ < text_.size() && (text_[at_] == '\n' || text_[at_] == '\r')) {
    if (text_[at_] == '\n') ++line_;
    ++at_;
  }
  if (at_ >= text_.size()) return false;
  row_line_ = line_;
  while (true) {
    if (at_ < text_.size() && text_[at_] == '"') {
      const std::size_t opened = line_;
      const std::size_t begin = ++at_;
      bool doubled = false;
      while (at_ < text_.size() && (text_[at_] != '"' || (at_ + 1 < text_.size() && text_[at_ + 1] == '"'))) {
        if (text_[at_] == '"') {
          doubled = true;
          ++at_;
        } else if (text_[at_] == '\n') {
          ++line_;
        }
        ++at_;
      }
      if (at_ >= text_.size())
        return fail(Fault::corrupt, line_name(opened), "a quoted field is never closed");
      std::string_view field = text_.substr(begin, at_ - begin);
      ++at_;
      if (doubled) {
        std::string& plain = unquoted_.emplace_back();
        for (std::size_t i = 0; i < field.size(); ++i) {
          plain += field[i];
          if (field[i] == '"') ++i;
        }
        field = plain;
      }
      fields.push_back(field);
      if (at_ < text_.size() && text_[at_] != separator_ && text_[at_] != '\n' && text_[at_] != '\r') {
        return fail(Fault::corrupt, line_name(line_), "text follows a quoted field");
      }
    } else {
      const std::size_t begin = at_;
      while (at_ < text_.size() && text_[at_] != separator_ && text_[at_] != '\n' && text_[at_] != '\r')
        ++at_;
      fields.push_back(text_.substr(begin, at_ - begin));
    }
    if (at_ >= text_.size() || text_[at_] != separator_) return true;
    ++at_;
  }
}

}  // namespace joulecast::telemetry

#include "telemetry/csv_table.h"

#include <fmt/format.h>
#include <iconv.h>

#include <algorithm>
#include <array>
#include <boost/algorithm/string/replace.hpp>

#include "base/text.h"
#include "base/try.h"

namespace joulecast::telemetry {
namespace {

constexpr std::string_view byte_order_mark = "\xEF\xBB\xBF";

tl::unexpected<Error> corrupt(std::size_t line, const std::string& what) {
  return fail(Fault::corrupt, fmt::format("line {}", line), what);
}

// The text's encoding by zero bytes of its first characters, its byte order mark, or bytes not in UTF-8.
std::string encoding_of(std::string_view text) {
  const auto zeros = [&](std::size_t one, std::size_t other) {
    return text.size() > 3 && text[one] == '\0' && text[other] == '\0';
  };
  if (zeros(2, 3)) return "UTF-32LE";
  if (zeros(0, 1)) return "UTF-32BE";
  if (text.starts_with("\xFF\xFE") || zeros(1, 3)) return "UTF-16LE";
  if (text.starts_with("\xFE\xFF") || zeros(0, 2)) return "UTF-16BE";
  return is_utf8(text.substr(0, text.rfind('\n'))) ? "" : "LATIN1";  // the last line may be cut
}

// In UTF-8; a character that is cut at the end is left out.
std::string in_utf8(std::string_view text, const std::string& encoding) {
  std::string converted(2 * text.size(), '\0');  // no character of these encodings takes more
  char* from = const_cast<char*>(text.data());
  char* to = converted.data();
  std::size_t left = text.size(), room = converted.size();
  const iconv_t conversion = iconv_open("UTF-8", encoding.c_str());
  while (iconv(conversion, &from, &left, &to, &room) == static_cast<std::size_t>(-1) && left > 1) {
    from += 2;  // half a surrogate pair
    left -= 2;
  }
  iconv_close(conversion);
  converted.resize(converted.size() - room);
  return converted;
}

// The separator that gives the first row as many fields as the header: of several the one that gives most,
// blanks last. Lines without such a row behind them, or with numbers, come before the header.
CsvFormat with_separator(std::string_view text, CsvFormat format) {
  constexpr std::size_t most_lines = 50;  // before the header
  constexpr std::array separators{',', ';', '\t', '|', ' '};
  const bool given = format.skip_lines > 0 || !format.header.empty();
  const auto is_number = [](std::string_view name) {
    return name.find_first_not_of("0123456789.,+-eE") == std::string_view::npos &&
           name.find_first_of("0123456789") != std::string_view::npos;
  };
  CsvFormat found = format;
  std::size_t most = 1;
  for (std::size_t tries = given ? 1 : 1 + most_lines; tries > 0 && most == 1; --tries, ++format.skip_lines)
    for (const char separator : separators) {
      format.separator = separator;
      auto table = CsvTable::open(text, format);
      std::vector<std::string_view> first;
      const bool read = table && table->next(first).value_or(false);
      if (!read || first.size() <= most || (separator == ' ' && most > 1)) continue;
      if (!given && std::ranges::any_of(table->header(), is_number)) continue;
      most = first.size();
      found = format;
    }
  if (most > 1) return found;
  const auto first = text.substr(0, text.find('\n'));
  found.separator = *std::max_element(separators.begin(), separators.end() - 1, [&](char a, char b) {
    return std::ranges::count(first, a) < std::ranges::count(first, b);
  });
  return found;
}

}  // namespace

Result<CsvTable> CsvTable::open(std::string_view text, const CsvFormat& format) {
  constexpr std::size_t probed = 65'536;  // bytes in which the separator is found
  if (text.starts_with("\x1F\x8B") || text.starts_with("PK\x03\x04"))
    return corrupt(1, "is compressed, or a spreadsheet: unpack it, or save it as CSV");
  std::string encoding = encoding_of(text);
  std::shared_ptr<const std::string> converted;
  if (!encoding.empty()) text = *(converted = std::make_shared<std::string>(in_utf8(text, encoding)));
  if (text.starts_with(byte_order_mark)) text.remove_prefix(byte_order_mark.size());
  CsvTable table(text, format);
  table.converted_ = std::move(converted);
  table.encoding_ = std::move(encoding);
  const std::string_view first = text.substr(0, text.find_first_of("\r\n"));
  const std::string_view sep = first.substr(first.starts_with('"') ? 1 : 0, 5);
  if (first.size() < 8 && (sep.starts_with("sep=") || sep.starts_with("SEP=")) && sep.size() == 5) {
    table.skip_line();
    if (format.separator == '\0') table.format_.separator = sep[4];
  }
  if (table.format_.separator == '\0') table.format_ = with_separator(text.substr(0, probed), format);
  for (std::size_t k = 0; k < table.format_.skip_lines; ++k) table.skip_line();
  table.header_ = format.header;
  if (!table.header_.empty()) return table;
  std::vector<std::string_view> names;
  TRY_ASSIGN(auto read, table.read_row(names));
  if (!read) return corrupt(1, "the table is empty; a header is needed");
  if (std::ranges::any_of(names,
                          [](std::string_view name) { return name.find('\0') != std::string_view::npos; }))
    return corrupt(table.line(), "the header has zero bytes: the file is not text");
  table.header_.assign(names.begin(), names.end());
  return table;
}

Result<bool> CsvTable::next(std::vector<std::string_view>& fields) {
  TRY_ASSIGN(const bool read, read_row(fields));
  if (!read) return false;
  while (fields.size() > header_.size() && trimmed(fields.back()).empty()) fields.pop_back();
  while (fields.size() < header_.size() && trimmed(header_[fields.size()]).empty()) fields.emplace_back();
  if (fields.size() == header_.size()) return true;
  return corrupt(line(), fmt::format("has {} fields, the header {}", fields.size(), header_.size()));
}

bool CsvTable::at_line_end() const noexcept {
  return at_.text.empty() || at_.text[0] == '\n' || at_.text[0] == '\r';
}

bool CsvTable::at_separator() const noexcept {
  if (at_.text.empty()) return false;
  const char c = at_.text[0];
  return c == format_.separator || (blanks() && c == '\t');
}

void CsvTable::skip_line() noexcept {
  const std::size_t end = at_.text.find('\n');
  at_.line += end != std::string_view::npos;
  at_.text.remove_prefix(end != std::string_view::npos ? end + 1 : at_.text.size());
}

void CsvTable::skip_blanks() noexcept {
  at_.text.remove_prefix(std::min(at_.text.find_first_not_of(" \t"), at_.text.size()));
}

// After the opening quote, to behind the closing one.
Result<std::string_view> CsvTable::quoted_field() {
  const Place opened = at_;
  std::string_view& text = at_.text;
  for (; !text.empty(); text.remove_prefix(1)) {
    at_.line += text[0] == '\n';
    if (text[0] != '"') continue;
    if (!text.starts_with("\"\"")) break;
    text.remove_prefix(1);
  }
  if (text.empty()) return corrupt(opened.line, "a quoted field is never closed");
  const std::string_view field = opened.text.substr(0, opened.text.size() - text.size());
  text.remove_prefix(1);
  if (!at_line_end() && !at_separator()) return corrupt(at_.line, "text follows a quoted field");
  if (field.find('"') == std::string_view::npos) return field;
  return unquoted_.emplace_back(boost::replace_all_copy(std::string(field), "\"\"", "\""));
}

Result<bool> CsvTable::read_row(std::vector<std::string_view>& fields) {
  fields.clear();
  unquoted_.clear();
  std::string_view& text = at_.text;
  while (true) {
    if (text.starts_with(byte_order_mark)) text.remove_prefix(byte_order_mark.size());  // of files joined
    if (blanks()) skip_blanks();
    if (text.empty()) return false;
    if (format_.comment.find(text[0]) != std::string::npos) {
      skip_line();
    } else if (at_line_end()) {
      at_.line += text[0] == '\n';
      text.remove_prefix(1);
    } else {
      break;
    }
  }
  row_ = at_;
  while (true) {
    if (text.starts_with('"')) {
      text.remove_prefix(1);
      TRY_ASSIGN(auto field, quoted_field());
      fields.push_back(field);
    } else {
      const std::string_view begin = text;
      while (!at_line_end() && !at_separator()) text.remove_prefix(1);
      fields.push_back(begin.substr(0, begin.size() - text.size()));
    }
    if (blanks()) skip_blanks();
    if (blanks() ? at_line_end() : !at_separator()) return true;
    if (!blanks()) text.remove_prefix(1);
  }
}

}  // namespace joulecast::telemetry

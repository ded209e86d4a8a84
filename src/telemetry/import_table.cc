#include "telemetry/import_table.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <charconv>
#include <cmath>

#include "base/try.h"

namespace joulecast::telemetry {
namespace {

constexpr std::array<std::string_view, 12> no_value_words{
    "null", "none", "nil", "n/a", "#n/a", "na", "\\n", "(null)", "undefined", "nul", "missing", "no data"};

// A word for no value: the usual ones in any case, or dashes, points and question marks alone ("--.--").
bool means_no_value(std::string_view text, const std::vector<std::string>& more) {
  const auto equal = [&](std::string_view word) {
    return std::ranges::equal(text, word, {}, [](unsigned char c) { return std::tolower(c); });
  };
  return text.find_first_not_of("-.?*_") == std::string_view::npos ||
         std::ranges::any_of(no_value_words, equal) || std::ranges::find(more, text) != more.end();
}

// One of the numbers between the innermost brackets of a list such as "[0.5, 1]" or "array('d', [0.5, 1])".
std::string_view element_of(std::string_view list, std::size_t index) {
  if (const std::size_t open = list.find_last_of("[({"); open != std::string_view::npos) {
    list.remove_prefix(open + 1);
    list = list.substr(0, list.find_first_of("])}"));
  }
  constexpr std::string_view between = ",; \t\n";
  for (std::size_t at = list.find_first_not_of(between); at != std::string_view::npos;) {
    const std::size_t end = std::min(list.find_first_of(between, at), list.size());
    if (index-- == 0) return list.substr(at, end - at);
    at = list.find_first_not_of(between, end);
  }
  return {};
}

// Of one column, in its unit.
std::optional<std::int64_t> time_us(std::string_view text, std::int64_t unit_ns, double scale,
                                    bool decimal_comma) {
  std::int64_t whole = 0;
  const auto [end, fault] = std::from_chars(text.data(), text.data() + text.size(), whole);
  if (scale == 1 && fault == std::errc{} && end == text.data() + text.size()) {
    // Exact: ns since 1970 do not fit a double.
    if (unit_ns < 1000) return whole / (1000 / unit_ns);
    std::int64_t scaled = 0;
    const bool beyond = __builtin_mul_overflow(whole, unit_ns / 1000, &scaled);
    return beyond || std::abs(scaled) > latest_import_utime_us ? std::nullopt : std::optional(scaled);
  }
  const auto real = parse_number(text, decimal_comma);
  if (!real) return std::nullopt;
  const double us = *real * scale * static_cast<double>(unit_ns) / 1000;
  if (!(std::abs(us) <= static_cast<double>(latest_import_utime_us))) return std::nullopt;
  return std::llround(us);
}

}  // namespace

std::optional<double> parse_number(std::string_view text, bool decimal_comma) {
  std::string with_point;
  if (decimal_comma) {
    // A point would be one of thousands, or a mistake.
    if (text.find('.') != std::string_view::npos) return std::nullopt;
    with_point = text;
    std::ranges::replace(with_point, ',', '.');
    text = with_point;
  }
  if (text.starts_with('+')) text.remove_prefix(1);
  double value = 0;
  const auto [end, fault] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (fault != std::errc{} || end != text.data() + text.size()) return std::nullopt;
  return value;
}

double Unwrapped::operator()(double value, double period) {
  if (std::isnan(value)) return value;
  if (!std::isnan(last_)) shift_ -= period * std::round((value - last_) / period);
  last_ = value;
  return value + shift_;
}

Result<ImportTable> ImportTable::open(std::string_view text, const TableLayout& layout, std::string source) {
  auto table = CsvTable::open(text, layout.format);
  auto stamps = StampReader::create(layout.utc_offset, layout.time_format);
  if (!table || !stamps) {
    Error error = table ? stamps.error() : table.error();
    error.field = source + ": " + error.field;
    return tl::unexpected(std::move(error));
  }
  ImportTable opened(std::move(*table), layout, std::move(*stamps), std::move(source));
  TRY(opened.bind());
  return opened;
}

// Finds the time columns and, in a table without a declared layout of numbers, a decimal comma.
Result<void> ImportTable::bind() {
  for (const ColumnTerm& term : layout_.time_columns) {
    TRY_ASSIGN(auto place, find(term.column));
    time_places_.push_back(place);
  }
  if (layout_.format.separator != '\0' || layout_.decimal_comma) return {};
  constexpr int probed = 200;  // rows
  CsvTable rows = table_;
  bool points = false;
  for (int k = 0; k < probed && rows.next(row_).value_or(false); ++k)
    for (const std::string_view cell : row_) {
      const bool comma = cell.find(',') != std::string_view::npos;
      points = points ||
               (!comma && cell.find('.') != std::string_view::npos && parse_number(trimmed(cell), false));
      layout_.decimal_comma = layout_.decimal_comma || (comma && parse_number(trimmed(cell), true));
    }
  layout_.decimal_comma = layout_.decimal_comma && !points;
  return {};
}

Error ImportTable::located(Error error) const {
  error.field = source_ + ": " + error.field;
  return error;
}

Result<CellPlace> ImportTable::find(const std::string& column) const {
  const auto& header = table_.header();
  const auto places = [&](std::string_view name) {
    std::vector<std::size_t> found;
    for (std::size_t k = 0; k < header.size(); ++k) {
      std::string_view given = trimmed(header[k]);
      if (given == name) found.push_back(k);
      // "# t" is a header that looks like a comment.
      if (k > 0 || given.find_first_not_of("#% ") == std::string_view::npos) continue;
      given.remove_prefix(given.find_first_not_of("#% "));
      if (found.empty() && given == name) found.push_back(k);
    }
    return found;
  };
  const std::string name(trimmed(column));
  for (const std::string& tried : {name, layout_.column_prefix + name}) {
    const auto found = places(tried);
    if (found.size() == 1) return CellPlace{found[0]};
    if (found.size() > 1)
      return fail(
          Fault::invalid, source_ + ": line 1",
          fmt::format("{} columns are called '{}': '{}#1' is the first of them", found.size(), tried, tried));
  }
  std::size_t number = 0;
  const auto suffix = [&](char open, std::string_view close) {
    const std::size_t at = name.rfind(open);
    if (at == std::string::npos || at == 0) return std::string();
    const auto [end, fault] = std::from_chars(name.data() + at + 1, name.data() + name.size(), number);
    const bool whole = fault == std::errc{} && std::string_view(end, name.data() + name.size()) == close;
    return whole ? name.substr(0, at) : std::string();
  };
  if (const auto found = places(suffix('#', "")); number > 0 && number <= found.size())
    return CellPlace{found[number - 1]};
  if (const std::string list = suffix('[', "]"); !list.empty()) {
    auto place = find(list);
    if (place) place->element = number;
    return place;
  }
  std::string names;
  for (const std::string& one : header) names += (names.empty() ? "'" : ", '") + one + "'";
  return fail(Fault::invalid, source_ + ": line 1", "column '" + column + "' is missing; there are " + names);
}

Result<bool> ImportTable::next() {
  while (true) {
    auto read = table_.next(row_);
    if (!read) {
      Error error = located(std::move(read.error()));
      if (rows_ > 0 && error.message.starts_with("has "))
        error.message += ": where columns came or went while it was written, split the table here";
      return tl::unexpected(std::move(error));
    }
    rows_ += *read;
    if (!*read || !std::ranges::equal(row_, table_.header())) return *read;
    --rows_;
    ++headers_;
  }
}

std::string_view ImportTable::row_text(CsvTable::Place place) const {
  const std::string_view text = table_.from(place);
  return text.substr(0, text.find_first_of("\r\n"));
}

bool ImportTable::pass_damaged(bool cell) {
  const std::string_view rest = table_.from(place());
  const std::size_t end = rest.find('\n');
  constexpr std::string_view blank("\r\n\t \0", 5);
  const bool last =
      end == std::string_view::npos || rest.find_first_not_of(blank, end) == std::string_view::npos;
  const bool zeros = rest.substr(0, end).find('\0') != std::string_view::npos;
  if (!zeros && !(last && (!cell || end == std::string_view::npos))) return false;
  damaged_lines_.push_back(line());
  go_to(place());
  table_.skip_line();
  return true;
}

std::string_view ImportTable::text(CellPlace place) const {
  const std::string_view cell = trimmed(row_[place.column]);
  return place.element ? element_of(cell, *place.element) : cell;
}

Result<std::optional<double>> ImportTable::number(CellPlace place, const std::string& column) const {
  const std::string_view cell = text(place);
  if (cell.empty()) return std::optional<double>();
  if (auto value = parse_number(cell, layout_.decimal_comma)) {
    if (layout_.no_value.empty() || !means_no_value(cell, layout_.no_value)) return value;
  } else if (!means_no_value(cell, layout_.no_value)) {
    return refuse(column, cell, "is no number");
  }
  return std::optional<double>(signals::unmeasured);
}

Result<std::int64_t> ImportTable::time() {
  if (time_places_.empty()) return std::llround(1e6 * static_cast<double>(rows_ - 1) / layout_.rate_hz);
  const std::string& column = layout_.time_columns[0].column;
  std::int64_t sum_us = 0;
  if (layout_.time_unit_ns == 0) {
    std::string stamp(text(time_places_[0]));
    for (std::size_t k = 1; k < time_places_.size(); ++k) stamp.append(" ").append(text(time_places_[k]));
    auto time = stamps_.read(stamp);
    if (!time) return refuse(column, stamp, time.error().message);
    return *time;
  }
  for (std::size_t k = 0; k < time_places_.size(); ++k) {
    const std::string_view cell = text(time_places_[k]);
    const auto part =
        time_us(cell, layout_.time_unit_ns, layout_.time_columns[k].scale, layout_.decimal_comma);
    if (!part || __builtin_add_overflow(sum_us, *part, &sum_us)) return refuse(column, cell, "is no time");
  }
  if (layout_.wraps_at == 0) return sum_us;
  const double unit_us = static_cast<double>(layout_.time_unit_ns) / 1000;
  return std::llround(unwrapped_(static_cast<double>(sum_us), layout_.wraps_at * unit_us));
}

tl::unexpected<Error> ImportTable::refuse(const std::string& column, std::string_view text,
                                          const std::string& what) const {
  const bool comma =
      !layout_.decimal_comma && text.find(',') != std::string_view::npos && parse_number(text, true);
  return fail(Fault::corrupt, source_ + ": line " + std::to_string(line()),
              "column '" + column + "': '" + std::string(text) + "' " + what +
                  (comma ? R"(; a decimal comma needs "decimal": ",")" : ""));
}

std::vector<std::string> ImportTable::notes() const {
  std::vector<std::string> notes;
  if (!table_.encoding().empty()) notes.push_back("the text is in " + table_.encoding());
  const CsvFormat& format = table_.format();
  if (layout_.format.separator == '\0' && (format.separator != ',' || layout_.decimal_comma))
    notes.push_back(fmt::format("the separator is {}, the decimal sign '{}'",
                                format.blanks ? "blanks" : std::string("'") + format.separator + "'",
                                layout_.decimal_comma ? ',' : '.'));
  if (headers_ > 0) notes.push_back(fmt::format("the header comes {} times more", headers_));
  if (!damaged_lines_.empty())
    notes.push_back(
        fmt::format("{} damaged rows are left out (cut, or with zero bytes), the first at line {}",
                    damaged_lines_.size(), damaged_lines_[0]));
  return notes;
}

}  // namespace joulecast::telemetry

#include "telemetry/import_table.h"

#include <fmt/format.h>
#include <re2/re2.h>

#include <algorithm>
#include <array>
#include <boost/algorithm/string/erase.hpp>
#include <boost/algorithm/string/predicate.hpp>
#include <boost/algorithm/string/replace.hpp>
#include <charconv>
#include <cmath>
#include <set>
#include <span>

#include "base/text.h"
#include "base/try.h"

namespace joulecast::telemetry {
namespace {

constexpr std::string_view decimal_digits = "0123456789";

constexpr std::array no_value_words = std::to_array<std::string_view>(
    {"null", "none",      "nil",         "n/a",           "n.a.",      "na",      "nan",
     "\\n",  "undefined", "nul",         "missing",       "no data",   "invalid", "error",
     "err",  "unknown",   "unavailable", "not available", "-nan(ind)", "nan(ind)"});

// A word for no value: the usual ones in any case and in brackets, a fault of a spreadsheet or of printf
// ("#REF!", "1.#IND"), or dashes, points and question marks alone ("--.--").
bool means_no_value(std::string_view text, const std::vector<std::string>& more) {
  if (std::ranges::find(more, text) != more.end()) return true;
  if (text.starts_with('#') || text.find(".#") != std::string_view::npos) return true;
  if (text.find_first_of("<([") == 0) text = text.substr(1, text.find_last_not_of(">)]"));
  return text.find_first_not_of("-.?*_") == std::string_view::npos ||
         std::ranges::any_of(no_value_words, [&](auto word) { return boost::iequals(text, word); });
}

// One of the numbers between the brackets of a list such as "[0.5, 1]" or "array('d', [0.5, 1])".
std::string_view element_of(std::string_view list, std::size_t index) {
  if (const std::size_t open = list.find('['); open != std::string_view::npos)
    list = list.substr(open, list.find_last_of(']') - open);
  static const RE2 element(R"(([^,;:| \t\n'"\[\](){}]+))");
  re2::StringPiece rest = list, found;
  while (RE2::FindAndConsume(&rest, element, &found))
    if (index-- == 0) return {found.data(), found.size()};
  return {};
}

// Of one column, in its unit.
std::optional<std::int64_t> time_us(std::string_view text, std::int64_t unit_ns, double scale,
                                    std::optional<double> number) {
  std::int64_t exact_ns = 0;  // ns since 1970 do not fit a double
  const auto [end, fault] = std::from_chars(text.data(), text.data() + text.size(), exact_ns);
  if (unit_ns == 1 && scale == 1 && fault == std::errc{} && end == text.data() + text.size())
    return exact_ns / 1000;
  const double us = number.value_or(signals::unmeasured) * scale * (static_cast<double>(unit_ns) / 1000);
  if (!(std::abs(us) <= static_cast<double>(latest_import_utime_us))) return std::nullopt;
  return std::llround(us);
}

// Of a number and its unit the number.
std::string_view without_unit(std::string_view cell) {
  return cell.substr(0, cell.find_last_of(decimal_digits) + 1);
}

const RE2& groups_of(char sign) {
  static const RE2 of_points(R"([-+]?[1-9]\d{0,2}(\.\d{3})+)"), of_commas(R"([-+]?[1-9]\d{0,2}(,\d{3})+)");
  return sign == '.' ? of_points : of_commas;
}

// Takes the signs between groups of three digits out and sets a decimal point; false where that is in doubt:
// one group without a decimal sign may be a fraction unless the table is `grouped`.
bool without_groups(std::string& number, bool decimal_comma, bool grouped) {
  boost::replace_all(number, "\u2212", "-");
  for (const char* sign : {"\u00a0", "\u202f", "'"}) boost::erase_all(number, sign);
  const char group = decimal_comma ? '.' : ',', decimal = decimal_comma ? ',' : '.';
  const std::size_t point = std::min(number.find(decimal), number.size());
  const auto end = number.begin() + static_cast<std::ptrdiff_t>(point);
  if (const auto groups = std::count(number.begin(), end, group); groups > 0) {
    if (groups == 1 && end == number.end() && !grouped) return false;
    if (!RE2::FullMatch(std::string_view(number).substr(0, point), groups_of(group))) return false;
    number.erase(std::remove(number.begin(), end, group), end);
  }
  std::ranges::replace(number, decimal, '.');
  return true;
}

// Empty for anything but one number, perhaps with signs between groups of three digits; "nan" and "inf" are
// numbers. `grouped`: one sign before three digits is between groups, too.
std::optional<double> parse_number(std::string_view text, bool decimal_comma, bool grouped) {
  std::string plain;
  if (decimal_comma || text.find_first_not_of("0123456789.eE+-") != std::string_view::npos) {
    if (!without_groups(plain = text, decimal_comma, grouped)) return std::nullopt;
    text = plain;
  }
  if (text.starts_with('+')) text.remove_prefix(1);
  double value = 0;
  const auto [end, fault] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (fault != std::errc{} || end != text.data() + text.size()) return std::nullopt;
  return value;
}

}  // namespace

double Unwrapped::operator()(double value, double period) {
  if (std::isnan(value)) return value;
  if (!std::isnan(last_)) shift_ -= period * std::round((value - last_) / period);
  last_ = value;
  return value + shift_;
}

Result<ImportTable> ImportTable::open(std::string_view text, const TableLayout& layout, std::string source) {
  const auto located = [&](Error error) {
    error.field = source + ": " + error.field;
    return error;
  };
  TRY_ASSIGN(auto table, CsvTable::open(text, layout.format).map_error(located));
  TRY_ASSIGN(auto stamps, StampReader::create(layout.utc_offset, layout.time_format).map_error(located));
  ImportTable opened(std::move(table), layout, std::move(stamps), std::move(source));
  for (const ColumnTerm& term : layout.time_columns) {
    TRY_ASSIGN(auto place, opened.find(term.column));
    opened.time_places_.push_back(place);
  }
  opened.detect_decimal();
  return opened;
}

// A sign is between groups if it is no number's decimal sign, and a column with it has integers below 1000.
void ImportTable::detect_decimal() {
  constexpr int probed = 200;                      // rows
  std::map<char, std::size_t> numbers, fractions;  // by sign
  std::map<char, std::set<std::size_t>> grouped;
  std::set<std::size_t> small;
  CsvTable rows = *this;
  for (int k = 0; k < probed && rows.next(row_).value_or(false); ++k)
    for (std::size_t column = 0; column < row_.size(); ++column) {
      const std::string_view cell = without_unit(trimmed(row_[column]));
      if (cell.empty()) continue;
      const std::size_t at = cell.find_last_of(",.");
      const char sign = at == std::string_view::npos ? '\0' : cell[at];
      if (cell.size() < 4 && sign == '\0') small.insert(column);
      if (sign == '\0' || !parse_number(cell, sign == ',', true)) continue;
      ++numbers[sign];
      if (RE2::FullMatch(cell, groups_of(sign)))
        grouped[sign].insert(column);
      else
        ++fractions[sign];
    }
  decimal_comma_ = numbers[','] > numbers['.'];
  const char sign = decimal_comma_ ? ',' : '.';
  grouped_ = fractions[sign] == 0 && std::ranges::find_first_of(grouped[sign], small) != grouped[sign].end();
  decimal_comma_ = decimal_comma_ != grouped_;
}

Result<CellPlace> ImportTable::find(const std::string& column) const {
  const auto places = [&](const std::string& name) {
    std::vector<std::size_t> found;
    for (std::size_t k = 0; k < header().size(); ++k) {
      const std::string_view given = trimmed(header()[k]);
      // "# t" is a header that looks like a comment.
      const std::size_t bare = k > 0 ? 0 : std::min(given.find_first_not_of("#% "), given.size());
      if (given == name || given.substr(bare) == name) found.push_back(k);
    }
    return found;
  };
  const std::string name(trimmed(column));
  const std::string here = source_ + ": line 1";
  for (const std::string& tried : {name, layout_.column_prefix + name}) {
    const auto found = places(tried);
    if (found.size() == 1) return CellPlace{found[0]};
    if (found.size() > 1)
      return fail(Fault::invalid, here,
                  fmt::format("columns {} and {} are both called '{}': write '{}#1' or '{}#2' in the mapping",
                              found[0] + 1, found[1] + 1, tried, tried, tried));
  }
  static const RE2 numbered(R"((.+)#(\d{1,9}))"), listed(R"((.+)\[(\d{1,9})\])");
  std::string named;
  std::size_t number = 0;
  if (RE2::FullMatch(name, numbered, &named, &number)) {
    const auto found = places(named);
    if (number > 0 && number <= found.size()) return CellPlace{found[number - 1]};
  }
  if (RE2::FullMatch(name, listed, &named, &number))
    return find(named).map([&](CellPlace place) { return CellPlace{place.column, number}; });
  constexpr std::size_t enough = 100;  // columns
  const auto shown = std::span(header()).first(std::min(enough, header().size()));
  return fail(Fault::invalid, here,
              fmt::format("column '{}' is missing; the table has '{}'{}", column, fmt::join(shown, "', '"),
                          shown.size() < header().size() ? " and more" : ""));
}

Result<bool> ImportTable::next() {
  while (true) {
    auto read = CsvTable::next(row_);
    if (!read) {
      Error error = std::move(read.error());
      error.field = source_ + ": " + error.field;
      if (error.message.starts_with("has "))
        error.message +=
            rows_ > 0
                ? R"(. If its columns changed during the recording, split the table here and name those of )"
                  R"(the second part in "header")"
            : layout_.format.header.empty()
                ? R"(. Name every column in "header", with "skip_lines": 1 to skip the present header; numbers )"
                  R"(with decimal commas need quotes or another separator)"
                : "";
      return tl::unexpected(std::move(error));
    }
    if (!*read) return false;
    const bool units = rows_ == 0 && !time_places_.empty() && std::ranges::none_of(row_, [](auto cell) {
                         return cell.find_first_of(decimal_digits) != std::string_view::npos;
                       });
    if (std::ranges::equal(row_, header())) {
      ++headers_;
    } else if (units) {
      notes_.push_back(fmt::format("line {} has no numbers, such as units: it is left out", line()));
    } else {
      ++rows_;
      return true;
    }
  }
}

Result<std::optional<std::int64_t>> ImportTable::next_time() {
  while (true) {
    const auto read = next();
    if (read && !*read && 2 * timeless_ > rows_) return tl::unexpected(*first_timeless_);
    if (read && !*read) return std::nullopt;
    const auto at = read.and_then([&](bool) { return time(); });
    if (at) return *at;
    if (read && !time_places_.empty() && means_no_value(text(time_places_[0]), layout_.no_value)) {
      if (timeless_++ == 0) first_timeless_ = at.error();
    } else if (!pass_damaged(read.has_value())) {
      return tl::unexpected(at.error());
    }
  }
}

bool ImportTable::pass_damaged(bool cell) {
  const std::string_view rest = place().text;
  const std::size_t end = rest.find('\n');
  constexpr std::string_view blank("\r\n\t \0", 5);
  const bool last =
      end == std::string_view::npos || rest.find_first_not_of(blank, end) == std::string_view::npos;
  const bool zeros = rest.substr(0, end).find('\0') != std::string_view::npos;
  if (!zeros && !(last && (!cell || end == std::string_view::npos))) return false;
  damaged_lines_.push_back(line());
  go_to(place());
  skip_line();
  return true;
}

std::string_view ImportTable::text(CellPlace place) const {
  const std::string_view cell = trimmed(row_[place.column]);
  return place.element ? element_of(cell, *place.element) : cell;
}

Result<std::optional<double>> ImportTable::number(CellPlace place, const std::string& column) {
  const std::string_view cell = text(place);
  if (cell.empty()) return std::optional<double>();
  auto value = parse_number(cell, decimal_comma_, grouped_);
  if ((!value || std::isnan(*value) || !layout_.no_value.empty()) && means_no_value(cell, layout_.no_value))
    return std::optional(signals::unmeasured);
  // The unit behind the number, the same on every row.
  const std::string_view number = value ? cell : without_unit(cell);
  const std::string_view unit = trimmed(cell.substr(number.size()));
  if (!value) value = parse_number(number, decimal_comma_, grouped_);
  if (!value) return refuse(column, cell, R"(is no number; "no_value" lists words for no value)");
  const auto [known, first] = units_.try_emplace(place.column, unit);
  if (known->second != unit)
    return refuse(column, cell, fmt::format("has the unit '{}', the rows before '{}'", unit, known->second));
  if (first && !unit.empty())
    notes_.push_back(
        fmt::format(R"(column '{}' is in '{}' by its cells: "scale" converts it)", column, unit));
  return value;
}

Result<std::int64_t> ImportTable::time() {
  if (time_places_.empty()) return std::llround(1e6 * static_cast<double>(rows_ - 1) / layout_.rate_hz);
  const std::string column = layout_.time_name();
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
    const auto number = parse_number(cell, decimal_comma_, grouped_);
    const auto part = time_us(cell, layout_.time_unit_ns, layout_.time_columns[k].scale, number);
    if (!part && number && *number > 0)
      return refuse(column, cell, "is later than the year 2100: choose a smaller unit");
    if (!part) return refuse(column, cell, "is no time");
    sum_us += *part;
  }
  if (layout_.wraps_at == 0) return sum_us;
  const double unit_us = static_cast<double>(layout_.time_unit_ns) / 1000;
  return std::llround(unwrapped_(static_cast<double>(sum_us), layout_.wraps_at * unit_us));
}

tl::unexpected<Error> ImportTable::refuse(const std::string& column, std::string_view text,
                                          const std::string& what) const {
  return fail(Fault::corrupt, fmt::format("{}: line {}", source_, line()),
              fmt::format("column '{}': '{}' {}", column, text, what));
}

std::vector<std::string> ImportTable::settings() const {
  std::vector<std::string> settings;
  if (!encoding().empty()) settings.push_back("the text is in " + encoding());
  if (decimal_comma_ || grouped_ || (layout_.format.separator == '\0' && format().separator != ','))
    settings.push_back(fmt::format(
        "the separator is {}, the decimal sign '{}'{}",
        format().separator == ' ' ? "blanks" : fmt::format("'{}'", format().separator),
        decimal_comma_ ? ',' : '.', grouped_ ? ", the other between groups of three digits" : ""));
  return settings;
}

std::vector<std::string> ImportTable::notes() const {
  std::vector<std::string> notes = notes_;
  if (format().skip_lines > layout_.format.skip_lines)
    notes.push_back(fmt::format("{} lines before the header are left out", format().skip_lines));
  if (timeless_ > 0)
    notes.push_back(
        fmt::format("rows without a time left out: {}, the first: {}", timeless_, first_timeless_->field));
  if (headers_ > 0) notes.push_back(fmt::format("repeated headers: {}", headers_));
  if (!damaged_lines_.empty())
    notes.push_back(
        fmt::format("damaged rows (truncated or with zero bytes) left out: {}, the first at line {}",
                    damaged_lines_.size(), damaged_lines_[0]));
  return notes;
}

}  // namespace joulecast::telemetry

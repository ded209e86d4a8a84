#include "battery/recording.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <array>
#include <boost/algorithm/string/predicate.hpp>
#include <functional>
#include <limits>
#include <optional>

#include "base/text.h"
#include "base/text_file.h"
#include "base/try.h"
#include "telemetry/csv_table.h"

namespace joulecast::battery {
namespace {

constexpr std::size_t max_file_bytes = std::size_t{256} << 20;
// Each column's name, then the names in other loggers; case is ignored.
constexpr std::array<std::string_view, 5> column_names[] = {
    {"t_s", "time_s", "t", "time"},
    {"I_A", "current_a", "I", "current"},
    {"V_V", "voltage_v", "V", "voltage", "U_V"},
    {"T_C", "temperature_c", "T_degC", "temp_c", "temperature"},
    {"cycle", "cycle_index", "cycle_number"}};
enum : std::size_t { time_column, current_column, voltage_column, temperature_column, cycle_column, columns };
constexpr std::size_t required_columns = 3;

// The position of each of our columns in the header.
Result<std::vector<std::optional<std::size_t>>> positions(const std::vector<std::string>& header) {
  std::vector<std::optional<std::size_t>> found(columns);
  for (std::size_t c = 0; c < columns; ++c) {
    for (const std::string_view name : column_names[c]) {
      const auto at = std::ranges::find_if(
          header, [&](std::string_view cell) { return boost::algorithm::iequals(trimmed(cell), name); });
      if (at == header.end()) continue;
      found[c] = static_cast<std::size_t>(at - header.begin());
      break;
    }
    if (!found[c] && c < required_columns)
      return invalid(std::string(column_names[c][0]),
                     fmt::format("is not among the columns of the header: \"{:.80}\"",
                                 fmt::format("{}", fmt::join(header, ","))));
  }
  return found;
}

namespace fs = std::filesystem;

// The CSV files of a folder, or those with a common beginning of their names; sorted.
Result<std::vector<fs::path>> files_of(const std::string& folder_or_prefix) {
  std::error_code ignored;
  const bool whole_folder = fs::is_directory(folder_or_prefix, ignored);
  const fs::path prefix(folder_or_prefix);
  const fs::path folder = whole_folder               ? prefix
                          : prefix.has_parent_path() ? prefix.parent_path()
                                                     : fs::path(".");
  std::string start = whole_folder ? "" : prefix.filename().string();
  if (!whole_folder && !start.ends_with('_')) start += '_';
  std::vector<fs::path> found;
  for (const auto& entry : fs::directory_iterator(folder, ignored)) {
    const std::string name = entry.path().filename().string();
    if (name.starts_with(start) && name.ends_with(".csv")) found.push_back(entry.path());
  }
  if (found.empty() || (!whole_folder && start == "_"))
    return fail(Fault::not_found, folder_or_prefix,
                "is no file, no folder with CSV files, and begins no name of the form <beginning>_*.csv");
  std::sort(found.begin(), found.end());
  return found;
}

// A file itself, or the files of one battery, which their names begin with, after `choose` has erased others.
Result<std::vector<fs::path>> chosen_files(const std::string& file_or_prefix, const char* none,
                                           void (*choose)(std::vector<fs::path>&)) {
  std::error_code ignored;
  const bool whole_folder = fs::is_directory(file_or_prefix, ignored);
  if (!whole_folder && fs::exists(file_or_prefix, ignored)) return std::vector<fs::path>{file_or_prefix};
  TRY_ASSIGN(auto found, files_of(file_or_prefix));
  choose(found);
  if (found.empty()) return fail(Fault::not_found, file_or_prefix, none);
  const auto battery = [](const fs::path& file) {
    const std::string name = file.filename().string();
    return name.substr(0, name.find('_'));
  };
  const std::string first = battery(found.front()), last = battery(found.back());
  if (!whole_folder || first == last) return found;
  return invalid(
      file_or_prefix,
      fmt::format("holds tests of several batteries, {} to {}, by what precedes the first _ in the names of "
                  "their files: name one by the beginning of its files, as {}",
                  first, last, (fs::path(file_or_prefix) / first).string()));
}

bool is_test(const fs::path& file) {
  return file.filename().string().ends_with("_data.csv");
}
bool is_random(const fs::path& file) {
  return file.filename().string().ends_with("_rw.csv");
}

}  // namespace

double Recording::charge_ah() const {
  double coulombs = 0;
  for (std::size_t row = 1; row < size(); ++row) coulombs += current_a[row] * duration_s(row);
  return coulombs / 3600;
}

Recording Recording::rows(std::ptrdiff_t first, std::ptrdiff_t end) const {
  const auto part = [&](const std::vector<double>& column) {
    return std::vector<double>(column.begin() + first, column.begin() + end);
  };
  return {name, part(time_s), part(current_a), part(voltage_v), part(temperature_c)};
}

Result<std::vector<Recording>> parse_recordings(std::string_view csv, const std::string& name) {
  TRY_ASSIGN(auto table, telemetry::CsvTable::open(csv, '\0'));
  TRY_ASSIGN(const auto at, positions(table.header()));
  std::vector<Recording> out;
  std::string cycle;
  std::vector<std::string_view> cells;
  for (;;) {
    const auto row = table.next(cells);
    // A logger that was cut off leaves a last line without its end.
    if (row ? !*row : table.place().text.find_first_of("\r\n") == std::string_view::npos) break;
    if (!row) return tl::unexpected(row.error());
    double value[columns] = {};
    for (std::size_t c = 0; c < cycle_column; ++c) {
      value[c] = std::numeric_limits<double>::quiet_NaN();
      if (!at[c]) continue;
      const std::string_view cell = trimmed(cells[*at[c]]);
      if (c == temperature_column && (cell.empty() || boost::algorithm::iequals(cell, "nan"))) continue;
      const auto read = to_number<double>(cell);
      if (!read)
        return invalid(
            std::string(column_names[c][0]),
            fmt::format("is \"{}\" in line {}, must be a finite number", cell.substr(0, 40), table.line()));
      value[c] = *read;
    }
    const std::string_view row_cycle = at[cycle_column] ? trimmed(cells[*at[cycle_column]]) : "";
    if (out.empty() || row_cycle != cycle) {
      cycle = row_cycle;
      out.emplace_back().name = cycle.empty() ? name : fmt::format("{}#{}", name, cycle);
    }
    Recording& recording = out.back();
    if (!recording.time_s.empty() && value[time_column] < recording.time_s.back())
      return invalid("t_s", fmt::format("is {} s in line {}, must not be before the line before, {} s",
                                        value[time_column], table.line(), recording.time_s.back()));
    // Loggers that round the time write an extra row at the end of a test in the same second.
    const bool again = !recording.time_s.empty() && value[time_column] == recording.time_s.back();
    std::vector<double>* const into[] = {&recording.time_s, &recording.current_a, &recording.voltage_v,
                                         &recording.temperature_c};
    for (std::size_t c = 0; c < cycle_column; ++c) {
      if (again) into[c]->pop_back();
      into[c]->push_back(value[c]);
    }
  }
  if (out.empty()) return invalid("t_s", "has no rows");
  for (const Recording& recording : out)
    if (recording.size() < 2) return invalid("t_s", fmt::format("{} has a single row", recording.name));
  return out;
}

Result<std::vector<Recording>> read_recordings(const std::filesystem::path& path) {
  std::error_code ignored;
  const auto bytes = std::filesystem::file_size(path, ignored);
  if (!ignored && bytes > max_file_bytes)
    return fail(Fault::too_large, path.string(),
                fmt::format("is {} bytes, must be at most {}", bytes, max_file_bytes));
  TRY_ASSIGN(const std::string text, read_text_file(path));
  return parse_recordings(text, path.filename().string()).map_error([&](Error error) {
    error.message = fmt::format("{}: {}", path.string(), error.message);
    return error;
  });
}

Result<std::vector<std::filesystem::path>> identification_files(const std::string& file_or_prefix) {
  return chosen_files(file_or_prefix, "stands for no tests: only for random discharges, *_rw.csv",
                      [](std::vector<fs::path>& found) {
                        std::erase_if(found, is_random);
                        if (std::ranges::any_of(found, is_test)) std::erase_if(found, std::not_fn(is_test));
                      });
}

Result<std::vector<std::filesystem::path>> discharge_files(const std::string& file_or_prefix) {
  return chosen_files(file_or_prefix, "stands for no random discharges, *_rw.csv: name the files",
                      [](std::vector<fs::path>& found) { std::erase_if(found, std::not_fn(is_random)); });
}

}  // namespace joulecast::battery

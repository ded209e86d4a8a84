#include "client/commands/print.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <nlohmann/json.hpp>

#include "base/json_number.h"

namespace joulecast::client {
namespace {

constexpr double joules_per_wh = 3600;

// Of UTF-8.
std::size_t characters(const std::string& text) {
  return static_cast<std::size_t>(std::ranges::count_if(text, [](char c) { return (c & 0xC0) != 0x80; }));
}

std::string cell(const Column& column, const Json& row) {
  if (column.text) return column.text(row);
  if (column.decimals < 0) return text_of(member_at(row, column.member));
  return number_of(row, column.member, column.decimals, column.scale);
}

}  // namespace

void print_rows(const Json& rows, const std::vector<Column>& columns, const char* none) {
  std::vector<std::string> lines(rows.size() + 1);
  for (const Column& column : columns) {
    std::vector<std::string> cells{column.title};
    for (const Json& row : rows) cells.push_back(cell(column, row));
    std::size_t width = 0;
    for (const std::string& text : cells) width = std::max(width, characters(text));
    for (std::size_t k = 0; k < cells.size(); ++k) {
      const std::string blanks(width - characters(cells[k]), ' ');
      if (!lines[k].empty()) lines[k] += "  ";
      lines[k] += column.decimals >= 0 ? blanks + cells[k] : cells[k] + blanks;
    }
  }
  for (const std::string& line : lines) fmt::print("{}\n", line.substr(0, line.find_last_not_of(' ') + 1));
  if (rows.empty() && none != nullptr) fmt::print("{}\n", none);
}

void print_json(const Json& document) {
  std::puts(document.dump(2).c_str());
}

const Json& member_at(const Json& object, std::string_view path) {
  static const Json none;
  const Json* at = &object;
  while (true) {
    if (!at->is_object()) return none;
    const auto found = at->find(std::string(path.substr(0, path.find('/'))));
    if (found == at->end()) return none;
    at = &*found;
    if (path.find('/') == std::string_view::npos) return *at;
    path.remove_prefix(path.find('/') + 1);
  }
}

std::string text_of(const Json& value) {
  return value.is_string() ? value.get<std::string>() : value.is_null() ? "-" : value.dump();
}

std::string without_sign_of_zero(std::string number) {
  if (number.find_first_of("123456789") == std::string::npos) number.erase(0, number.find_first_not_of("+-"));
  return number;
}

std::string number_text(double value, int decimals) {
  return std::isfinite(value) ? without_sign_of_zero(fmt::format("{:.{}f}", value, decimals)) : "-";
}

std::string number_of(const Json& object, std::string_view path, int decimals, double scale) {
  return number_text(scale * number_or_nan(member_at(object, path)), decimals);
}

std::string count_of(std::size_t count, std::string_view thing) {
  return fmt::format("{} {}{}", count, thing, count == 1 ? "" : "s");
}

std::string to_second(const Json& time) {
  if (!time.is_string()) return "-";
  std::string text = time.get<std::string>().substr(0, std::string_view("2026-11-22T16:45:00").size());
  std::ranges::replace(text, 'T', ' ');
  return text;
}

Column time_column(std::string title, std::string member) {
  return text_column(std::move(title), [member = std::move(member)](const Json& row) {
    return to_second(member_at(row, member));
  });
}

double in_unit(double joules, const std::string& unit) {
  return unit == "J" ? joules : joules / joules_per_wh;
}

std::string energy_text(double joules, const std::string& unit) {
  const double value = in_unit(joules, unit), size = std::fabs(value);
  if (unit == "J") return number_text(value, size < 1e4 ? 2 : 0);
  return number_text(value, size < 1 ? 4 : size < 100 ? 3 : 1);
}

std::string energy_per_way_text(double joules_per_m, const std::string& unit) {
  if (unit == "J") return number_text(joules_per_m, 1) + " J/m";
  return number_text(1e3 * in_unit(joules_per_m, unit), 1) + " Wh/km";
}

Column energy_column(const std::string& title, const std::string& member_j, const std::string& unit) {
  return {title + " " + unit, "", 0, 1, [member_j, unit](const Json& row) {
            return energy_text(number_or_nan(member_at(row, member_j)), unit);
          }};
}

void print_ledger_terms(const Json& terms_j, double whole_j, const std::string& unit) {
  for (const auto& [term, joules] : terms_j.items()) {
    const double value_j = effect_on_sum(term, number_or_nan(joules));
    const std::string text = energy_text(value_j, unit);
    if (text.find_first_of("123456789") == std::string::npos) continue;
    fmt::print("  {:<20} {:>12} {}", term, text, unit);
    if (whole_j > 0) fmt::print(" {:>7.1f} %", 100 * value_j / whole_j);
    fmt::print("\n");
  }
}

void print_back_test(const Json& test, const std::string& unit) {
  const auto percent = [](const char* title, const char* member) { return Column{title, member, 2, 100}; };
  print_rows(test["missions"], {{"tested on mission", "mission_id"},
                                energy_column("measured", "measured_j", unit),
                                percent("error before %", "before/relative"),
                                percent("error after %", "after/relative")});
  const auto fall = [&](const char* what, const char* before, const char* after, const char* interval) {
    fmt::print("{} {} % -> {} %", what, number_of(test, before, 2, 100), number_of(test, after, 2, 100));
    if (const Json& ends = member_at(test, interval); ends.is_array())
      fmt::print(", falls by {:.2f} % [{:.2f}, {:.2f}]",
                 100 * (number_at(test, before) - number_at(test, after)), 100 * number_or_nan(ends[0]),
                 100 * number_or_nan(ends[1]));
    fmt::print("\n");
  };
  fall("energy error", "error_before", "error_after", "improvement_ci");
  fall("power gap", "power_gap_before", "power_gap_after", "power_gap_fall_ci");
  if (member_at(test, "voltage_gap_before").is_number())
    fall("voltage gap", "voltage_gap_before", "voltage_gap_after", "voltage_gap_fall_ci");
  fmt::print("{}\n", test.value("improves", false) ? "it improves" : "no improvement is shown");
}

}  // namespace joulecast::client

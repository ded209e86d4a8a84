#pragma once

#include <cstddef>
#include <functional>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "base/error.h"

// Printing of answers as text.
namespace joulecast::client {

using Json = nlohmann::json;

struct Column {
  std::string title;
  std::string member = {};  // of a row, "energy/battery_j"
  int decimals = -1;        // of a number, aligned to the right; -1: the text of any value
  double scale = 1;
  std::function<std::string(const Json& row)> text = {};  // instead of the member
};
// A column of another text of a row.
[[nodiscard]] inline Column text_column(std::string title, std::function<std::string(const Json& row)> text) {
  return {std::move(title), {}, -1, 1, std::move(text)};
}

// Prints objects as a table as wide as its texts; `none` where there is no row.
void print_rows(const Json& rows, const std::vector<Column>& columns, const char* none = nullptr);

void print_json(const Json& document);

// The value of a member of a member; null where one is missing. It lives as long as `object`.
[[nodiscard]] const Json& member_at(const Json& object, std::string_view path);
// "-" for null.
[[nodiscard]] std::string text_of(const Json& value);
// "-0.0 %" -> "0.0 %".
[[nodiscard]] std::string without_sign_of_zero(std::string number);
// "-" for a value that is not finite.
[[nodiscard]] std::string number_text(double value, int decimals);
// The number at `path`, times `scale`; "-" if it is missing.
[[nodiscard]] std::string number_of(const Json& object, std::string_view path, int decimals,
                                    double scale = 1);
// "1 mission", "3 missions".
[[nodiscard]] std::string count_of(std::size_t count, std::string_view thing);
// "2026-11-22T16:45:00.25Z" -> "2026-11-22 16:45:00"; "-" for null.
[[nodiscard]] std::string to_second(const Json& time);
[[nodiscard]] Column time_column(std::string title, std::string member);

// Units of printed energies; --unit selects one, "Wh" or "J". JSON contains joules.
inline const std::vector<std::string> energy_units{"Wh", "J"};
[[nodiscard]] double in_unit(double joules, const std::string& unit);
// The number alone; "-" for a value that is not finite.
[[nodiscard]] std::string energy_text(double joules, const std::string& unit);
// "17.9 Wh/km" or "64.4 J/m".
[[nodiscard]] std::string energy_per_way_text(double joules_per_m, const std::string& unit);
// A column of energies; the unit is added to the title.
[[nodiscard]] Column energy_column(const std::string& title, const std::string& member_j,
                                   const std::string& unit);

// Prints missions as a table with their state in a column: "finished*" of an incomplete one, "finished~" of
// one with battery power that was not measured all the time.
void print_missions(Json missions, const std::vector<Column>& columns, const char* none = nullptr);

// The change of the sum by a term of a ledger: recovered energy is stated positive and subtracted.
inline double effect_on_sum(std::string_view term, double joules) {
  return term == "recovered" ? -joules : joules;
}
// Prints the terms that do not round to 0 and, where `whole_j` is above 0, their share in it.
void print_ledger_terms(const Json& terms_j, double whole_j, const std::string& unit);

// Prints the missions of a back-test with the errors before and after, and their means.
void print_back_test(const Json& test, const std::string& unit);

// An autonomy answer, of one robot or of a fleet, as tables for people. An answer in another dialect is
// printed as received. `unit` is that of energies (print.h).
void print_autonomy(const nlohmann::json& answer, const std::string& unit);

// Prints the JSON of a diagnosis, made offline or by a daemon, or of a comparison.
void print_diagnosis(const nlohmann::json& diagnosis, const std::string& unit = energy_units.front());

// `error` of an adoption as an error of `option`, which requested it; of --effect for a choice among effects.
Error of_option(Error error, const std::string& option);

}  // namespace joulecast::client

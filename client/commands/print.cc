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

std::string percent(double fraction, int places = 1) {
  return std::isfinite(fraction) ? fmt::format("{:.{}f} %", 100 * fraction, places) : "-";
}

std::string span(double s) {
  if (!std::isfinite(s)) return "-";
  const auto minutes = static_cast<long>(std::lround(s / 60));
  if (s < 60) return fmt::format("{:.0f} s", s);
  return minutes < 60 ? fmt::format("{} min", minutes)
                      : fmt::format("{} h {:02} min", minutes / 60, minutes % 60);
}

// Never rounds up to certainty.
std::string probability(double p) {
  if (!std::isfinite(p)) return "-";
  if (p > 0.9995) return "> 99.9 %";
  if (p < 0.0005) return "< 0.1 %";
  return fmt::format("{:.1f} %", 100 * p);
}

std::string where(const Json& place) {
  if (!place.is_object()) return "";
  if (!place["task"].is_number()) return "on the way to the charger";
  const std::string id = place.value("task_id", "");
  return fmt::format("in leg {}{}", place["task"].get<int>() + 1, id.empty() ? "" : " (" + id + ")");
}

void print_plan(const Json& plan, const std::string& unit) {
  const auto energy = [&](const Json& of, const char* name) {
    return energy_text(number_at(of, name), unit);
  };
  fmt::print(
      "\nPlan: probability {} of finishing with the reserve; {} {} expected ({} to {} {} at 5 and 95 %), "
      "{}\n",
      probability(number_at(plan, "success_probability")), energy(plan, "expected_energy_j"), unit,
      energy(plan["energy_j"], "p05"), energy(plan["energy_j"], "p95"), unit,
      span(number_at(plan, "duration_s")));
  Json stages = plan["legs"];
  int index = 0;
  for (Json& leg : stages) leg["title"] = fmt::format("{:>3} {}", ++index, leg.value("task_id", ""));
  if (plan["charger"].is_object()) {
    stages.push_back(plan["charger"]);
    stages.back()["title"] = "    to the charger";
  }
  const auto charge = [](const char* title, const char* quantile) {
    return Column{title, "", 0, 1, [quantile](const Json& stage) {
                    return percent(number_at(stage["arrival_charge"], quantile));
                  }};
  };
  print_rows(stages, {{"leg", "title"},
                      energy_column("energy", "expected_energy_j", unit),
                      {"ends", "", 0, 1, [](const Json& s) { return span(number_at(s, "ends_after_s")); }},
                      charge("5 %", "p05"),
                      charge("charge", "p50"),
                      charge("95 %", "p95"),
                      {"success", "", 0, 1,
                       [](const Json& s) { return probability(number_at(s, "success_probability")); }}});
  if (plan["fails_at"].is_object()) fmt::print("It probably fails {}.\n", where(plan["fails_at"]));
  if (!plan["fails_at"].is_object() && plan["likeliest_failure"].is_object() &&
      number_at(plan, "success_probability") < 0.999)
    fmt::print("If it fails, most likely {}.\n", where(plan["likeliest_failure"]));
  if (const Json& leave = plan["latest_departure"]; leave.is_object()) {
    const int after = leave["after_tasks"].get<int>();
    fmt::print("Latest departure to the charger with {} confidence: {}, at {}, or up to {} later.\n",
               percent(number_at(leave, "confidence"), 0),
               after == 0 ? "now" : fmt::format("after leg {}", after), span(number_at(leave, "at_s")),
               span(number_at(leave, "wait_s")));
  } else if (plan["charger"].is_object()) {
    fmt::print("The charger can no longer be reached with this confidence.\n");
  }
}

void print_one(const Json& a, const std::string& unit) {
  fmt::print("{} (model version {}): charge {}", a.value("robot_id", ""), a.value("model_version", 0),
             percent(number_at(a, "state_of_charge")));
  if (const double sd = number_at(a, "state_of_charge_sd"); sd > 0) fmt::print(" ± {}", percent(sd));
  fmt::print(", reserve {}, {} {} above the reserve\n", percent(number_at(a, "reserve_fraction")),
             energy_text(number_at(a, "usable_energy_j"), unit), unit);
  if (const Json& limitation = member_at(a, "state_of_charge_limitation"); limitation.is_string())
    fmt::print("{}\n", text_of(limitation));
  const double to_full_s = number_at(a, "time_to_charged_s");
  if (a["charging"].is_string() && a["charging"] == "full") {
    fmt::print("At the charger: full.\n");
  } else if (a["charging"].is_string()) {
    fmt::print("Charging: fully charged in {} ± {}.\n", span(to_full_s),
               span(number_at(a, "time_to_charged_sd_s")));
  } else if (std::isfinite(to_full_s)) {
    fmt::print("Time to charge fully: {} ± {}.\n", span(to_full_s),
               span(number_at(a, "time_to_charged_sd_s")));
  }
  const Json& c = a["consumption"];
  const std::string basis = c.value("basis", "");
  std::string driving = a.value("driving", "");
  std::ranges::replace(driving, '_', ' ');
  fmt::print("Driving: {}, {} m/s with {} kg: {}, {} W, estimated from ", driving,
             number_of(a, "pace/speed_m_s", 2), number_of(a, "payload_kg", 1),
             energy_per_way_text(number_at(c, "energy_per_m_j"), unit), number_of(c, "mean_power_w", 1));
  if (basis == "recent_missions")
    fmt::print("{} of this robot", count_of(c.value("missions", std::size_t{0}), "mission"));
  else
    fmt::print("{}", basis == "model" ? "its model (no missions yet)" : "missions of robots of its kind");
  if (c.value("siblings_pending", false)) fmt::print("; missions of robots of its kind are still being read");
  if (const Json& limitation = a["pace"]["limitation"]; limitation.is_string())
    fmt::print("\n{}", limitation.get<std::string>());
  fmt::print("\n  {:<10} {:>12} {:>12} {:>12}\n", "", "5 %", "median", "95 %");
  const Json &range = a["range_quantiles_m"], &time = a["run_time_quantiles_s"];
  fmt::print("  {:<10} {:>10} m {:>10} m {:>10} m\n", "range", number_of(range, "p05", 0),
             number_of(range, "p50", 0), number_of(range, "p95", 0));
  fmt::print("  {:<10} {:>12} {:>12} {:>12}\n", "run time", span(number_at(time, "p05")),
             span(number_at(time, "p50")), span(number_at(time, "p95")));
  if (const Json& drift = a["drift"]; drift.is_object())
    fmt::print("Changed {} ago: {} by {}.\n", count_of(drift.value("missions", std::size_t{0}), "mission"),
               drift.value("quantity", "energy"),
               percent(number_at(drift, "ratio_after") / number_at(drift, "ratio_before") - 1, 1));
  if (a["plan"].is_object()) print_plan(a["plan"], unit);
  if (const Json& best = a["minimum_energy"]; best.is_object()) {
    const double saved_s = number_at(best, "saved_s");
    fmt::print(
        "With minimum-energy profiles: probability {} of finishing, {} {} ({} {} less), {} {}; charge {} at "
        "the end.\n",
        probability(number_at(best, "success_probability")),
        energy_text(number_at(best, "expected_energy_j"), unit), unit,
        energy_text(number_at(best, "saved_j"), unit), unit, span(std::fabs(saved_s)),
        saved_s < 0 ? "longer" : "sooner", percent(number_at(best["arrival_charge"], "p50")));
  }
}

void print_fleet(const Json& robots) {
  Json rows = Json::array();
  for (const Json& row : robots) {
    const std::string id = row.value("robot_id", "");
    if (row.contains("problem")) {
      fmt::print("{}: {}\n", id, row["problem"].value("message", ""));
    } else if (row.contains("battery")) {
      fmt::print("{}: {}\n", id, row["battery"].dump());
    } else {
      rows.push_back(row);
    }
  }
  const auto time = [](const char* title, const char* quantile) {
    return Column{title, "", 0, 1,
                  [quantile](const Json& r) { return span(number_at(r["run_time_quantiles_s"], quantile)); }};
  };
  if (robots.empty()) fmt::print("no robot has a model\n");
  if (rows.empty()) return;
  print_rows(rows, {{"robot", "robot_id"},
                    {"charge %", "state_of_charge", 1, 100},
                    {"range m 5 %", "range_quantiles_m/p05", 0},
                    {"range m", "range_quantiles_m/p50", 0},
                    time("time 5 %", "p05"),
                    time("time", "p50"),
                    {"plan", "", 0, 1, [](const Json& r) {
                       return probability(number_or_nan(member_at(r, "plan/success_probability")));
                     }}});
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

void print_missions(Json missions, const std::vector<Column>& columns, const char* none) {
  bool partly = false;
  for (Json& mission : missions) {
    Json& state = mission["state"];
    if (mission.value("incomplete", false)) state = text_of(state) + "*";
    const Json& energy = mission["energy"];
    if (number_at(energy, "measured_s") < number_at(energy, "duration_s")) {
      state = text_of(state) + "~";
      partly = true;
    }
    if (!mission.value("annulled", Json()).is_null()) state = "annulled";
  }
  print_rows(missions, columns, none);
  if (partly) fmt::print("~ = battery power was measured for only a part of the time, or not at all\n");
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
  if (test["missions"].empty()) return;
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
    fall("gap of the battery voltage's changes", "voltage_gap_before", "voltage_gap_after",
         "voltage_gap_fall_ci");
  fmt::print("{}\n", test.value("improves", false) ? "it improves" : "no improvement is shown");
}

void print_autonomy(const Json& answer, const std::string& unit) {
  if (const auto rows = answer.find("robots"); rows != answer.end()) {
    print_fleet(*rows);
  } else if (answer.contains("range_quantiles_m")) {
    print_one(answer, unit);
  } else {
    print_json(answer);
  }
}

}  // namespace joulecast::client

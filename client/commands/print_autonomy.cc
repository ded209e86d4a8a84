#include "client/commands/print_autonomy.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "base/json_number.h"
#include "client/commands/print.h"

namespace joulecast::client {
namespace {

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

#include "client/commands/print_autonomy.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <nlohmann/json.hpp>
#include <string>

#include "base/json_number.h"

namespace joulecast::client {
namespace {

using Json = nlohmann::json;

std::string figure(double value, int places = 0) {
  return std::isfinite(value) ? fmt::format("{:.{}f}", value, places) : "-";
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

void print_stage(const std::string& title, const Json& stage) {
  const Json& charge = stage["arrival_charge"];
  fmt::print("  {:<24} {:>10} {:>9} {:>8} {:>8} {:>8} {:>10}\n", title.substr(0, 24),
             figure(number_at(stage, "expected_energy_j")), span(number_at(stage, "ends_after_s")),
             percent(number_at(charge, "p05")), percent(number_at(charge, "p50")),
             percent(number_at(charge, "p95")), probability(number_at(stage, "success_probability")));
}

void print_plan(const Json& plan) {
  fmt::print("\nPlan: {} to finish with the reserve; {} J expected ({} to {} J at 5 and 95 %), {}\n",
             probability(number_at(plan, "success_probability")),
             figure(number_at(plan, "expected_energy_j")), figure(number_at(plan["energy_j"], "p05")),
             figure(number_at(plan["energy_j"], "p95")), span(number_at(plan, "duration_s")));
  fmt::print("  {:<24} {:>10} {:>9} {:>8} {:>8} {:>8} {:>10}\n", "leg", "energy J", "ends", "5 %", "charge",
             "95 %", "reserve");
  int index = 0;
  for (const Json& leg : plan["legs"]) {
    print_stage(fmt::format("{:>3} {}", ++index, leg.value("task_id", "")), leg);
  }
  if (plan["charger"].is_object()) print_stage("    to the charger", plan["charger"]);
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

void print_one(const Json& a) {
  fmt::print("{} (model version {}): charge {}", a.value("robot_id", ""), a.value("model_version", 0),
             percent(number_at(a, "state_of_charge")));
  if (const double sd = number_at(a, "state_of_charge_sd"); sd > 0) fmt::print(" +- {}", percent(sd));
  fmt::print(", reserve {}, {} J above the reserve\n", percent(number_at(a, "reserve_fraction")),
             figure(number_at(a, "usable_energy_j")));
  const double to_full_s = number_at(a, "time_to_charged_s");
  if (a["charging"].is_string() && a["charging"] == "full") {
    fmt::print("At the charger: full.\n");
  } else if (a["charging"].is_string()) {
    fmt::print("Charging: fully charged in {} +- {}.\n", span(to_full_s),
               span(number_at(a, "time_to_charged_sd_s")));
  } else if (std::isfinite(to_full_s)) {
    fmt::print("Time to charge fully: {} +- {}.\n", span(to_full_s),
               span(number_at(a, "time_to_charged_sd_s")));
  }
  const Json& c = a["consumption"];
  const std::string basis = c.value("basis", "");
  std::string driving = a.value("driving", "");
  std::ranges::replace(driving, '_', ' ');
  fmt::print("Driving: {}, {} m/s with {} kg: {} J/m, {} W, estimated from ", driving,
             figure(number_at(a["pace"], "speed_m_s"), 2), figure(number_at(a, "payload_kg"), 1),
             figure(number_at(c, "energy_per_m_j"), 1), figure(number_at(c, "mean_power_w"), 1));
  if (basis == "recent_missions")
    fmt::print("{} missions of this robot", c.value("missions", 0));
  else
    fmt::print("{}", basis == "model" ? "its model: no missions yet" : "missions of robots of its kind");
  if (c.value("siblings_pending", false)) fmt::print("; missions of robots of its kind are still being read");
  if (const Json& limitation = a["pace"]["limitation"]; limitation.is_string())
    fmt::print("\n{}", limitation.get<std::string>());
  fmt::print("\n  {:<10} {:>12} {:>12} {:>12}\n", "", "5 %", "median", "95 %");
  const Json &range = a["range_quantiles_m"], &time = a["run_time_quantiles_s"];
  fmt::print("  {:<10} {:>10} m {:>10} m {:>10} m\n", "range", figure(number_at(range, "p05")),
             figure(number_at(range, "p50")), figure(number_at(range, "p95")));
  fmt::print("  {:<10} {:>12} {:>12} {:>12}\n", "run time", span(number_at(time, "p05")),
             span(number_at(time, "p50")), span(number_at(time, "p95")));
  if (const Json& drift = a["drift"]; drift.is_object())
    fmt::print("It used {} of the expected energy in its last {} missions.\n",
               percent(number_at(drift, "ratio"), 0), drift.value("missions", 0));
  if (a["plan"].is_object()) print_plan(a["plan"]);
  if (const Json& best = a["minimum_energy"]; best.is_object()) {
    const double saved_s = number_at(best, "saved_s");
    fmt::print("With minimum-energy profiles: {} to finish, {} J ({} J less), {} {}; charge {} at the end.\n",
               probability(number_at(best, "success_probability")),
               figure(number_at(best, "expected_energy_j")), figure(number_at(best, "saved_j")),
               span(std::fabs(saved_s)), saved_s < 0 ? "longer" : "sooner",
               percent(number_at(best["arrival_charge"], "p50")));
  }
}

void print_fleet(const Json& rows) {
  fmt::print("{:<20} {:>8} {:>12} {:>12} {:>11} {:>11} {:>10}\n", "robot", "charge", "range 5 %", "range",
             "time 5 %", "time", "plan");
  for (const Json& row : rows) {
    const std::string id = row.value("robot_id", "");
    if (row.contains("problem")) {
      fmt::print("{:<20} {}\n", id, row["problem"].value("message", ""));
    } else if (row.contains("battery")) {
      fmt::print("{:<20} {}\n", id, row["battery"].dump());
    } else {
      const Json &range = row["range_quantiles_m"], &time = row["run_time_quantiles_s"];
      fmt::print("{:<20} {:>8} {:>10} m {:>10} m {:>11} {:>11} {:>10}\n", id,
                 percent(number_at(row, "state_of_charge")), figure(number_at(range, "p05")),
                 figure(number_at(range, "p50")), span(number_at(time, "p05")), span(number_at(time, "p50")),
                 row["plan"].is_object() ? probability(number_at(row["plan"], "success_probability")) : "-");
    }
  }
}

}  // namespace

void print_autonomy(const Json& answer) {
  if (const auto rows = answer.find("robots"); rows != answer.end()) {
    print_fleet(*rows);
  } else if (answer.contains("range_quantiles_m")) {
    print_one(answer);
  } else {
    std::puts(answer.dump(2).c_str());
  }
}

}  // namespace joulecast::client

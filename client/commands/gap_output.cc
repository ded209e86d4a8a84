#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <numbers>

#include "base/json_number.h"
#include "client/commands/print.h"
#include "client/files.h"
#include "client/wrapped.h"
#include "gap/verdict/adopt.h"
#include "gap/verdict/diagnosis.h"
#include "gap/verdict/words.h"

namespace joulecast::client {
namespace {

constexpr std::size_t most_regions = 8;

std::string text(const Json& value) {
  return value.is_string() ? value.get<std::string>() : "";
}

double degrees(double rad) {
  return rad * 180 / std::numbers::pi;
}

// The figures of the command line have a hyphen for a minus.
std::string with_hyphens(std::string figures) {
  constexpr std::string_view minus = "−";
  for (auto at = figures.find(minus); at != std::string::npos; at = figures.find(minus, at))
    figures.replace(at, minus.size(), "-");
  return figures;
}

// "phase turning", "speed_m_s 0.2 to 0.4", with degrees where the variable is an angle.
std::string region_words(const Json& w) {
  const std::string variable = text(w["variable"]);
  if (w["from"].is_string()) return variable + " " + text(w["from"]);
  const double from = number_or_nan(w["from"]), to = number_or_nan(w["to"]);
  std::string range = gap::brief_range(from, to);
  const bool angle = variable.ends_with("_rad"), rate = variable.ends_with("_rad_s");
  if (angle || rate)
    range += fmt::format(" ({} deg{})", gap::brief_range(degrees(from), degrees(to)), rate ? "/s" : "");
  return variable + " " + with_hyphens(range);
}

// A sentence as an item of a list.
void print_item(const std::string& sentence) {
  fmt::print("  - {}\n", wrapped(sentence, help_width(), 4));
}

// "3.14", or "-" for a figure that is missing.
std::string figure(const Json& of, const char* name) {
  const Json& value = member_at(of, name);
  return value.is_number() ? fmt::format("{:.4g}", value.get<double>()) : "-";
}

double percent_at(const Json& of, std::string_view path) {
  return 100 * number_or_nan(member_at(of, path));
}

// "2.31 ± 0.02", or "2.312" without a standard deviation.
std::string with_deviation(const Json& value, const Json& sd) {
  const double deviation = number_or_nan(sd);
  return deviation > 0 ? with_hyphens(gap::with_deviation(number_or_nan(value), deviation, ""))
                       : fmt::format("{:.4g}", number_or_nan(value));
}

// A figure with the decimal places of a value with this deviation; "-" if it is missing.
std::string figure_like(const Json& sd, const Json& of, const char* name) {
  const double value = number_or_nan(member_at(of, name)), deviation = number_or_nan(sd);
  return std::isfinite(value) && deviation > 0 ? fmt::format("{:.{}f}", value, gap::places_of(deviation))
                                               : figure(of, name);
}

void print_checks(const Json& d) {
  for (const Json& note : member_at(d, "notes"))
    fmt::print("note: {}\n", wrapped(text(note), help_width(), 2));
  const Json& checks = member_at(d, "checks");
  if (checks.empty()) return;
  fmt::print("checks of the recordings:\n");
  for (const Json& check : checks)
    print_item(text(check["says"]) + (check["contradicted"] != true    ? ""
                                      : check.contains("few_missions") ? " It is not used there."
                                                                       : " It is not used below."));
}

// " (noise floor 3.3 %)" of a gap, if it is known.
std::string in_brackets(const char* words, const Json& gap) {
  const Json& noise = member_at(gap, "noise_floor");
  return noise.is_number() ? fmt::format(" ({}{:.1f} %)", words, 100 * noise.get<double>()) : "";
}

void print_gap(const Json& d) {
  const bool of_nothing = d["power"] == gap::name_of(gap::PowerSource::none),
             of_motors = d["power"] == gap::name_of(gap::PowerSource::motors);
  if (of_nothing && member_at(d, "channels").empty()) {
    fmt::print("gap: not available without power\n");
  } else if (of_nothing) {
    fmt::print("gap: no power was recorded; diagnosed from {}\n",
               d["motor_channels"] == true ? "torques" : "voltages and motion");
  } else if (member_at(d, "gap/energy_relative").is_null()) {
    fmt::print("gap: not available; the model needs the wheels' motion\n");
  } else {
    fmt::print("gap: {} of the measured energy; mean absolute power error {:.1f} %{}{}\n",
               without_sign_of_zero(fmt::format("{:+.1f} %", percent_at(d, "gap/energy_relative"))),
               percent_at(d, "gap/power_absolute_relative"), in_brackets("noise floor ", d["gap"]),
               of_motors ? ", of the motors' power" : "");
  }
  std::string others;
  for (const auto& [name, gap] : member_at(d, "channels").items())
    if (name != "battery_power" && !(of_motors && name == "motor_power"))
      others += fmt::format("{}{} {:.1f} %{}", others.empty() ? "" : ", ", name,
                            percent_at(gap, "absolute_relative"), in_brackets("", gap));
  if (!others.empty()) fmt::print("error of other readings (noise floor): {}\n", others);
}

// Terms of a linear regression of power: in the data, in the model, and in the one with the effects found.
void print_terms(const Json& d) {
  const Json& baseline = member_at(d, "baseline");
  if (!baseline.is_object()) return;
  constexpr auto row = "  {:<14}{:>20}{:>13}{:>16}  {}\n";
  if (!baseline["terms"].empty())
    fmt::print(row, "power by term", "in the data", "robot file", "this diagnosis", "unit");
  for (const auto& [name, term] : baseline["terms"].items())
    fmt::print(row, name, with_deviation(term["value"], term["sd"]), figure_like(term["sd"], term, "model"),
               figure_like(term["sd"], term, "explained"), text(term["unit"]));
  const Json& reasons = member_at(d, "reasons");
  for (const Json& says : baseline["says"])
    if (std::ranges::find(reasons, says) == reasons.end()) print_item(text(says));
}

// "robot file 75.1 %, this diagnosis 12.4 %, linear regression 18.5 %, noise floor 7.8 %"
void print_held_out(const Json& d) {
  const Json &s = member_at(d, "shrinkage"), &baseline = member_at(d, "baseline");
  const bool found = !d["effects"].empty() && member_at(s, "held_out_before").is_number();
  std::string line;
  const auto add = [&](const char* name, const Json& value) {
    if (!value.is_number()) return;
    line += fmt::format("{}{} {:.1f} %", line.empty() ? "" : ", ", name, 100 * value.get<double>());
  };
  if (baseline.is_object()) {
    add("robot file", baseline["unchanged_model_held_out"]);
    add("this diagnosis", baseline["explanation_held_out"]);
    add("linear regression", baseline["held_out"]);
  } else if (found) {
    add("robot file", s["held_out_before"]);
    add("this diagnosis", s["held_out_after"]);
  }
  if (line.empty()) return;
  add("noise floor", d["gap"]["noise_floor"]);
  fmt::print("power error on held-out data: {}\n", line);
  if (!found) return;
  const double low = number_or_nan(s["ci"][0]), high = number_or_nan(s["ci"][1]);
  fmt::print("  the effects close {} % of the gap (95 % interval {:.0f} to {:.0f} %){}\n",
             number_text(percent_at(s, "fraction"), 0), 100 * low, 100 * high,
             low < 0 && high >= 0 ? ": they may not help" : "");
}

void print_corrections(const Json& d) {
  const Json& corrections = member_at(d, "corrections");
  if (corrections.empty()) return;
  fmt::print("values of the robot file that fit:\n");
  for (const Json& c : corrections)
    fmt::print("  {} {} instead of {}\n", text(c["parameter"]), with_deviation(c["fits"], c["sd"]),
               figure(c, "file"));
}

void print_where(const Json& regions) {
  if (!regions.empty()) fmt::print("where the gap arises (95 % interval); regions overlap:\n");
  for (std::size_t k = 0; k < regions.size() && k < most_regions; ++k) {
    const Json& w = regions[k];
    fmt::print("  {}, {}: {:+.0f} % of the gap ({:.0f} to {:.0f} %)", text(w["channel"]), region_words(w),
               percent_at(w, "share"), 100 * number_or_nan(w["ci"][0]), 100 * number_or_nan(w["ci"][1]));
    if (w.contains("time_share")) fmt::print(" in {:.0f} % of the time", percent_at(w, "time_share"));
    fmt::print("\n");
  }
}

void print_next_drives(const Json& drives) {
  std::string separated;
  for (const Json& n : drives) {
    if (text(n["separates"]) != separated)
      fmt::print("next drive, to distinguish {}:\n", separated = text(n["separates"]));
    const Json& evidence = n["expected_log_evidence"];
    print_item(
        text(n["manoeuvre"]) +
        (evidence.is_null() ? "" : fmt::format(" (expected log evidence {:.1f})", number_or_nan(evidence))));
  }
}

void print_adoption(const Json& d) {
  const Json& adoption = member_at(d, "adoption");
  if (!member_at(adoption, "effects").empty() && adoption["refusal"].is_string())
    fmt::print("not to be adopted: {}\n", wrapped(text(adoption["refusal"]), help_width(), 2));
}

void print_effect(const Json& e) {
  fmt::print("  {}: probability {}", text(e["id"]), gap::probability_text(number_or_nan(e["probability"])));
  if (!e["alternatives"].empty() && e.contains("group"))
    fmt::print(" ({} with its alternatives)", gap::probability_text(number_or_nan(e["group"])));
  if (number_or_nan(member_at(e, "power_w")) > 0)
    fmt::print(", {:.3g} W on average", number_or_nan(e["power_w"]));
  if (const double share = percent_at(e, "share"); share > 100)
    fmt::print("; without it the error is larger than with the robot file");
  else if (std::isfinite(share))
    fmt::print("; without it {} % of the closed gap returns", number_text(share, 0));
  fmt::print("\n");
  for (const bool estimated : {true, false}) {
    for (const auto& [name, p] : e["parameters"].items()) {
      const double value = number_or_nan(p["value"]);
      if (p["sd"].is_number() != estimated || (!estimated && value == 0 && name != "side")) continue;
      fmt::print("    {} = {}{}{}\n", name, with_deviation(p["value"], p["sd"]),
                 p["unit"] == "1" ? "" : " " + text(p["unit"]),
                 p["unit"] == "rad" ? fmt::format(" ({:.3g} deg)", degrees(value))
                 : name == "side"   ? (value < 0.5 ? " (right)" : " (left)")
                                    : "");
    }
  }
  if (const Json& others = e["alternatives"]; !others.empty()) {
    std::string names;
    for (const Json& other : others) names += (names.empty() ? "" : ", ") + text(other);
    fmt::print("    or: {}\n", wrapped(names, help_width(), 8));
  }
  if (const std::string look = text(member_at(e, "workshop")); !look.empty())
    fmt::print("    to check: {}\n", wrapped(look, help_width(), 6));
}

// " scrub stribeck", or " none".
std::string names_in(const Json& ids) {
  std::string names;
  for (const Json& id : ids) names += " " + text(id);
  return names.empty() ? " none" : names;
}

void print_limits(const Json& d) {
  fmt::print("limits:\n");
  for (const Json& limit : d["limits"]) print_item(text(limit));
}

// What a diagnosis of runs has in addition.
void print_runs(const Json& d) {
  fmt::print("modelled energies from {}; the runs scatter by {:.1f} % in addition to any cause\n",
             member_at(d, "model/given") == true ? "the table" : "the robot file",
             percent_at(d, "scatter/run"));
  print_limits(d);
}

std::string per_way(const Json& joules_per_m, const std::string& unit) {
  return energy_per_way_text(number_or_nan(joules_per_m), unit);
}

std::string signed_per_way(const Json& joules_per_m, const std::string& unit) {
  return (number_or_nan(joules_per_m) < 0 ? "" : "+") + per_way(joules_per_m, unit);
}

// What a comparison of groups has in addition.
void print_comparison(const Json& d, const std::string& unit) {
  fmt::print("groups:\n");
  for (const Json& g : d["groups"]) {
    fmt::print("  {:<14} {}, {:.0f} m", text(g["name"]),
               count_of(g["missions"].get<std::size_t>(), "mission"), number_or_nan(g["way_m"]));
    if (g["energy_per_m_j"].is_number())
      fmt::print(": measured {}, modelled with the common effects {}", per_way(g["energy_per_m_j"], unit),
                 per_way(g["model_per_m_j"], unit));
    fmt::print("\n");
  }
  for (const Json& e : d["strengths"]) {
    fmt::print("{} {} above the group where it is weakest:\n", text(e["id"]), text(e["parameter"]));
    for (const Json& g : d["groups"]) {
      const Json& s = e["groups"][text(g["name"])];
      fmt::print("  {:<14} {}{}", text(g["name"]), with_deviation(s["value"], s["sd"]),
                 e["unit"] == "1" ? "" : " " + text(e["unit"]));
      if (s["energy_per_m_j"].is_number()) fmt::print(" ({})", signed_per_way(s["energy_per_m_j"], unit));
      fmt::print("\n");
    }
  }
  if (const Json& by = d["difference"]; !by.is_null()) {
    fmt::print("{} uses {} more than {}: {} by motion and load", text(by["to"]),
               per_way(by["energy_per_m_j"], unit), text(by["from"]),
               signed_per_way(by["by_motion_j"], unit));
    for (const Json& e : d["strengths"])
      fmt::print(", {} by {}", signed_per_way(by["by_effect_j"][text(e["id"])], unit), text(e["id"]));
    fmt::print(", {} unexplained\n", signed_per_way(by["unexplained_j"], unit));
  }
  fmt::print("effects common to all groups:{}\n", names_in(d["common"]));
  print_limits(d);
}

}  // namespace

void print_diagnosis(const Json& d, const std::string& unit) {
  fmt::print("{}: {}, {}{}\n", text(d["robot_id"]), count_of(d["missions"].get<std::size_t>(), "mission"),
             count_of(d["samples"].get<std::size_t>(), "sample"),
             d["motor_channels"] == true || d["power"] != gap::name_of(gap::PowerSource::battery)
                 ? ""
                 : " (no motor channels: diagnosed from battery power and motion alone)");
  print_checks(d);
  if (d.contains("common"))
    fmt::print("gap and errors of the robot file: after a fit of all that the groups have in common\n");
  print_gap(d);
  // The other verdicts have no probability of their own.
  const bool own_probability = d["verdict"] != "inconclusive" && d["verdict"] != "not_this_robot";
  fmt::print("verdict: {}{}\n", text(d.value("verdict_title", d["verdict"])),
             own_probability
                 ? " (probability " + gap::probability_text(number_or_nan(d["verdict_probability"])) + ")"
                 : "");
  for (const Json& reason : member_at(d, "reasons")) print_item(text(reason));
  for (const Json& e : d["effects"]) print_effect(e);
  print_held_out(d);
  print_terms(d);
  print_corrections(d);
  print_where(d["where"]);
  print_next_drives(d["next_drive"]);
  print_adoption(d);
  const std::string kind = text(member_at(d, "kind"));
  if (kind == "mission_energies") print_runs(d);
  if (kind == "comparison") print_comparison(d, unit);
}

Error of_option(Error error, const std::string& option) {
  if (error.fault == Fault::conflict) {
    error.message = "refused: " + error.message;
    if (error.field.empty()) error.message += "; --force overrides it";
  }
  error.field = error.field == "effect" ? "--effect" : option;
  return error;
}

}  // namespace joulecast::client

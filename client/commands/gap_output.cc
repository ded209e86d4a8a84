#include "client/commands/gap_output.h"

#include <fmt/format.h>

#include <cmath>
#include <ctime>
#include <filesystem>
#include <nlohmann/json.hpp>

#include "client/files.h"
#include "client/wrapped.h"
#include "gap/adopt.h"
#include "gap/chart.h"
#include "robot/robot_file.h"

namespace joulecast::client {

namespace {

using nlohmann::json;

constexpr std::size_t most_regions = 8;

double number(const json& value) {
  return value.is_number() ? value.get<double>() : std::nan("");
}

std::string text(const json& value) {
  return value.is_string() ? value.get<std::string>() : "";
}

std::string range_of(const json& region) {
  if (region["from"].is_string()) return text(region["from"]);
  std::string range = gap::brief_range(number(region["from"]), number(region["to"]));
  constexpr std::string_view minus = "−";  // other figures of the command line have a hyphen
  for (auto at = range.find(minus); at != std::string::npos; at = range.find(minus, at))
    range.replace(at, minus.size(), "-");
  return range;
}

void print_shrinkage(const json& s) {
  const double low = number(s["ci"][0]), high = number(s["ci"][1]);
  fmt::print("held-out gap: {:.1f} % -> {:.1f} %, shrinks by {:.0f} % [{:.0f}, {:.0f}]",
             100 * number(s["held_out_before"]), 100 * number(s["held_out_after"]),
             100 * number(s["fraction"]), 100 * low, 100 * high);
  if (s["remaining_over_noise_floor"].is_number())
    fmt::print("; remaining is {:.1f} noise floors", number(s["remaining_over_noise_floor"]));
  fmt::print("\n");
  if (low < 0 && high >= 0) fmt::print("  that the effects help on missions left out is not sure\n");
}

}  // namespace

void print_effect(const json& e) {
  fmt::print("  {}: probability {:.2f}, closes {:.0f} % of the gap\n", text(e["id"]),
             number(e["probability"]), 100 * number(e["share"]));
  for (const bool estimated : {true, false}) {
    for (const auto& [name, p] : e["parameters"].items()) {
      if (p["sd"].is_number() != estimated) continue;
      fmt::print("    {} = {:.4g}{}{}\n", name, number(p["value"]),
                 estimated ? fmt::format(" +- {:.2g}", number(p["sd"])) : "",
                 p["unit"] == "1" ? "" : " " + text(p["unit"]));
    }
  }
  for (const json& other : e["alternatives"]) fmt::print("    cannot be told from {}\n", text(other));
}

void print_diagnosis(const json& d) {
  fmt::print(
      "{}: {} missions, {} samples{}\n", text(d["robot_id"]), d["missions"].get<std::size_t>(),
      d["samples"].get<std::size_t>(),
      d["motor_channels"] == true ? "" : " (no motor channels: judged from battery power and motion alone)");
  if (d["power"] == gap::name_of(gap::PowerSource::none)) {
    fmt::print("gap: no power was recorded; judged from torques\n");
  } else {
    fmt::print("gap: energy {:+.1f} %, absolute power {:.1f} % (noise floor {:.1f} %){}\n",
               100 * number(d["gap"]["energy_relative"]), 100 * number(d["gap"]["power_absolute_relative"]),
               100 * number(d["gap"]["noise_floor"]),
               d["power"] == gap::name_of(gap::PowerSource::motors)
                   ? ", of the motors' power with the file's idle power"
                   : "");
  }
  fmt::print("verdict: {} (probability {:.2f})\n", text(d["verdict"]), number(d["verdict_probability"]));
  for (const json& reason : d.value("reasons", json::array()))
    fmt::print("  {}\n", wrapped(text(reason), help_width(), 2));
  for (const json& e : d["effects"]) print_effect(e);
  if (!d["effects"].empty()) print_shrinkage(d["shrinkage"]);
  if (!d["where"].empty()) fmt::print("where:\n");
  for (std::size_t k = 0; k < d["where"].size() && k < most_regions; ++k) {
    const json& w = d["where"][k];
    fmt::print("  {}, {} {}: {:+.0f} % of the gap [{:.0f}, {:.0f}]\n", text(w["channel"]),
               text(w["variable"]), range_of(w), 100 * number(w["share"]), 100 * number(w["ci"][0]),
               100 * number(w["ci"][1]));
  }
  for (const json& n : d["next_drive"]) {
    const json& evidence = n["expected_log_evidence"];
    fmt::print("next drive, to tell {}: {}{}\n", text(n["separates"]), text(n["manoeuvre"]),
               evidence.is_null() ? "" : fmt::format(" (log evidence +{:.1f})", number(evidence)));
  }
}

Exit write_adopted(std::span<const robot::AdoptedEffect> found, robot::RobotModel robot,
                   const std::string& path) {
  const auto extended = gap::with_effects(std::move(robot), found);
  return extended ? write_robot(*extended, path) : report(extended.error());
}

Exit write_robot(const robot::RobotModel& robot, const std::string& path) {
  const auto written = write_file(path, robot::to_json_text(robot) + '\n');
  return written ? Exit::ok : report(written.error());
}

gap::ReportOrigin report_origin(const std::vector<std::string>& sources, const std::string& robot_file) {
  gap::ReportOrigin origin;
  for (const std::string& source : sources)
    origin.sources.push_back(std::filesystem::path(source).filename().string());
  origin.model = std::filesystem::path(robot_file).filename().string();
  const std::time_t now = std::time(nullptr);
  std::tm utc{};
  gmtime_r(&now, &utc);
  origin.made_at = fmt::format("{:04}-{:02}-{:02} {:02}:{:02}", utc.tm_year + 1900, utc.tm_mon + 1,
                               utc.tm_mday, utc.tm_hour, utc.tm_min);
  origin.software = "joulecast " JOULECAST_VERSION;
  return origin;
}

}  // namespace joulecast::client

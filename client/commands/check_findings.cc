#include "client/commands/check_findings.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <nlohmann/json.hpp>
#include <ranges>

#include "client/commands/server_answer.h"
#include "client/wrapped.h"
#include "signals/gaps.h"
#include "telemetry/impossible.h"
#include "windows/track.h"

namespace joulecast::client {
namespace {

// Requirements of lcmtypes/robot_telemetry_t.lcm on a robot.
constexpr double least_rate_hz = 0.1, greatest_rate_hz = 500;
constexpr double clock_tolerance_s = 1;
constexpr double strange_clock_s = 86400;  // of a log; its recorder's clock may be wrong, too

std::string far_text(double seconds) {
  return seconds < 86400 ? fmt::format("{:.6g} s", seconds) : fmt::format("{:.0f} days", seconds / 86400);
}

}  // namespace

void judge(const std::string& channel, const telemetry::ChannelTally& tally, bool live, Findings& findings) {
  const auto add = [&](bool fault, const char* field, std::string says, std::optional<double> value = {}) {
    findings.push_back({fault, channel, field, std::move(says), value});
  };
  for (const auto& [reason, fault] : tally.faults)
    add(true, "",
        fmt::format("{} of {} messages {}; the last: {}", fault.first, tally.messages, reason, fault.second),
        static_cast<double>(fault.first));
  if (tally.senders.size() > 1)
    add(true, "",
        fmt::format("{} senders, {} and {}{}: each robot needs its own robot_id", tally.senders.size(),
                    to_string(tally.senders[0]), to_string(tally.senders[1]),
                    tally.senders.size() > 2 ? ", ..." : ""),
        static_cast<double>(tally.senders.size()));
  const double ahead_s = 1e-6 * static_cast<double>(tally.clock_ahead_us);
  if (std::abs(ahead_s) > (live ? clock_tolerance_s : strange_clock_s))
    add(live && std::abs(ahead_s) > 3600, "utime",
        fmt::format("time stamps are {} {} {}", far_text(std::abs(ahead_s)),
                    ahead_s > 0 ? "ahead of" : "behind",
                    live ? "this computer's clock" : "the time of the recording"),
        ahead_s);
  if (tally.subject != telemetry::Subject::telemetry) return;
  const double rate_hz = tally.rate_hz();
  if (tally.messages > 1 && (rate_hz < 0.9 * least_rate_hz || rate_hz > 1.1 * greatest_rate_hz))
    add(false, "",
        fmt::format("{:.4g} messages a second; {} to {} are expected: is the unit of the times right?",
                    rate_hz, least_rate_hz, greatest_rate_hz),
        rate_hz);
  if (std::string slow = telemetry::slow_stream(rate_hz); tally.bridged > 0 && !slow.empty())
    add(false, "", std::move(slow), rate_hz);
  const telemetry::SequenceCounters& s = tally.sequence;
  const auto counted = [&](std::uint64_t count, bool fault, const char* field, const char* thing,
                           const char* says) {
    if (count > 0) add(fault, field, count_of(count, thing) + says, static_cast<double>(count));
  };
  // A publisher that never counts looks like one that boots at every message.
  if (s.restarts > 1 && 2 * s.restarts > s.received)
    add(true, "sequence",
        fmt::format(
            "did not increase in {} of {} messages, so that losses cannot be counted: add 1 for each message",
            s.restarts, tally.messages),
        static_cast<double>(s.restarts));
  else
    counted(s.restarts, false, "sequence", "restart", ": the robot booted, or two programs publish");
  counted(s.missing - std::min(s.missing, s.late), false, "sequence", "message",
          " missing, according to the sequence numbers");
  counted(s.duplicate, false, "sequence", "message", " received more than once");
  counted(tally.gaps, false, "utime", "gap", " too long to interpolate: no energy is counted there");
  counted(s.clock_backward, true, "utime", "time", " the robot's clock stood still or was set back");
  counted(s.clock_forward, false, "utime", "time", " the robot's clock jumped forward");
  const double silence_s = 1e-6 * static_cast<double>(tally.longest_silence_us);
  if (live && rate_hz > 0 && silence_s > signals::longest_bridged_s(1 / rate_hz))
    add(false, "", fmt::format("no message for {:.3g} s", silence_s), silence_s);
}

void judge(telemetry::RecordingSet recordings, const robot::RobotModel& robot, Findings& findings) {
  for (const plausibility::Check& check : plausibility::drop_impossible(recordings, robot))
    findings.push_back({check.value >= telemetry::mistaken_share * static_cast<double>(recordings.samples),
                        recordings.robot_id, check.channel, check.id + ": " + check.says, check.value});
  for (const plausibility::Check& check : plausibility::check_recordings(recordings, robot))
    findings.push_back({check.contradicted, recordings.robot_id, check.channel, check.id + ": " + check.says,
                        std::isfinite(check.value) ? std::optional(check.value) : std::nullopt});
  for (const std::string& note : recordings.notes) findings.push_back({false, recordings.robot_id, "", note});
}

void judge_fields(const std::string& channel, const telemetry::ChannelTally& tally, bool robot_file,
                  Findings& findings) {
  if (tally.subject != telemetry::Subject::telemetry || tally.messages < 20) return;
  double fastest = 0;
  for (const telemetry::FieldTally& field : tally.fields)
    if (field.name.starts_with("wheel_velocity") && field.changes > 0)
      fastest = std::max({fastest, field.greatest, -field.least});
  if (fastest <= windows::moving_rad_s)
    findings.push_back({false, channel, "wheel_velocity",
                        fmt::format("no wheel turned faster than {:.2g} rad/s: nothing else can be checked; "
                                    "is its unit rad/s at the wheel?",
                                    fastest),
                        fastest});
  const std::uint64_t samples = tally.sequence.received;
  if (const std::uint64_t lacking = samples - std::min(samples, tally.powered); lacking > 0)
    findings.push_back(
        {false, channel, "battery_voltage, battery_current",
         fmt::format("one of them is missing in {} of {} messages, in which energy is the model's", lacking,
                     samples),
         static_cast<double>(lacking)});
  if (robot_file || fastest <= windows::moving_rad_s) return;
  for (const telemetry::FieldTally& field : tally.fields) {
    const bool is_stated = field.name.starts_with("velocity_command") || field.name.starts_with("payload");
    if (is_stated || field.measured < 20 || field.changes > 0) continue;
    findings.push_back({field.last == 0, channel, field.name,
                        fmt::format("is {:.6g} in all {} messages although the robot moves; send NaN for a "
                                    "value that is not measured",
                                    field.last, field.measured),
                        field.last});
  }
}

void judge(const telemetry::Import& import, const std::string& table, Findings& findings) {
  const telemetry::ImportReport& report = import.report;
  const auto counted = [&](std::size_t count, const std::string& field, const std::string& says) {
    if (count > 0)
      findings.push_back(
          {false, table, field, fmt::format("{} {}", count, says), static_cast<double>(count)});
  };
  counted(report.rows_without_motion, "", "rows lack a wheel speed and are skipped");
  counted(report.rows_unsorted, "", "rows were out of order and are sorted by time");
  counted(report.rows_out_of_time, "", "rows repeat the time of another row and are skipped");
  counted(report.glitches.size(), "", "values are outside their limits; the report of the import lists them");
  for (const std::string& note : report.notes | std::views::drop(report.settings_detected))
    findings.push_back({false, table, "", note});
  for (const telemetry::JoinReport& join : report.joins) {
    counted(join.beyond_tolerance, join.table,
            fmt::format("rows of the main table have no reading within the tolerance; {} have one, {:.3f} s "
                        "old at the median",
                        join.matched, join.median_lag_s));
    if (join.matched == 0)
      findings.push_back(
          {true, table, join.table, "no row matches a row of the main table: compare the clocks"});
  }
}

std::string faults_of(const telemetry::ChannelTally& tally) {
  std::string text;
  const auto add = [&](const std::string& name, std::uint64_t count, const std::string& says) {
    if (count == 0) return;
    text += fmt::format("{}{} {}{}", text.empty() ? "" : "; ", count, name, says.empty() ? "" : ": " + says);
  };
  for (const auto& [reason, fault] : tally.faults) add(reason, fault.first, fault.second);
  // The numbers of two programs count each other's as missing and late.
  if (tally.senders.size() > 1)
    return text + (text.empty() ? "" : "; ") +
           fmt::format("{} senders, {} and {}: each robot needs its own robot_id", tally.senders.size(),
                       to_string(tally.senders[0]), to_string(tally.senders[1]));
  const telemetry::SequenceCounters& s = tally.sequence;
  add("missing", s.missing - std::min(s.missing, s.late), "");
  add("duplicate", s.duplicate, "");
  add("late", s.late, "");
  add("restarts", s.restarts, "");
  add("clock set back", s.clock_backward, "");
  add("clock set forward", s.clock_forward, "");
  return text;
}

void judge_state(const nlohmann::json& state, const std::string& robot_id, Findings& findings) {
  const auto add = [&](bool fault, const char* field, std::string says) {
    findings.push_back({fault, robot_id, field, std::move(says)});
  };
  if (!state["live"].get<bool>()) add(false, "live", "the daemon receives no telemetry from this robot");
  for (const nlohmann::json& c : state["contradictions"])
    findings.push_back({c["untrue"].get<bool>(), robot_id, c["channel"].get<std::string>(),
                        c["id"].get<std::string>() + ": " + c["says"].get<std::string>()});
  // Reasons that are no damage.
  constexpr std::array harmless{"restart", "gap", "outside_mission"};
  for (const auto& fault : state["faults"].items())
    add(std::ranges::find(harmless, fault.key()) == harmless.end(), "faults", fault_text(state, fault.key()));
  if (!state["has_model"].get<bool>())
    add(true, "has_model",
        "the daemon has no robot file of this robot: its telemetry is counted, not recorded; add the file on "
        "the page");
}

nlohmann::json to_json(const Findings& findings) {
  nlohmann::json out = nlohmann::json::array();
  for (const Finding& f : findings)
    out.push_back({{"severity", f.fault ? "fault" : "warning"},
                   {"about", f.about},
                   {"field", f.field},
                   {"value", f.value ? nlohmann::json(*f.value) : nlohmann::json()},
                   {"says", f.says}});
  return out;
}

void print(const Findings& findings) {
  for (const Finding& f : findings) {
    const bool named = f.says.find(f.field) != std::string::npos;
    const std::string where = f.about + (named ? "" : (f.field.starts_with('/') ? "#" : " ") + f.field);
    fmt::print("{}\n", wrapped(fmt::format("{} {}: {}", f.fault ? "fault  " : "warning", where, f.says),
                               help_width(), 8));
  }
  if (findings.empty()) return fmt::print("no problems found\n");
  const auto faults = static_cast<std::size_t>(std::ranges::count_if(findings, &Finding::fault));
  fmt::print("{}, {}\n", count_of(faults, "fault"), count_of(findings.size() - faults, "warning"));
}

Exit exit_of(const Findings& findings) {
  if (findings.empty()) return Exit::ok;
  return std::ranges::any_of(findings, &Finding::fault) ? Exit::fault : Exit::warned;
}

}  // namespace joulecast::client

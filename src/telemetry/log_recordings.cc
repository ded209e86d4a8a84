#include "telemetry/log_recordings.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>

#include "base/try.h"
#include "signals/sample.h"
#include "telemetry/codec.h"
#include "telemetry/covariate_tracker.h"
#include "telemetry/datagram.h"
#include "telemetry/mission_tracker.h"
#include "telemetry/validation.h"

namespace joulecast::telemetry {
namespace {

class Collector {
 public:
  explicit Collector(const std::string& wanted) : wanted_(wanted) {}

  void take(const LogEvent& event) {
    const auto channel = parse_channel(event.channel);
    if (!channel || channel->subject == Subject::energy_state) return;
    result_.robots.emplace(channel->robot_id);
    if (!wanted_.empty() && channel->robot_id != wanted_) return;
    const std::string id(channel->robot_id);
    if (channel->subject == Subject::telemetry) {
      const auto decoded = decode_telemetry(event.data);
      decoded ? add(id, decoded->sample) : refuse();
    } else if (channel->subject == Subject::covariates) {
      const auto decoded = decode_covariates(event.data);
      decoded ? add(id, decoded->message) : refuse();
    } else {
      const auto decoded = decode_mission_event(event.data);
      decoded ? add(id, decoded->event) : refuse();
    }
  }

  LogRecordings finish(std::size_t damaged_places) {
    result_.unreadable += damaged_places;
    for (const auto& [id, robot] : robots_)
      result_.samples_outside += robot.missions.counters().samples_outside;
    for (std::size_t k = 0; k < changes_.size(); ++k) {
      result_.recordings[k].covariates = signals::series_of(changes_[k]);
      result_.unreadable += put_in_order(result_.recordings[k].samples);
    }
    return std::move(result_);
  }

 private:
  struct Robot {
    MissionTracker missions;
    CovariateTracker covariates;
    std::optional<std::size_t> open;  // its mission among the recordings
  };

  void refuse() { ++result_.unreadable; }

  void add(const std::string& id, const signals::Sample& sample) {
    if (const auto fault = check_plausible(sample)) {
      if (fault->why == Implausibility::out_of_range || fault->why == Implausibility::bad_clock) {
        BeyondRange& beyond =
            result_.beyond_range[std::string(fault->field.substr(0, fault->field.find('[')))];
        ++beyond.samples;
        if (std::fabs(fault->value) > std::fabs(beyond.farthest)) beyond.farthest = fault->value;
      }
      return refuse();
    }
    Robot& robot = robots_[id];
    const SampleStep step = robot.missions.on_sample(sample.utime_us, sample.payload_kg);
    carry_out(id, robot, step.actions);
    if (step.belongs) result_.recordings[*robot.open].samples.push_back(sample);
  }

  void add(const std::string& id, const signals::MissionEvent& event) {
    if (check_plausible(event)) return refuse();
    Robot& robot = robots_[id];
    carry_out(id, robot, robot.missions.on_event(event));
  }

  void add(const std::string& id, const signals::CovariateMessage& message) {
    using Verdict = CovariateTracker::Verdict;
    if (check_plausible(message)) return refuse();
    Robot& robot = robots_[id];
    for (const signals::Covariate& covariate : message.covariates) {
      signals::CovariateChange change;
      const Verdict verdict = check_plausible(covariate)
                                  ? Verdict::late
                                  : robot.covariates.take(message.utime_us, covariate, change);
      if (verdict == Verdict::late || verdict == Verdict::no_room) refuse();
      if (verdict == Verdict::news && robot.open) changes_[*robot.open].push_back(std::move(change));
    }
  }

  void carry_out(const std::string& id, Robot& robot, const MissionActions& actions) {
    for (const MissionAction& action : actions) {
      robot.open.reset();
      if (action.kind != MissionAction::Kind::open) continue;
      robot.open = result_.recordings.size();
      result_.recordings.push_back({id, action.mission_id, action.payload_kg, {}, {}, action.implicit});
      changes_.push_back(robot.covariates.begin_mission(action.utime_us));
    }
  }

  const std::string& wanted_;
  LogRecordings result_;
  std::map<std::string, Robot> robots_;
  std::vector<std::vector<signals::CovariateChange>> changes_;  // of each recording
};

// At most three of the names, then how many more.
std::string listed(const std::set<std::string, std::less<>>& names) {
  std::string text;
  std::size_t count = 0;
  for (const std::string& name : names) {
    if (count == 3) return text + " and " + std::to_string(names.size() - count) + " more";
    text += (count++ > 0 ? ", " : "") + name;
  }
  return text;
}

constexpr std::size_t enough_samples = 10;  // to estimate their rate
constexpr double greatest_rate_hz = 1100;   // of a robot; faster ones are another unit's

double rate_hz(const Recording& mission) {
  const std::size_t samples = mission.samples.size();
  return samples < enough_samples ? 0 : static_cast<double>(samples - 1) / length_s(mission);
}

// Short missions in a row with one payload become one recording. A pause between them is a gap.
std::vector<Recording> joined(std::vector<Recording> missions, std::vector<std::string>& notes) {
  std::vector<Recording> result;
  std::vector<std::string> names;  // joined into the last of the result
  const auto report = [&] {
    if (names.size() > 1)
      notes.push_back(fmt::format("missions {} last less than {:g} s each and were joined",
                                  listed({names.begin(), names.end()}), shortest_mission_s));
    names.clear();
  };
  for (Recording& mission : missions) {
    const bool is_short = length_s(mission) < shortest_mission_s;
    const std::string name = mission.mission_id;
    if (is_short && !names.empty() && signals::same(result.back().payload_kg, mission.payload_kg)) {
      Recording& whole = result.back();
      whole.samples.insert(whole.samples.end(), mission.samples.begin(), mission.samples.end());
      std::vector<signals::CovariateChange> changes = signals::changes_of(whole.covariates);
      const std::vector<signals::CovariateChange> more = signals::changes_of(mission.covariates);
      changes.insert(changes.end(), more.begin(), more.end());
      whole.covariates = signals::series_of(changes);
    } else {
      report();
      result.push_back(std::move(mission));
    }
    if (is_short)
      names.push_back(name);
    else
      report();
  }
  report();
  return result;
}

}  // namespace

std::string channel_list(const std::set<std::string, std::less<>>& channels) {
  std::string text = fmt::format("{}", fmt::join(channels, ", "));
  return channels.size() < DatagramCounters::max_other_channels ? text : text + " and more";
}

Result<void> need_robots(const std::string& log, const LogTally& tally) {
  if (tally.of_robots > 0) return {};
  const auto& others = tally.other_channels;
  return invalid(
      log, fmt::format("has no {}. {}", others.empty() ? "message" : "robot, but " + channel_list(others),
                       robots_publish));
}

Result<LogRecordings> read_recordings(std::span<const std::string> paths, const std::string& robot_id,
                                      const LogObserver& passed) {
  Collector collector(robot_id);
  LogTally tally;
  const auto take = [&](const LogEvent& event) -> Result<bool> {
    collector.take(event);
    if (passed) passed(event);
    return true;
  };
  for (const std::string& path : paths) {
    const std::uint64_t before = tally.events;
    TRY(read_events(path, take, tally));
    if (tally.events == before) return invalid(path, "is not an LCM event log, or is empty");
  }
  if (!paths.empty()) TRY(need_robots(paths.front(), tally));
  return collector.finish(tally.damaged_places);
}

std::string in_other_unit(std::string_view field, double value) {
  if (field == "utime") return value > 0 ? " (in ns?)" : "";
  if (field.ends_with("_current")) return " (in mA?)";
  return field.ends_with("_voltage") ? " (in mV?)" : "";
}

Result<RecordingSet> make_recording_set(std::string robot_id, std::vector<Recording> missions) {
  RecordingSet set;
  set.robot_id = std::move(robot_id);
  std::size_t without_speed = 0, twice = 0;
  double fastest_hz = 0;
  std::erase_if(missions, [&](Recording& mission) {
    std::vector<signals::Sample>& samples = mission.samples;
    without_speed += std::erase_if(samples, [](const signals::Sample& s) {
      return !std::isfinite(s.wheel_velocity_rad_s[0]) || !std::isfinite(s.wheel_velocity_rad_s[1]);
    });
    twice += put_in_order(samples);
    fastest_hz = std::max(fastest_hz, samples.size() < 2 ? 0 : rate_hz(mission));
    if (samples.size() >= 2) return false;
    set.notes.push_back("mission " + mission.mission_id + " contains no motion and was left out");
    return true;
  });
  if (without_speed > 0)
    set.notes.push_back(fmt::format("{} samples without wheel speeds were left out", without_speed));
  if (twice > 0)
    set.notes.push_back(fmt::format("{} samples have the time of another and were left out", twice));
  std::ranges::stable_sort(missions, {}, [](const Recording& m) { return m.samples.front().utime_us; });
  for (Recording& mission : joined(std::move(missions), set.notes)) {
    if (length_s(mission) < shortest_mission_s) {
      set.notes.push_back(fmt::format("mission {} lasts {:.3g} s, less than {:g} s, and was left out",
                                      mission.mission_id, length_s(mission), shortest_mission_s));
      continue;
    }
    set.samples += mission.samples.size();
    set.missions.push_back(std::move(mission));
  }
  if (!set.missions.empty()) return set;
  const std::string none = fmt::format("contains no mission of at least {:g} s", shortest_mission_s);
  if (fastest_hz < greatest_rate_hz) return invalid("log", none);
  return invalid("utime", fmt::format("{}, as samples would come {:.3g} times a second: is utime given in ms "
                                      "or s? joulecast expects us since 1970",
                                      none, fastest_hz));
}

Result<void> need_robot(const LogRecordings& log, const std::string& robot_id) {
  if (log.robots.empty()) return invalid("log", "contains no telemetry");
  if (!robot_id.empty() && !log.robots.contains(robot_id))
    return invalid("log", "contains no telemetry of " + robot_id + ", only of " + listed(log.robots));
  return {};
}

Result<RecordingSet> load_recordings(std::span<const std::string> paths, const std::string& robot_id,
                                     const LogObserver& passed) {
  TRY_ASSIGN(LogRecordings log, read_recordings(paths, robot_id, passed));
  TRY(need_robot(log, robot_id));
  if (robot_id.empty() && log.robots.size() > 1)
    return invalid("log", fmt::format("contains {} robots, {}; select one with --robot-id", log.robots.size(),
                                      listed(log.robots)));
  Result<RecordingSet> set =
      make_recording_set(robot_id.empty() ? *log.robots.begin() : robot_id, std::move(log.recordings));
  std::string beyond_ranges;
  for (const auto& [field, beyond] : log.beyond_range)
    beyond_ranges +=
        fmt::format("{}{} samples have an impossible {}, up to {:.4g}{}", beyond_ranges.empty() ? "" : "; ",
                    beyond.samples, field, beyond.farthest, in_other_unit(field, beyond.farthest));
  if (!set) {
    if (!beyond_ranges.empty()) set.error().message += ": " + beyond_ranges;
    if (log.beyond_range.contains("utime")) set.error().field = "utime";
    return set;
  }
  set->beyond_range = std::move(log.beyond_range);
  set->unreadable = log.unreadable;
  if (log.unreadable > 0)
    set->notes.push_back(
        fmt::format("{} messages or values could not be read, exceed a limit or are duplicates{}{}",
                    log.unreadable, beyond_ranges.empty() ? "" : "; of these ", beyond_ranges));
  if (log.samples_outside > 0)
    set->notes.push_back(fmt::format(
        "{} samples before a mission's start or just after its end were left out", log.samples_outside));
  return set;
}

}  // namespace joulecast::telemetry

#include "telemetry/recording_set.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <set>
#include <utility>

#include "telemetry/codec.h"
#include "telemetry/event_log.h"
#include "telemetry/mission_tracker.h"
#include "telemetry/validation.h"

namespace joulecast::telemetry {
namespace {

// Missions of one robot as its messages arrive.
class Collector {
 public:
  // Whether it is within the limits of telemetry.
  bool add(const Sample& sample) {
    if (check_plausible(sample)) return false;
    const SampleStep step = tracker_.on_sample(sample.utime_us, sample.payload_kg);
    carry_out(step.actions);
    if (step.belongs && open_) open_->samples.push_back(sample);
    return true;
  }
  void add(const MissionEvent& event) { carry_out(tracker_.on_event(event)); }
  // How many of its values are refused.
  std::size_t add(const CovariateMessage& message) {
    using Verdict = CovariateTracker::Verdict;
    if (check_plausible(message)) return 1;
    std::size_t refused = 0;
    for (const Covariate& covariate : message.covariates) {
      CovariateChange change;
      const Verdict verdict = check_plausible(covariate)
                                  ? Verdict::late
                                  : covariates_.take(message.utime_us, covariate, change);
      if (verdict == Verdict::late || verdict == Verdict::no_room) ++refused;
      if (verdict == Verdict::news && open_) changes_.push_back(std::move(change));
    }
    return refused;
  }

  std::vector<Recording> finish() {
    close();
    return std::move(missions_);
  }

 private:
  void carry_out(const MissionActions& actions) {
    for (const MissionAction& action : actions) {
      close();
      if (action.kind != MissionAction::Kind::open) continue;
      open_.emplace();
      open_->mission_id = action.mission_id;
      open_->payload_kg = action.payload_kg;
      changes_ = covariates_.begin_mission(action.utime_us);
    }
  }
  void close() {
    if (open_) {
      open_->covariates = series_of(changes_);
      missions_.push_back(std::move(*open_));
    }
    open_.reset();
  }

  MissionTracker tracker_;
  CovariateTracker covariates_;
  std::optional<Recording> open_;
  std::vector<CovariateChange> changes_;  // of the open one
  std::vector<Recording> missions_;
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

bool usable(const Sample& sample) {
  return std::isfinite(sample.wheel_velocity_rad_s[0]) && std::isfinite(sample.wheel_velocity_rad_s[1]);
}

double length_s(const Recording& mission) {
  return 1e-6 * static_cast<double>(mission.samples.back().utime_us - mission.samples.front().utime_us);
}

// Short missions in a row with one payload become one recording. A pause between them is a gap in its samples.
std::vector<Recording> joined(std::vector<Recording> missions, std::vector<std::string>& notes) {
  std::vector<Recording> result;
  std::vector<std::string> names;  // joined into the last of the result
  const auto told = [&] {
    if (names.size() > 1)
      notes.push_back(fmt::format("missions {} last less than {:g} s each and were joined",
                                  listed({names.begin(), names.end()}), shortest_mission_s));
    names.clear();
  };
  for (Recording& mission : missions) {
    const bool is_short = length_s(mission) < shortest_mission_s;
    if (is_short && !names.empty() && result.back().payload_kg == mission.payload_kg) {
      Recording& whole = result.back();
      whole.samples.insert(whole.samples.end(), mission.samples.begin(), mission.samples.end());
      std::vector<CovariateChange> changes = changes_of(whole.covariates);
      const std::vector<CovariateChange> more = changes_of(mission.covariates);
      changes.insert(changes.end(), more.begin(), more.end());
      whole.covariates = series_of(changes);
    } else {
      told();
      result.push_back(std::move(mission));
    }
    if (is_short) names.push_back(result.back().mission_id);
    else told();
  }
  told();
  return result;
}

}  // namespace

Result<RecordingSet> make_recording_set(std::string robot_id, std::vector<Recording> missions) {
  RecordingSet set;
  set.robot_id = std::move(robot_id);
  std::erase_if(missions, [&](Recording& mission) {
    auto& samples = mission.samples;
    std::erase_if(samples, [](const Sample& s) { return !usable(s); });
    std::ranges::stable_sort(samples, {}, &Sample::utime_us);
    const auto same = std::ranges::unique(samples, {}, &Sample::utime_us);
    samples.erase(same.begin(), same.end());
    if (samples.size() >= 2) return false;
    set.notes.push_back("mission " + mission.mission_id + " holds no motion and was left out");
    return true;
  });
  std::ranges::stable_sort(missions, {}, [](const Recording& m) { return m.samples.front().utime_us; });
  for (Recording& mission : joined(std::move(missions), set.notes)) {
    if (length_s(mission) < shortest_mission_s) {
      set.notes.push_back(fmt::format("mission {} lasts {:.3g} s, less than {:g} s, and was left out", mission.mission_id,
                                      length_s(mission), shortest_mission_s));
      continue;
    }
    set.samples += mission.samples.size();
    set.missions.push_back(std::move(mission));
  }
  if (set.missions.empty()) {
    return invalid("log", fmt::format("holds no mission of at least {:g} s", shortest_mission_s));
  }
  return set;
}

Result<RecordingSet> load_recordings(std::span<const std::string> paths, const std::string& robot_id) {
  std::map<std::string, Collector, std::less<>> robots;
  std::set<std::string, std::less<>> others;
  std::size_t unreadable = 0;
  const auto take = [&](const LogEvent& event) -> Result<bool> {
    const auto channel = parse_channel(event.channel);
    if (!channel || channel->subject == Subject::energy_state) return true;
    if (!robot_id.empty() && channel->robot_id != robot_id) {
      others.emplace(channel->robot_id);
      return true;
    }
    Collector& robot = robots[std::string(channel->robot_id)];
    if (channel->subject == Subject::telemetry) {
      const auto decoded = decode_telemetry(event.data);
      if (!decoded || !robot.add(decoded->sample)) ++unreadable;
    } else if (channel->subject == Subject::covariates) {
      const auto decoded = decode_covariates(event.data);
      unreadable += decoded ? robot.add(decoded->message) : 1;
    } else if (const auto decoded = decode_mission_event(event.data);
               decoded && !check_plausible(decoded->event)) {
      robot.add(decoded->event);
    } else {
      ++unreadable;
    }
    return true;
  };
  LogTally tally;
  for (const std::string& path : paths) {
    const std::uint64_t before = tally.events;
    if (Result<bool> read = read_events(path, take, tally); !read)
      return tl::unexpected(std::move(read.error()));
    if (tally.events == before) return invalid("log", path + " is no LCM event log, or an empty one");
  }
  unreadable += tally.damaged_places;
  if (robots.empty()) {
    std::string text = "holds no telemetry";
    if (!robot_id.empty()) text += " of " + robot_id;
    if (!others.empty()) text += ", only of " + listed(others);
    return invalid("log", text);
  }
  if (robots.size() > 1) {
    return invalid("log", "holds " + std::to_string(robots.size()) + " robots; name the one to diagnose");
  }
  auto& [id, collector] = *robots.begin();
  Result<RecordingSet> set = make_recording_set(id, collector.finish());
  if (!set) return set;
  set->unreadable = unreadable;
  if (unreadable > 0)
    set->notes.push_back(fmt::format("{} messages or values could not be read or break a limit", unreadable));
  return set;
}

}  // namespace joulecast::telemetry

#include "gap/recordings.h"

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

namespace joulecast::gap {
namespace {

// Missions of one robot as its messages arrive.
class Collector {
 public:
  void add(const telemetry::Sample& sample) {
    const telemetry::SampleStep step = tracker_.on_sample(sample.utime_us, sample.payload_kg);
    carry_out(step.actions);
    if (step.belongs && open_) open_->samples.push_back(sample);
  }
  void add(const telemetry::MissionEvent& event) { carry_out(tracker_.on_event(event)); }
  // How many of its values are refused.
  std::size_t add(const telemetry::CovariateMessage& message) {
    using Verdict = telemetry::CovariateTracker::Verdict;
    if (telemetry::check_plausible(message)) return 1;
    std::size_t refused = 0;
    for (const telemetry::Covariate& covariate : message.covariates) {
      telemetry::CovariateChange change;
      const Verdict verdict = telemetry::check_plausible(covariate)
                                  ? Verdict::late
                                  : covariates_.take(message.utime_us, covariate, change);
      if (verdict == Verdict::late || verdict == Verdict::no_room) ++refused;
      if (verdict == Verdict::news && open_) changes_.push_back(std::move(change));
    }
    return refused;
  }

  std::vector<telemetry::Recording> finish() {
    close();
    return std::move(missions_);
  }

 private:
  void carry_out(const telemetry::MissionActions& actions) {
    for (const telemetry::MissionAction& action : actions) {
      close();
      if (action.kind != telemetry::MissionAction::Kind::open) continue;
      open_.emplace();
      open_->mission_id = action.mission_id;
      open_->payload_kg = action.payload_kg;
      changes_ = covariates_.begin_mission(action.utime_us);
    }
  }
  void close() {
    if (open_) {
      open_->covariates = telemetry::series_of(changes_);
      missions_.push_back(std::move(*open_));
    }
    open_.reset();
  }

  telemetry::MissionTracker tracker_;
  telemetry::CovariateTracker covariates_;
  std::optional<telemetry::Recording> open_;
  std::vector<telemetry::CovariateChange> changes_;  // of the open one
  std::vector<telemetry::Recording> missions_;
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

bool usable(const telemetry::Sample& sample) {
  return std::isfinite(sample.wheel_velocity_rad_s[0]) && std::isfinite(sample.wheel_velocity_rad_s[1]);
}

}  // namespace

Result<RecordingSet> make_recording_set(std::string robot_id, std::vector<telemetry::Recording> missions) {
  RecordingSet set;
  set.robot_id = std::move(robot_id);
  for (telemetry::Recording& mission : missions) {
    auto& samples = mission.samples;
    std::erase_if(samples, [](const telemetry::Sample& s) { return !usable(s); });
    std::ranges::stable_sort(samples, {}, &telemetry::Sample::utime_us);
    const auto same = std::ranges::unique(samples, {}, &telemetry::Sample::utime_us);
    samples.erase(same.begin(), same.end());
    if (samples.size() < 2) continue;
    const double length_s = 1e-6 * static_cast<double>(samples.back().utime_us - samples.front().utime_us);
    if (length_s < shortest_mission_s) continue;
    set.samples += samples.size();
    set.missions.push_back(std::move(mission));
  }
  std::ranges::stable_sort(set.missions, {},
                           [](const telemetry::Recording& m) { return m.samples.front().utime_us; });
  if (set.missions.empty()) {
    return invalid("log", fmt::format("holds no mission of at least {:g} s", shortest_mission_s));
  }
  return set;
}

Result<RecordingSet> load_recordings(std::span<const std::string> paths, const std::string& robot_id) {
  std::map<std::string, Collector, std::less<>> robots;
  std::set<std::string, std::less<>> others;
  std::size_t unreadable = 0;
  const auto take = [&](const telemetry::LogEvent& event) -> Result<bool> {
    const auto channel = telemetry::parse_channel(event.channel);
    if (!channel || channel->subject == telemetry::Subject::energy_state) return true;
    if (!robot_id.empty() && channel->robot_id != robot_id) {
      others.emplace(channel->robot_id);
      return true;
    }
    Collector& robot = robots[std::string(channel->robot_id)];
    if (channel->subject == telemetry::Subject::telemetry) {
      if (const auto decoded = telemetry::decode_telemetry(event.data)) {
        robot.add(decoded->sample);
      } else {
        ++unreadable;
      }
    } else if (channel->subject == telemetry::Subject::covariates) {
      const auto decoded = telemetry::decode_covariates(event.data);
      unreadable += decoded ? robot.add(decoded->message) : 1;
    } else if (const auto decoded = telemetry::decode_mission_event(event.data);
               decoded && !telemetry::check_plausible(decoded->event)) {
      robot.add(decoded->event);
    } else {
      ++unreadable;
    }
    return true;
  };
  telemetry::LogTally tally;
  for (const std::string& path : paths) {
    const std::uint64_t before = tally.events;
    if (Result<bool> read = telemetry::read_events(path, take, tally); !read)
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
  if (set) set->unreadable = unreadable;
  return set;
}

}  // namespace joulecast::gap

#include "telemetry/log_recordings.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <cmath>
#include <optional>
#include <utility>

#include "base/try.h"
#include "signals/mission_event.h"
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
    if (tally.events == before) return invalid("log", path + " is not an LCM event log, or is empty");
  }
  if (!paths.empty()) TRY(need_robots(paths.front(), tally));
  return collector.finish(tally.damaged_places);
}

}  // namespace joulecast::telemetry

#include "telemetry/log_recordings.h"

#include <algorithm>
#include <map>
#include <utility>

#include "telemetry/codec.h"
#include "telemetry/event_log.h"
#include "telemetry/validation.h"

namespace joulecast::telemetry {
namespace {

class Collector {
 public:
  void take(const LogEvent& event) {
    const auto channel = parse_channel(event.channel);
    if (!channel) return;
    if (channel->subject == Subject::telemetry) {
      const auto decoded = decode_telemetry(event.data);
      decoded ? add(decoded->robot_id, decoded->sample) : refuse();
    } else if (channel->subject == Subject::mission_event) {
      const auto decoded = decode_mission_event(event.data);
      decoded ? follow(decoded->robot_id, decoded->event) : refuse();
    } else if (channel->subject == Subject::covariates) {
      const auto decoded = decode_covariates(event.data);
      decoded ? add(decoded->robot_id, decoded->message) : refuse();
    }
  }

  LogRecordings finish(std::uint64_t skipped_bytes) {
    for (std::size_t k = 0; k < changes_.size(); ++k)
      result_.recordings[k].covariates = series_of(changes_[k]);
    std::erase_if(result_.recordings, [](const Recording& r) { return r.samples.empty(); });
    result_.skipped_bytes = skipped_bytes;
    return std::move(result_);
  }

 private:
  void refuse() { ++result_.unreadable; }

  void follow(const std::string& robot_id, const MissionEvent& event) {
    open_.erase(robot_id);
    if (event.phase != MissionPhase::started) return;
    open_[robot_id] = result_.recordings.size();
    result_.recordings.push_back({robot_id, event.mission_id, event.payload_kg, {}});
    changes_.push_back(covariates_[robot_id].begin_mission(event.utime_us));
  }

  void add(const std::string& robot_id, const CovariateMessage& message) {
    if (check_plausible(message)) return refuse();
    CovariateTracker& tracker = covariates_[robot_id];
    const auto open = open_.find(robot_id);
    for (const Covariate& covariate : message.covariates) {
      CovariateChange change;
      if (check_plausible(covariate)) {
        refuse();
        continue;
      }
      const CovariateTracker::Verdict verdict = tracker.take(message.utime_us, covariate, change);
      if (verdict == CovariateTracker::Verdict::news) {
        if (open != open_.end()) changes_[open->second].push_back(std::move(change));
      } else if (verdict != CovariateTracker::Verdict::repeat) {
        refuse();
      }
    }
  }

  void add(const std::string& robot_id, const Sample& sample) {
    const auto open = open_.find(robot_id);
    if (open == open_.end()) {
      ++result_.samples_outside;
      return;
    }
    std::vector<Sample>& samples = result_.recordings[open->second].samples;
    if (check_plausible(sample) || (!samples.empty() && sample.utime_us <= samples.back().utime_us))
      return refuse();
    samples.push_back(sample);
  }

  LogRecordings result_;
  std::map<std::string, std::size_t> open_;  // robot -> its open mission among the recordings
  std::map<std::string, CovariateTracker> covariates_;
  std::vector<std::vector<CovariateChange>> changes_;  // of each recording
};

}  // namespace

Result<LogRecordings> read_recordings(const std::string& log_path) {
  Collector collector;
  LogTally tally;
  const auto take = [&](const LogEvent& event) -> Result<bool> {
    collector.take(event);
    return true;
  };
  if (const Result<bool> read = read_events(log_path, take, tally); !read)
    return tl::unexpected(read.error());
  return collector.finish(tally.skipped_bytes);
}

}  // namespace joulecast::telemetry

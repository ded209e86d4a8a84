#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "server/api/services.h"
#include "server/http/event_hub.h"

namespace joulecast::server {

// The data of the event `mission`, for a mission that has ended.
std::string mission_event(const history::Mission& mission);

// Publishes changes of the fleet to the event stream: `state` for each robot with a new snapshot,
// `contradiction` for each published contradiction, `mission` for each mission that ended at another daemon
// of the cluster. Keeps the last values of each robot. One thread.
class FleetEvents {
 public:
  // `own`: robots whose missions this daemon writes; empty: all.
  FleetEvents(const api::Services& services, ingest::RecentValues& recent, http::EventHub& hub,
              std::function<bool(const std::string&)> own)
      : services_(services), recent_(recent), hub_(hub), own_(std::move(own)) {}

  void publish(std::int64_t now_utime_us);

 private:
  struct Published {
    std::shared_ptr<const ingest::RobotSnapshot> snapshot;
    bool live = false;
    std::map<std::string, std::int64_t> contradictions;  // host's time when each was published
    std::vector<history::MissionKey> ended;              // at other daemons; perhaps not stored yet
  };
  void publish_contradictions(const ingest::RobotSnapshot& now, Published& published);
  void publish_ended(const ingest::RobotSnapshot& now, Published& published);

  const api::Services& services_;
  ingest::RecentValues& recent_;
  http::EventHub& hub_;
  const std::function<bool(const std::string&)> own_;
  std::map<std::string, Published> published_;
};

}  // namespace joulecast::server

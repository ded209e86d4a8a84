#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <string>

#include "server/api/services.h"
#include "server/http/event_hub.h"

namespace joulecast::server {

// Publishes changes of the fleet to the event stream: `state` for each robot with a new snapshot,
// `contradiction` for each published contradiction. Keeps the last values of each robot. One thread.
class FleetEvents {
 public:
  FleetEvents(const api::Services& services, ingest::RecentValues& recent, http::EventHub& hub)
      : services_(services), recent_(recent), hub_(hub) {}

  void publish(std::int64_t now_utime_us);

 private:
  struct Published {
    std::shared_ptr<const ingest::RobotSnapshot> snapshot;
    bool live = false;
    std::map<std::string, std::int64_t> contradictions;  // host's time when each was published
  };
  void publish_contradictions(const ingest::RobotSnapshot& now, Published& published);

  const api::Services& services_;
  ingest::RecentValues& recent_;
  http::EventHub& hub_;
  std::map<std::string, Published> published_;
};

}  // namespace joulecast::server

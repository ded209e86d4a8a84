#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <string>
#include <utility>

#include "history/store.h"
#include "ingest/fleet_view.h"
#include "ingest/forecasts.h"
#include "ingest/model_registry.h"
#include "ingest/recent_values.h"
#include "server/http/event_hub.h"

namespace joulecast::server {

// Publishes changes of the fleet to the event stream: `state` for each robot with a new snapshot, `mission`
// for each mission that ended, `contradiction` for each published contradiction. Keeps the last values of
// each robot. One thread.
class FleetEvents {
 public:
  // Also called with each mission that ended and its JSON.
  using MissionSink = std::function<void(const history::Mission&, const std::string& json)>;

  FleetEvents(const ingest::FleetView& fleet, ingest::RecentValues& recent,
              const ingest::ModelRegistry& models, ingest::Forecasts& forecasts, const history::Store& store,
              http::EventHub& hub, MissionSink mission_ended)
      : fleet_(fleet),
        recent_(recent),
        models_(models),
        forecasts_(forecasts),
        store_(store),
        hub_(hub),
        mission_ended_(std::move(mission_ended)) {}

  void publish(std::int64_t now_utime_us);

 private:
  struct Published {
    std::shared_ptr<const ingest::RobotSnapshot> snapshot;
    bool live = false;
    std::map<std::string, std::int64_t> contradictions;  // host's time when each was published
  };
  void publish_contradictions(const ingest::RobotSnapshot& now, Published& published);

  const ingest::FleetView& fleet_;
  ingest::RecentValues& recent_;
  const ingest::ModelRegistry& models_;
  ingest::Forecasts& forecasts_;
  const history::Store& store_;
  http::EventHub& hub_;
  const MissionSink mission_ended_;
  std::map<std::string, Published> published_;
};

}  // namespace joulecast::server

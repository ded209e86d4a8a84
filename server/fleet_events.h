#pragma once

#include <cstdint>
#include <map>
#include <string>

#include "history/store.h"
#include "server/http/event_hub.h"
#include "server/ingest/fleet_view.h"
#include "server/ingest/forecasts.h"
#include "server/ingest/model_registry.h"

namespace joulecast::server {

// Tells the event stream what changed in the fleet: `state` for each robot whose snapshot is new, `mission`
// for each mission that ended. One thread.
class FleetEvents {
 public:
  FleetEvents(const FleetView& fleet, const ModelRegistry& models, Forecasts& forecasts,
              const history::Store& store, http::EventHub& hub)
      : fleet_(fleet), models_(models), forecasts_(forecasts), store_(store), hub_(hub) {}

  void publish(std::int64_t now_utime_us);

 private:
  struct Told {
    std::shared_ptr<const RobotSnapshot> snapshot;
    bool live = false;
  };
  const FleetView& fleet_;
  const ModelRegistry& models_;
  Forecasts& forecasts_;
  const history::Store& store_;
  http::EventHub& hub_;
  std::map<std::string, Told> told_;
};

}  // namespace joulecast::server

#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <string>

#include "base/error.h"
#include "history/leases.h"
#include "history/store.h"
#include "ingest/fleet_view.h"
#include "ingest/forecasts.h"
#include "ingest/keeping.h"
#include "ingest/mission_requests.h"
#include "ingest/model_registry.h"

namespace joulecast::server {

// Data that the daemons of a cluster exchange through the database: the live state of the robots that each
// keeps, models that were put in force, and learned forecasts. After a turn, this daemon answers for the
// others' robots as of then, and keeps to the missions that they were requested to begin and end.
class Exchange {
 public:
  Exchange(std::string node, std::unique_ptr<history::SharedState> shared, const history::Store& store,
           ingest::Keeping& keeping, ingest::FleetView& fleet, ingest::ModelRegistry& models,
           ingest::Forecasts& forecasts, std::function<std::int64_t()> now_utime_us,
           std::function<void(const std::string& robot_id, const ingest::MissionRequest&)> request_mission);

  // Call several times a second; one thread.
  Result<void> turn();

 private:
  Result<void> publish();
  Result<void> hear();
  Result<void> follow_models();
  Result<void> follow_learning();
  Result<void> follow_requests();
  Result<void> put_in_force(const std::string& robot_id, std::int64_t version);

  const std::string node_;
  const std::unique_ptr<history::SharedState> shared_;
  const history::Store& store_;
  ingest::Keeping& keeping_;
  ingest::FleetView& fleet_;
  ingest::ModelRegistry& models_;
  ingest::Forecasts& forecasts_;
  const std::function<std::int64_t()> now_utime_us_;
  std::map<std::string, std::shared_ptr<const ingest::RobotSnapshot>> published_;
  std::function<void(const std::string& robot_id, const ingest::MissionRequest&)> request_mission_;
  std::map<std::string, std::int64_t> learned_, requested_;
  std::uint64_t turns_ = 0;
};

}  // namespace joulecast::server

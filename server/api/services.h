#pragma once

#include <cstdint>
#include <functional>
#include <vector>

#include "history/store.h"
#include "history/writer.h"
#include "planning/cost_table_cache.h"
#include "server/diagnosis/diagnosis_service.h"
#include "server/diagnosis/model_adoption.h"
#include "server/http/router.h"
#include "server/ingest/fleet_view.h"
#include "server/ingest/forecasts.h"
#include "server/ingest/model_registry.h"

namespace joulecast::api {

// What the endpoints work with; all of it safe to use from any thread.
struct Services {
  history::Store& store;
  history::Writer& writer;
  server::ModelRegistry& models;
  const server::FleetView& fleet;
  server::Forecasts& forecasts;
  planning::CostTableCache& cost_tables;
  server::ModelAdoption& adoption;
  server::DiagnosisService& diagnoses;
  std::function<std::int64_t()> now_utime_us;  // host clock
};

// The table of the API: every endpoint but those of operations (server/http) stands here.
std::vector<http::Endpoint> endpoints(Services& services);

// One function an endpoint file, each returning its rows.
std::vector<http::Endpoint> robot_endpoints(Services& services);
std::vector<http::Endpoint> model_endpoints(Services& services);
std::vector<http::Endpoint> diagnosis_endpoints(Services& services);
std::vector<http::Endpoint> gap_history_endpoints(Services& services);
std::vector<http::Endpoint> mission_endpoints(Services& services);
std::vector<http::Endpoint> planning_endpoints(Services& services);
std::vector<http::Endpoint> matrix_endpoints(Services& services);
std::vector<http::Endpoint> autonomy_endpoints(Services& services);

// The model of a robot, or the error that says why there is none.
Result<std::shared_ptr<const server::ModelInForce>> model_of(const Services& services,
                                                             const std::string& robot_id);

}  // namespace joulecast::api

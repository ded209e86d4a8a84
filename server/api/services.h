#pragma once

#include <cstdint>
#include <functional>
#include <vector>

#include "history/store.h"
#include "history/writer.h"
#include "ingest/fleet_view.h"
#include "ingest/forecasts.h"
#include "ingest/model_registry.h"
#include "ingest/recent_values.h"
#include "planning/cost_table_cache.h"
#include "server/cluster/cluster.h"
#include "server/diagnosis/diagnosis_service.h"
#include "server/diagnosis/drift_view.h"
#include "server/diagnosis/gap_watch.h"
#include "server/diagnosis/model_adoption.h"
#include "server/http/router.h"

namespace joulecast::api {

// What the endpoints work with; all of it safe to use from any thread.
struct Services {
  history::Store& store;
  history::Writer& writer;
  ingest::ModelRegistry& models;
  const ingest::FleetView& fleet;
  const ingest::RecentValues& recent;
  ingest::Forecasts& forecasts;
  planning::CostTableCache& cost_tables;
  const server::DriftView& drift;
  server::ModelAdoption& adoption;
  server::DiagnosisService& diagnoses;
  const server::GapWatch& watch;
  const server::Cluster* cluster;              // null: this daemon is in none
  std::function<std::int64_t()> now_utime_us;  // host clock
};

// A row of the API's table: what the endpoint is, without a handler, and apart from it how it is bound to
// what it works with.
struct TableRow {
  http::Endpoint endpoint;
  std::function<void(Services&, http::Endpoint&)> bind;
};

// Binds to a function of (Services&, const http::Request&).
template <class Answer>
std::function<void(Services&, http::Endpoint&)> answered_by(Answer answer) {
  return [answer](Services& services, http::Endpoint& endpoint) {
    endpoint.handler = [&services, answer](const http::Request& request) {
      return answer(services, request);
    };
  };
}

// The table of the API: every endpoint but those of operations (server/http) stands here.
std::vector<http::Endpoint> endpoints(Services& services);
// What it says of them, for documents: without handlers.
std::vector<http::Endpoint> described_endpoints();

// One function an endpoint file, each returning its rows.
std::vector<TableRow> robot_rows();
std::vector<TableRow> attention_rows();
std::vector<TableRow> model_rows();
std::vector<TableRow> diagnosis_rows();
std::vector<TableRow> audit_rows();
std::vector<TableRow> audit_log_rows();
std::vector<TableRow> floor_map_rows();
std::vector<TableRow> gap_history_rows();
std::vector<TableRow> mission_list_rows();
std::vector<TableRow> mission_rows();
std::vector<TableRow> planning_rows();
std::vector<TableRow> cluster_rows();
std::vector<TableRow> recent_value_rows();

// The model of a robot that `field` of the request names, or the error that says why there is none.
Result<std::shared_ptr<const ingest::ModelInForce>> model_of(const Services& services,
                                                             const std::string& robot_id,
                                                             std::string field = "id");

// Where a request's questions of what was are asked: at a standby where there is one, but of a client that
// says Cache-Control: no-cache, which sees all that was committed.
history::Past past_of(const Services& services, const http::Request& request);
// The answer with how old it may be, in seconds: Joulecast-Staleness, absent where nothing is missing.
http::Response told_staleness(http::Response response, const history::Past& past);

}  // namespace joulecast::api

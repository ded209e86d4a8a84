#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <utility>
#include <vector>

#include "describe/table.h"
#include "history/store.h"
#include "history/writer.h"
#include "ingest/fleet_view.h"
#include "ingest/forecasts.h"
#include "ingest/inbound_message.h"
#include "ingest/model_registry.h"
#include "planning/cost_table.h"
#include "server/api/attention.h"
#include "server/cluster/cluster.h"
#include "server/diagnosis/diagnosis_service.h"
#include "server/diagnosis/drift_view.h"
#include "server/diagnosis/gap_watch.h"
#include "server/diagnosis/model_adoption.h"
#include "server/http/router.h"

namespace joulecast::api {

using described::Schema;
using described::Table;
using http::Method;
using http::Parameter;
using http::Request;
using http::Response;
using http::Role;
using http::Run;

// Price and emissions of energy from the grid; not set: NaN.
struct Tariff {
  double price_per_kwh = 0;
  std::string currency;
  double co2_g_per_kwh = 0;
};

// Dependencies of the endpoints; all of them are thread-safe.
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
  // Passes a stored request on to the accounts, if this daemon keeps the robot.
  std::function<void(const std::string& robot_id, const ingest::MissionRequest&)> request_mission;
  Tariff tariff;
  AttentionList* attention = nullptr;  // made of the members above
};

// A row of the API's table: an endpoint without a handler, and the function that sets the handler.
struct TableRow {
  http::Endpoint endpoint;
  std::function<void(Services&, http::Endpoint&)> bind;
};

// Binds to a function of (Services&, const Request&).
template <class Answer>
std::function<void(Services&, http::Endpoint&)> answered_by(Answer answer) {
  return [answer](Services& services, http::Endpoint& endpoint) {
    endpoint.handler = [&services, answer](const Request& request) { return answer(services, request); };
  };
}

// The schema of an answer; the name alone: it is among the schemas of this part or of others.
struct AnswerSchema {
  std::string name = {};
  Schema schema = {};
};

// Endpoints of one kind, and the schemas that their tables make.
struct Part {
  std::vector<TableRow> rows = {};
  described::Schemas schemas = {};

  // The common members of an endpoint, the function that answers it, and the other members.
  template <class Answer>
  void add(Method method, std::string path, std::string operation_id, Role role, std::string summary,
           AnswerSchema response, Answer answer, http::Endpoint row = {}) {
    row.method = method;
    row.path = std::move(path);
    row.operation_id = std::move(operation_id);
    row.role = role;
    row.summary = std::move(summary);
    row.response_schema = response.name;
    rows.push_back({std::move(row), answered_by(answer)});
    if (!response.schema.is_null())
      schemas.emplace_back(std::move(response.name), std::move(response.schema));
  }
};

// All endpoints of the API, except those of operations (server/http). Null: without handlers, for generated
// documents.
std::vector<http::Endpoint> endpoints(Services* services);
// The schemas of all endpoints.
described::Schemas schemas();

Part robot_part();
Part attention_part();
Part model_part();
Part diagnosis_part();
Part audit_part();
Part event_log_part();
Part floor_map_part();
Part gap_history_part();
Part mission_list_part();
Part mission_part();
Part mission_request_part();
Part planning_part();
Part map_part();
Part cluster_part();
Part recent_value_part();

// The model in force of `robot_id`; else Fault::not_found of `field`, the field of the request that names it.
Result<std::shared_ptr<const ingest::ModelInForce>> model_of(const Services& services,
                                                             const std::string& robot_id,
                                                             std::string field = "id");

}  // namespace joulecast::api

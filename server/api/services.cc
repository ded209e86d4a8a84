#include "server/api/services.h"

#include <iterator>
#include <utility>

namespace joulecast::api {

namespace {

std::vector<TableRow> table() {
  std::vector<TableRow> all;
  for (const auto part : {robot_rows, model_rows, diagnosis_rows, gap_history_rows, audit_rows,
                          mission_list_rows, mission_rows, planning_rows, cluster_rows}) {
    std::vector<TableRow> rows = part();
    all.insert(all.end(), std::make_move_iterator(rows.begin()), std::make_move_iterator(rows.end()));
  }
  return all;
}

}  // namespace

std::vector<http::Endpoint> endpoints(Services& services) {
  std::vector<http::Endpoint> all;
  for (TableRow& row : table()) {
    row.bind(services, row.endpoint);
    all.push_back(std::move(row.endpoint));
  }
  return all;
}

std::vector<http::Endpoint> described_endpoints() {
  std::vector<http::Endpoint> all;
  for (TableRow& row : table()) all.push_back(std::move(row.endpoint));
  return all;
}

Result<std::shared_ptr<const ingest::ModelInForce>> model_of(const Services& services,
                                                             const std::string& robot_id, std::string field) {
  if (auto model = services.models.find(robot_id)) return model;
  if (services.fleet.find(robot_id) == nullptr)
    return tl::unexpected(ingest::unknown_robot(std::move(field), robot_id));
  return fail(Fault::not_found, std::move(field),
              "robot " + robot_id + " publishes telemetry but has no model yet: PUT /v1/robots/" + robot_id);
}

}  // namespace joulecast::api

#include "server/api/services.h"

#include <iterator>
#include <utility>

namespace joulecast::api {

std::vector<http::Endpoint> endpoints(Services& services) {
  std::vector<http::Endpoint> all;
  for (const auto part : {robot_endpoints, model_endpoints, diagnosis_endpoints, gap_history_endpoints,
                          mission_endpoints, planning_endpoints, matrix_endpoints, autonomy_endpoints}) {
    std::vector<http::Endpoint> rows = part(services);
    all.insert(all.end(), std::make_move_iterator(rows.begin()), std::make_move_iterator(rows.end()));
  }
  return all;
}

Result<std::shared_ptr<const server::ModelInForce>> model_of(const Services& services,
                                                             const std::string& robot_id) {
  if (auto model = services.models.find(robot_id)) return model;
  const bool heard = services.fleet.find(robot_id) != nullptr;
  return fail(
      Fault::not_found, "id",
      heard ? "robot " + robot_id + " publishes telemetry but has no model yet: PUT /v1/robots/" + robot_id
            : "no robot " + robot_id);
}

}  // namespace joulecast::api

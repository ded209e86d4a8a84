#include "server/api/services.h"

#include "answers/autonomy.h"
#include "answers/estimate.h"
#include "answers/matrix.h"
#include "answers/mission.h"
#include "answers/profile.h"
#include "gap/verdict/diagnosis_json.h"
#include "robot/robot_schema.h"
#include "server/api/common_parameters.h"
#include "server/api/requests.h"
#include "server/api/robot_json.h"
#include "server/http/gate.h"
#include "server/http/openapi.h"
#include "server/http/operations.h"
#include "server/http/problem.h"

namespace joulecast::api {
namespace {

constexpr std::pair<const char*, Part (*)()> parts[] = {
    {"robots", robot_part},          {"robots", attention_part},    {"robots", recent_value_part},
    {"models", model_part},          {"diagnosis", diagnosis_part}, {"diagnosis", gap_history_part},
    {"events", event_log_part},      {"access", audit_part},        {"operations", cluster_part},
    {"missions", mission_list_part}, {"missions", mission_part},    {"missions", mission_request_part},
    {"missions", floor_map_part},    {"planning", planning_part},   {"maps", map_part}};

}  // namespace

std::vector<http::Endpoint> endpoints(Services* services) {
  std::vector<http::Endpoint> all;
  for (const auto& [tag, part] : parts) {
    std::vector<TableRow> rows = part().rows;
    for (auto& [endpoint, bind] : rows) {
      endpoint.tag = tag;
      if (endpoint.rounded) endpoint.parameters.push_back(digits_parameter());
      if (services != nullptr) bind(*services, endpoint);
      all.push_back(std::move(endpoint));
    }
  }
  return all;
}

Result<std::shared_ptr<const ingest::ModelInForce>> model_of(const Services& services,
                                                             const std::string& robot_id, std::string field) {
  if (auto model = services.models.find(robot_id)) return model;
  if (services.fleet.find(robot_id) == nullptr)
    return tl::unexpected(ingest::unknown_robot(std::move(field), robot_id));
  return fail(
      Fault::not_found, std::move(field),
      "robot " + robot_id + " has sent telemetry, but has no robot file: it was removed, or never added");
}

described::Schemas schemas() {
  described::Schemas all{
      {"accounts", answers::accounts_table().schema()},
      {"back-test", server::back_test_table().schema()},
      {"contradiction", contradiction_table().schema()},
      {"contradiction-event", contradiction_event_table().schema()},
      {"ledger", answers::ledger_table().schema()},
      {"openapi", http::openapi_schema()},
      {"problem", http::problem_schema()},
      {"robot", robot::robot_schema()},
      {"reset-event", described::of_object("Events were lost: read the state again", {}, Schema::object())}};
  const auto add = [&all](const described::Schemas& more) {
    all.insert(all.end(), more.begin(), more.end());
  };
  for (const auto& schemas_of : {answers::drive_schemas, answers::matrix_schemas, answers::autonomy_schemas,
                                 answers::profile_schemas, answers::estimate_schemas, gap::diagnosis_schemas,
                                 http::operations_schemas, http::session_schemas, request_schemas})
    add(schemas_of());
  for (const auto& [tag, part] : parts) add(part().schemas);
  return all;
}

}  // namespace joulecast::api

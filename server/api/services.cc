#include "server/api/services.h"

#include <array>
#include <charconv>
#include <iterator>
#include <string>
#include <string_view>
#include <utility>

#include "server/api/common_parameters.h"

namespace joulecast::api {

namespace {

std::vector<TableRow> table() {
  constexpr std::pair<const char*, std::vector<TableRow> (*)()> parts[] = {
      {"robots", robot_rows},          {"robots", attention_rows},    {"robots", recent_value_rows},
      {"models", model_rows},          {"diagnosis", diagnosis_rows}, {"diagnosis", gap_history_rows},
      {"events", event_log_rows},      {"access", audit_rows},        {"operations", cluster_rows},
      {"missions", mission_list_rows}, {"missions", mission_rows},    {"missions", mission_request_rows},
      {"missions", floor_map_rows},    {"planning", planning_rows},   {"maps", map_rows}};
  std::vector<TableRow> all;
  for (const auto& [tag, part] : parts) {
    std::vector<TableRow> rows = part();
    for (TableRow& row : rows) {
      row.endpoint.tag = tag;
      if (row.endpoint.rounded) row.endpoint.parameters.push_back(digits_parameter());
    }
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

history::Past past_of(const Services& services, const http::Request& request) {
  const bool newest = request.header("cache-control").find("no-cache") != std::string_view::npos;
  return newest ? history::Past{services.store, std::nullopt} : services.store.past();
}

http::Response told_staleness(http::Response response, const history::Past& past) {
  if (past.staleness_s) {
    std::array<char, 32> text{};
    const auto end =
        std::to_chars(text.data(), text.data() + text.size(), *past.staleness_s, std::chars_format::fixed, 3);
    response.headers.emplace_back("Joulecast-Staleness", std::string(text.data(), end.ptr));
  }
  return response;
}

}  // namespace joulecast::api

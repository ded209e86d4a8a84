#include <algorithm>
#include <array>
#include <nlohmann/json.hpp>
#include <set>
#include <thread>
#include <utility>
#include <vector>

#include "server/api/autonomy.h"
#include "server/api/json_writer.h"
#include "server/api/services.h"

namespace joulecast::api {
namespace {

using nlohmann::json;

constexpr std::size_t max_robots = 10'000;

std::string_view name_of(Fault fault) {
  switch (fault) {
    case Fault::invalid:
      return "invalid";
    case Fault::not_found:
      return "not_found";
    case Fault::infeasible:
      return "infeasible";
    default:
      return "internal";
  }
}

struct Row {
  std::string robot_id;
  const json* own = nullptr;  // this robot's request, instead of the common one
  std::size_t own_index = 0;
  std::string text;
};

void write_problem(Row& row, const Error& error) {
  JsonWriter out;
  out.begin_object().field("robot_id", row.robot_id);
  out.key("problem").begin_object();
  out.field("fault", name_of(error.fault)).field("field", error.field).field("message", error.message);
  out.end_object().end_object();
  row.text = out.take();
}

// Answers rows first, first + 2, first + 4 ...; a request that is the same for all robots is read once.
void answer_rows(std::vector<Row>& rows, std::size_t first, const json& common, Services& services) {
  const bool same = !depends_on_whereabouts(common);
  std::optional<AutonomyRequest> read;
  for (std::size_t k = first; k < rows.size(); k += 2) {
    Row& row = rows[k];
    const auto model = model_of(services, row.robot_id);
    if (!model) {
      write_problem(row, model.error());
      continue;
    }
    const auto live = services.fleet.find(row.robot_id);
    const Whereabouts now = whereabouts(live.get());
    const bool shared = row.own == nullptr && (same || (!now.pose && !now.payload_kg));
    std::optional<AutonomyRequest> mine;
    if (!shared || !read) {
      Fields fields(
          row.own != nullptr ? *row.own : common,
          row.own != nullptr ? "/robots/" + std::to_string(row.own_index) + "/request" : "/request");
      mine = read_autonomy(fields, now, false);
      if (Result<void> done = fields.finish(); !done) {
        write_problem(row, done.error());
        continue;
      }
      if (shared) read = std::exchange(mine, std::nullopt);
    }
    const AutonomyRequest& request = shared ? *read : *mine;
    const server::RobotOutlook robot = services.forecasts.of(*model);
    const Result<Autonomy> autonomy = autonomy_of(request, robot, live.get(), services.cost_tables);
    if (!autonomy) {
      write_problem(row, autonomy.error());
      continue;
    }
    row.text = autonomy_json(*autonomy, request, robot, live.get());
    if (request.dialect != Dialect::joulecast) {
      JsonWriter named;
      named.begin_object().field("robot_id", row.robot_id).key("battery").raw(row.text).end_object();
      row.text = named.take();
    }
  }
}

}  // namespace

Result<std::string> fleet_autonomy_answer(const json& body, Services& services) {
  Fields fields(body);
  const json nothing = json::object();
  const json* common = fields.member("request");
  if (common != nullptr && !common->is_object()) fields.fault("request", "must be an object");
  const json* robots = fields.member("robots");
  std::vector<Row> rows;
  if (robots == nullptr) {
    for (const auto& model : services.models.all()) rows.push_back({model->robot.robot_id, nullptr, 0, {}});
  } else if (!robots->is_array() || robots->size() > max_robots) {
    fields.fault("robots", "must be an array of at most " + std::to_string(max_robots) + " robots");
  } else {
    for (std::size_t k = 0; k < robots->size() && fields.ok(); ++k) {
      const json& given = (*robots)[k];
      if (given.is_string()) {
        rows.push_back({given.get<std::string>(), nullptr, k, {}});
        continue;
      }
      Fields own(given, fields.pointer("robots") + "/" + std::to_string(k));
      Row row{own.text("robot_id", 256), own.member("request"), k, {}};
      if (row.own != nullptr && !row.own->is_object()) own.fault("request", "must be an object");
      if (Result<void> done = own.finish(); !done) fields.fault(std::move(done.error()));
      rows.push_back(std::move(row));
    }
  }
  if (Result<void> done = fields.finish(); !done) return tl::unexpected(std::move(done.error()));
  // A fault of the common request is the caller's, whatever the robots.
  const json& shared = common != nullptr ? *common : nothing;
  Fields check(shared, "/request");
  read_autonomy(check, {}, false);
  if (Result<void> done = check.finish(); !done) return tl::unexpected(std::move(done.error()));

  {
    std::jthread other([&] { answer_rows(rows, 1, shared, services); });
    answer_rows(rows, 0, shared, services);
  }
  std::size_t length = 16;
  for (const Row& row : rows) length += row.text.size() + 1;
  std::string text;
  text.reserve(length);
  text = "{\"robots\":[";
  for (std::size_t k = 0; k < rows.size(); ++k) {
    if (k > 0) text += ',';
    text += rows[k].text;
  }
  text += "]}";
  return text;
}

}  // namespace joulecast::api

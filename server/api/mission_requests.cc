#include "ingest/mission_requests.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "base/try.h"
#include "describe/input.h"
#include "server/api/change.h"
#include "server/api/services.h"
#include "signals/ids.h"
#include "telemetry/validation.h"

namespace joulecast::api {
namespace {

using ingest::MissionRequest;
using signals::MissionEvent;
using signals::MissionPhase;

constexpr std::array<std::string_view, 3> phase_names{"started", "finished", "aborted"};

std::string_view name_of(MissionPhase phase) {
  return phase_names[static_cast<std::size_t>(phase) - 1];
}

const auto mission_event_input =
    described::Input<MissionEvent>("Request to begin or end a mission")
        .choice(
            "event",
            [](MissionEvent& event, std::size_t name) { event.phase = static_cast<MissionPhase>(1 + name); },
            phase_names, "started begins the mission, finished or aborted ends it")
        .text("mission_id", &MissionEvent::mission_id, signals::max_mission_id_length,
              "the mission's name, the same when it starts and ends", {},
              {{"minLength", 1}, {"pattern", "^[A-Za-z0-9._-]+$"}})
        .number(
            "payload_kg",
            [](MissionEvent& event, std::optional<double> given) {
              event.payload_kg = given.value_or(signals::unmeasured);
            },
            {.minimum = 0, .maximum = 1e5},
            "declared load of the mission, when it starts; null or absent: undeclared")
        .text("note", &MissionEvent::note, signals::max_note_length, "free text for people", "")
        .check([](Fields& fields, MissionEvent& event, described::Nothing&) {
          if (fields.ok() && !signals::is_valid_mission_id(event.mission_id))
            fields.fault("mission_id", "may contain only letters, digits, '.', '_' and '-'");
          if (fields.ok() && event.phase != MissionPhase::started && std::isfinite(event.payload_kg))
            fields.fault("payload_kg", "is declared when the mission starts, not when it ends");
        });

// The announced or requested mission that is open once the requests before are carried out; empty: none.
std::string open_mission(const ingest::RobotSnapshot& now, const std::vector<MissionRequest>& requests) {
  if (!requests.empty() && requests.back().request_utime_us > now.mission_request_utime_us) {
    const MissionEvent& last = requests.back().event;
    return last.phase == MissionPhase::started ? last.mission_id : "";
  }
  return now.mission_implicit ? "" : now.mission_id;
}

// Contradictions to what is open are conflicts.
Result<void> check_order(const MissionEvent& event, const std::string& open) {
  if (event.phase == MissionPhase::started && open.empty()) return {};
  if (event.phase != MissionPhase::started && open == event.mission_id) return {};
  const std::string state = open.empty() ? std::string("no mission of the robot is open")
                                         : std::string("mission ").append(open).append(" is open");
  const std::string rule = event.phase == MissionPhase::started ? "; it must end before another one starts"
                                                                : "; only the open mission can end";
  return fail(
      Fault::conflict, "mission_id",
      std::string("mission ").append(event.mission_id).append(" cannot be ").append(name_of(event.phase)) +
          ": " + state + rule);
}

// The time of the robot's clock, after that of the last request.
std::int64_t robot_utime_us(const ingest::RobotSnapshot& now, std::int64_t host_utime_us,
                            const std::vector<MissionRequest>& requests) {
  const std::int64_t utime_us = host_utime_us + now.clock_ahead_us;
  return requests.empty() ? utime_us : std::max(utime_us, requests.back().event.utime_us + 1);
}

struct Requested {
  std::string robot_id;
  const MissionEvent& event;
};

const auto requested_table =
    Table<Requested>("An accepted request to begin or end a mission")
        .value("robot_id", AT(robot_id), "id of the robot")
        .word(
            "event", [](const Requested& r) { return name_of(r.event.phase); }, phase_names,
            "as in the request")
        .value("mission_id", AT(event.mission_id), "as in the request")
        .time("", AT(event.utime_us),
              "when the mission begins or ends, by the robot's clock as of its last sample")
        .number_or_null("payload_kg", AT(event.payload_kg), "as in the request")
        .value("note", AT(event.note), "as in the request");

Result<Response> request_mission(Services& services, const Request& request) {
  const std::string& id = request.param("id");
  TRY(model_of(services, id));
  TRY_ASSIGN(MissionEvent event, mission_event_input.read(*request.json));
  TRY_ASSIGN(auto requests, ingest::stored_mission_requests(services.store, id));
  const auto snapshot = services.fleet.find(id);
  const ingest::RobotSnapshot now = snapshot != nullptr ? *snapshot : ingest::RobotSnapshot{};
  TRY(check_order(event, open_mission(now, requests)));
  const std::int64_t host_us = services.now_utime_us();
  event.utime_us = robot_utime_us(now, host_us, requests);
  if (const auto fault = telemetry::check_plausible(event))
    return invalid(
        "/" + (fault->field == "payload_mass" ? std::string("payload_kg") : std::string(fault->field)),
        telemetry::describe(*fault));
  const std::int64_t before_us = requests.empty() ? 0 : requests.back().request_utime_us;
  const MissionRequest accepted{event, std::max(host_us, before_us + 1)};
  requests.push_back(accepted);

  const auto answer = [id, event](std::int64_t) {
    Response response = http::json_response(requested_table.text({id, event}));
    response.status = 202;
    return response;
  };
  const history::Learned all{id, std::string(ingest::mission_request_topic), accepted.request_utime_us,
                             ingest::mission_requests_json(requests)};
  RequestChange request_change(services, request);
  const history::Outcome done =
      services.writer.execute(request_change.answered_by(answer, history::PutLearned{all, 0, before_us}));
  if (done) services.request_mission(id, accepted);
  return request_change.result(done);
}

}  // namespace

Part mission_request_part() {
  Rows rows;
  rows.add(Method::post, "/v1/robots/{id}/missions", "requestMission", Role::operate,
           "Begins or ends a mission of a robot that does not announce missions. It begins and ends at the "
           "time of the robot's clock; samples before and after belong to no announced mission",
           "mission-requested", request_mission,
           {.request_schema = "mission-request",
            .success_status = 202,
            .error_statuses = {404, 409, 422},
            .run = Run::write});
  return {
      std::move(rows),
      {{"mission-request", mission_event_input.schema()}, {"mission-requested", requested_table.schema()}}};
}

}  // namespace joulecast::api

#include <algorithm>
#include <array>
#include <cmath>
#include <memory>
#include <mutex>
#include <nlohmann/json.hpp>
#include <optional>
#include <ranges>
#include <unordered_map>
#include <utility>
#include <vector>

#include "answers/mission.h"
#include "base/json_number.h"
#include "base/try.h"
#include "describe/input.h"
#include "server/api/change.h"
#include "server/api/common_parameters.h"
#include "server/api/csv.h"
#include "server/api/services.h"
#include "signals/ids.h"
#include "telemetry/validation.h"

// One mission: its accounts, ledger, trace, telemetry and covariates; its annulment; requests to begin or end
// one.
namespace joulecast::api {
namespace {

constexpr std::size_t most_reason = 1024;  // bytes

// The requested time of a mission.
struct Span {
  history::MissionKey key;
  history::TimeRange range;
};

Result<Span> span_of(const Request& request) {
  TRY_ASSIGN(const history::MissionKey key, path_id(request, "mission"));
  TRY_ASSIGN(const history::TimeRange range, range_of(request));
  return Span{key, range};
}

Result<history::Mission> mission_of(const Services& services, const Request& request) {
  TRY_ASSIGN(const history::MissionKey key, path_id(request, "mission"));
  return services.store.mission(key);
}

// Cache of the mission summaries that were requested since the last commit. Its stamp is the number of
// commits before the store was read, so that every commit invalidates it.
class MissionSummaries {
 public:
  explicit MissionSummaries(const Services& services) : services_(services) {}

  std::optional<Response> find(const Request& request) {
    const Result<history::MissionKey> key = path_id(request, "mission");
    if (!key) return std::nullopt;
    const std::uint64_t commits = services_.writer.status().commits;
    const std::lock_guard lock(mutex_);
    if (commits_ != commits) return std::nullopt;
    const auto found = texts_.find(*key);
    if (found == texts_.end()) return std::nullopt;
    Response response;
    response.shared_body = found->second;
    return response;
  }

  Result<Response> read(const Request& request) {
    const std::uint64_t commits = services_.writer.status().commits;
    TRY_ASSIGN(const history::Mission mission, mission_of(services_, request));
    Response response;
    response.shared_body = std::make_shared<const std::string>(answers::mission_table().text(mission));
    const std::lock_guard lock(mutex_);
    if (commits > commits_ || texts_.size() >= most_texts) texts_.clear();
    if (commits >= commits_) {
      commits_ = commits;
      texts_.insert_or_assign(mission.key, response.shared_body);
    }
    return response;
  }

 private:
  static constexpr std::size_t most_texts = 1000;
  const Services& services_;
  std::mutex mutex_;
  std::uint64_t commits_ = 0;
  std::unordered_map<history::MissionKey, std::shared_ptr<const std::string>> texts_;
};

struct Annulment {
  std::string reason;
};

const auto annulment_input =
    described::Input<Annulment>("Request to annul a mission")
        .text("reason", &Annulment::reason, most_reason, "reason for the annulment", {}, {{"minLength", 1}})
        .check([](Fields& fields, Annulment& read, described::Nothing&) {
          if (fields.ok() && read.reason.empty()) fields.fault("reason", "must not be empty");
        });

// Excludes an ended mission from all sums and from the training of forecasts. Lists keep it, with the reason.
Result<Response> annul(Services& services, const Request& request) {
  TRY_ASSIGN(const auto [reason], annulment_input.read(*request.json));
  TRY_ASSIGN(history::Mission mission, mission_of(services, request));
  if (mission.state == history::MissionState::open)
    return fail(Fault::conflict, "id", "the mission is still open; only one that ended can be annulled");
  if (!history::findings_of(mission).annulled.empty())
    return fail(Fault::conflict, "id", "the mission is annulled already");
  const std::int64_t now = services.now_utime_us();
  mission.findings_json = history::annulled_findings(mission, now, reason);
  const nlohmann::json detail{
      {"mission", mission.key}, {"mission_id", mission.mission_id}, {"reason", reason}};
  std::vector<history::Command> commands{
      history::AppendEvent{{0, now, mission.robot_id, "mission_annulled", json_text(detail)}}};
  const auto model = services.models.find(mission.robot_id);
  if (auto learned = model ? services.forecasts.forget(model, mission.start_utime_us) : std::nullopt)
    commands.emplace_back(history::PutLearned{std::move(*learned)});
  RequestChange request_change(services, request);
  history::Change change = request_change.answered_by(
      [mission](std::int64_t) { return http::json_response(answers::mission_table().text(mission)); },
      history::CheckpointMission{mission, {}, {}, std::nullopt});
  change.add_before([commands = std::move(commands)](std::int64_t) { return commands; });
  const history::Outcome done = services.writer.execute(std::move(change));
  if (!done && model) services.forecasts.learnt_elsewhere(mission.robot_id);  // as it is stored
  return request_change.result(done);
}

Response ledger_csv(const Request& request, const history::Mission& mission) {
  Csv csv(request, "term energy_j");
  for (std::size_t k = 0; k < signals::term_count; ++k)
    csv.field(signals::term_names[k]).field(mission.accounts.ledger.value[k]).end_row();
  return csv.response("mission-" + std::to_string(mission.key) + "-ledger");
}

Response covariates_csv(const Request& request, const history::CovariatePage& page, history::MissionKey key) {
  Csv csv(request, "name utime_us value");
  for (const signals::CovariateSeries& series : signals::series_of(page.items))
    for (std::size_t k = 0; k < series.value.size(); ++k)
      csv.field(series.name).field(series.utime_us[k]).exact(series.value[k]).end_row();
  return csv.response("mission-" + std::to_string(key) + "-covariates", page.next_cursor);
}

const auto mission_ledger_table =
    Table<history::Mission>("Ledger of a mission")
        .value("id", AT(key), "number of the mission, as in /v1/missions/{id}")
        .value("robot_id", AT(robot_id), "the robot's id, as in its telemetry and its file")
        .value("mission_id", AT(mission_id), "the robot's identifier of the mission")
        .value("model_version", AT(model_version),
               "model version of the modelled energy; null: the robot had none")
        .object("ledger", AT(accounts), "energy by term", answers::ledger_table());

Result<Response> ledger(const Services& services, const Request& request) {
  TRY_ASSIGN(const history::Mission mission, mission_of(services, request));
  if (request.csv) return ledger_csv(request, mission);
  return http::json_response(mission_ledger_table.text(mission));
}

Response trace_csv(const Request& request, const history::Trace& trace, history::MissionKey key) {
  Csv csv(request,
          "start_utime_us covered_s measured_power_min_w measured_power_mean_w measured_power_max_w "
          "modelled_power_min_w modelled_power_mean_w modelled_power_max_w speed_min_m_s speed_mean_m_s "
          "speed_max_m_s state_of_charge measured_j modelled_j x_m y_m");
  for (const history::TraceBucket& b : trace.buckets) {
    csv.field(b.start_utime_us).field(b.covered_s);
    for (const history::Band& band : {b.measured_power_w, b.modelled_power_w, b.speed_m_s})
      csv.field(band.min).field(band.mean).field(band.max);
    csv.field(b.state_of_charge).field(b.measured_j).field(b.modelled_j).field(b.x_m).field(b.y_m).end_row();
  }
  return csv.response("mission-" + std::to_string(key) + "-trace");
}

Response telemetry_csv(const Request& request, const history::TelemetryPage& page, history::MissionKey key) {
  std::string names = "utime_us sequence";
  for (const signals::SampleField& field : signals::sample_fields) {
    names.append(" ").append(field.key);
    if (field.part == "right" || field.part == "left") names.append(".").append(field.part);
  }
  Csv csv(request, names);
  for (const signals::Sample& sample : page.items) {
    csv.field(sample.utime_us).field(sample.sequence);
    for (const double* number : signals::numbers_of(sample)) csv.exact(*number);
    csv.end_row();
  }
  return csv.response("mission-" + std::to_string(key) + "-telemetry", page.next_cursor);
}

using Bucket = history::TraceBucket;

struct TraceAnswer {
  history::MissionKey key;
  const history::Trace& trace;
};
struct BandAnswer {
  const history::Trace& trace;
  history::Band Bucket::*member;
};

// A value of each item.
template <class Items, class Get>
std::vector<double> column_of(const Items& items, Get get) {
  const auto values = items | std::views::transform(get);
  return {values.begin(), values.end()};
}

auto of_spans(double Bucket::*member) {
  return [member](const TraceAnswer& a) { return column_of(a.trace.buckets, member); };
}

auto of_band(double history::Band::*member) {
  return [member](const BandAnswer& a) {
    return column_of(a.trace.buckets, [&](const auto& bucket) { return bucket.*a.member.*member; });
  };
}

auto as_band(history::Band Bucket::*member) {
  return [member](const TraceAnswer& a) { return BandAnswer{a.trace, member}; };
}

Table<BandAnswer> make_band(int places) {
  using history::Band;
  return Table<BandAnswer>()
      .column("min", of_band(&Band::min), "least", places, true)
      .column("mean", of_band(&Band::mean), "mean", places, true)
      .column("max", of_band(&Band::max), "greatest", places, true);
}

const auto power_table = make_band(3), speed_table = make_band(4);
const auto trace_table =
    Table<TraceAnswer>("A mission over time, in columns")
        .value("id", AT(key), "number of the mission, as in /v1/missions/{id}")
        .value("width_us", AT(trace.width_us), "length of each span")
        .integers(
            "start_utime_us",
            [](const TraceAnswer& a) { return a.trace.buckets | std::views::transform(AT(start_utime_us)); },
            "start of each span, microseconds since 1970 by the robot's clock")
        .column("covered_s", of_spans(&Bucket::covered_s), "time of each span with telemetry", 6, true)
        .object("measured_power_w", as_band(&Bucket::measured_power_w),
                "power from the battery by the sensors", power_table)
        .object("modelled_power_w", as_band(&Bucket::modelled_power_w), "power from the battery by the model",
                power_table)
        .object("speed_m_s", as_band(&Bucket::speed_m_s), "forward speed", speed_table)
        .column("state_of_charge", of_spans(&Bucket::state_of_charge), "at the end of each span", 6, true)
        .column("measured_j", of_spans(&Bucket::measured_j),
                "measured energy since the mission began, at the end of each span", 3, true)
        .column("modelled_j", of_spans(&Bucket::modelled_j),
                "modelled energy since the mission began, at the end of each span", 3, true)
        .column("x_m", of_spans(&Bucket::x_m), "mean place of each span", 4, true)
        .column("y_m", of_spans(&Bucket::y_m), "mean place of each span", 4, true);

Result<Response> trace(const Services& services, const Request& request) {
  TRY_ASSIGN(const Span span, span_of(request));
  TRY_ASSIGN(const auto found, services.store.trace(span.key, span.range, *request.query_integer("points")));
  if (request.csv) return trace_csv(request, found, span.key);
  return http::json_response(trace_table.text({span.key, found}));
}

struct TelemetryAnswer {
  history::MissionKey key;
  const history::TelemetryPage& page;
};

std::vector<double> numbers_of(const TelemetryAnswer& a, std::size_t k) {
  return column_of(a.page.items, [k](const auto& sample) { return *signals::numbers_of(sample)[k]; });
}

std::string_view words_of(std::string_view key) {
  constexpr std::pair<std::string_view, std::string_view> all[] = {
      {"wheel_velocity_rad_s", "speed of the wheels, positive forward"},
      {"motor_voltage_v", "mean voltage at the armatures"},
      {"motor_current_a", "armature current, positive drives forward"},
      {"battery_voltage_v", "at the terminals; null: not measured"},
      {"battery_current_a", "positive: discharging; null: not measured"},
      {"command_speed_m_s", "commanded forward speed"},
      {"command_yaw_rate_rad_s", "commanded rate of turning"},
      {"yaw_rate_rad_s", "by the gyroscope, positive to the left"},
      {"pitch_rad", "nose up positive"},
      {"x_m", "place on the map"},
      {"y_m", "place on the map"},
      {"heading_rad", "direction on the map, anticlockwise from the x axis"},
      {"motor_temperature_c", "of the windings"},
      {"payload_kg", "as declared by the robot"}};
  for (const auto& [name, words] : all)
    if (name == key) return words;
  return {};
}

Table<TelemetryAnswer> make_telemetry() {
  using A = TelemetryAnswer;
  Table<A> table("Samples of a mission as received, in columns; null = not measured");
  const auto integers = [](auto signals::Sample::*member) {
    return [member](const A& a) { return a.page.items | std::views::transform(member); };
  };
  table.value("id", &A::key, "number of the mission, as in /v1/missions/{id}")
      .integers("utime_us", integers(&signals::Sample::utime_us),
                "robot's clock of each sample, microseconds since 1970")
      .integers("sequence", integers(&signals::Sample::sequence), "sequence number of the robot's messages");
  for (std::size_t k = 0; k < signals::sample_numbers; ++k) {
    const signals::SampleField& field = signals::sample_fields[k];
    const std::string name(field.key);
    if (field.part == "right")
      table.exact_sides(
          name,
          [k](const A& a) {
            return std::array{numbers_of(a, k), numbers_of(a, k + 1)};
          },
          std::string(words_of(field.key)).append("; [right, left], each a column"));
    else if (field.part != "left")
      table.exact(
          name, [k](const A& a) { return numbers_of(a, k); }, words_of(field.key));
  }
  table.text_or_null("next_cursor", AT(page.next_cursor), described::cursor_words);
  return table;
}

const auto telemetry_table = make_telemetry();

Result<Response> raw_telemetry(const Services& services, const Request& request) {
  TRY_ASSIGN(const Span span, span_of(request));
  TRY_ASSIGN(const auto found, services.store.telemetry(span.key, span.range, page_of(request)));
  if (request.csv) return telemetry_csv(request, found, span.key);
  return http::json_response(telemetry_table.text({span.key, found}));
}

struct CovariatesAnswer {
  history::MissionKey key;
  const history::CovariatePage& page;
};

const auto series_table =
    Table<signals::CovariateSeries>()
        .value("name", AT(name), "with its unit; a label as name=label")
        .integers("utime_us", AT(utime_us), "start of each value, which is valid until the next one")
        .exact("value", AT(value), "of a label 1 (set) or 0 (not set); null: unknown from then on");
const auto covariates_table =
    Table<CovariatesAnswer>("Changes of a mission's covariates, one series per name")
        .value("id", AT(key), "number of the mission, as in /v1/missions/{id}")
        .list(
            "covariates", [](const CovariatesAnswer& a) { return signals::series_of(a.page.items); },
            "in the order of their first change in the page", series_table)
        .text_or_null("next_cursor", AT(page.next_cursor), described::cursor_words);

Result<Response> covariates(const Services& services, const Request& request) {
  TRY_ASSIGN(const Span span, span_of(request));
  TRY_ASSIGN(const auto found, services.store.covariates(span.key, span.range, page_of(request)));
  if (request.csv) return covariates_csv(request, found, span.key);
  return http::json_response(covariates_table.text({span.key, found}));
}

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

// A table, as long as its rows.
Part mission_part() {
  using Type = Parameter::Type;
  const std::vector<Parameter> span = range_parameters("data");
  Part part{.schemas = {{"annul-request", annulment_input.schema()}}};
  part.rows.push_back(
      {{.method = Method::get,
        .path = "/v1/missions/{id}",
        .operation_id = "getMission",
        .role = Role::read,
        .summary = "One mission: its energy, measured and modelled",
        .response_schema = "mission",
        .rounded = true,
        .etag = true,
        .error_statuses = {404}},
       [](Services& services, http::Endpoint& endpoint) {
         const auto summaries = std::make_shared<MissionSummaries>(services);
         endpoint.brief = [summaries](const Request& request) { return summaries->find(request); };
         endpoint.handler = [summaries](const Request& request) { return summaries->read(request); };
       }});
  part.add(
      Method::post, "/v1/missions/{id}/annul", "annulMission", Role::operate,
      "Excludes an ended mission from all sums and from training, with a reason that lists and the "
      "event log contain",
      {"mission", answers::mission_table().schema()}, annul,
      {.request_schema = "annul-request", .rounded = true, .error_statuses = {404, 409}, .run = Run::write});
  part.add(Method::get, "/v1/missions/{id}/ledger", "getMissionLedger", Role::read,
           "Energy of a mission by term; the sum of the terms is the battery's energy",
           {"mission-ledger", mission_ledger_table.schema()}, ledger,
           {.csv = true, .rounded = true, .etag = true, .error_statuses = {404}});
  part.add(
      Method::get, "/v1/missions/{id}/trace", "getMissionTrace", Role::read,
      "Power, speed, charge and position over a mission, as minimum, mean and maximum of equal intervals",
      {"mission-trace", trace_table.schema()}, trace,
      {.parameters = with(span, {{.name = "points",
                                  .type = Type::integer,
                                  .description = "largest number of intervals",
                                  .minimum = 1,
                                  .maximum = static_cast<double>(history::max_trace_points),
                                  .usual = 1000}}),
       .csv = true,
       .rounded = true,
       .etag = true,
       .error_statuses = {404}});
  part.add(Method::get, "/v1/missions/{id}/telemetry", "getMissionTelemetry", Role::read,
           "The samples of a mission as received, within the retention",
           {"mission-telemetry", telemetry_table.schema()}, raw_telemetry,
           {.parameters = with(span, {limit_parameter("samples a page", 1000, history::max_telemetry_samples),
                                      cursor_parameter()}),
            .csv = true,
            .error_statuses = {404}});
  part.add(Method::get, "/v1/missions/{id}/covariates", "getMissionCovariates", Role::read,
           "Changes of a mission's covariates, within the retention",
           {"mission-covariates", covariates_table.schema()}, covariates,
           {.parameters = with(span, {limit_parameter("changes a page", 1000, history::max_telemetry_samples),
                                      cursor_parameter()}),
            .csv = true,
            .etag = true,
            .error_statuses = {404}});
  return part;
}

Part mission_request_part() {
  Part part{.schemas = {{"mission-request", mission_event_input.schema()}}};
  part.add(Method::post, "/v1/robots/{id}/missions", "requestMission", Role::operate,
           "Begins or ends a mission of a robot that does not announce missions. It begins and ends at the "
           "time of the robot's clock; samples before and after belong to no announced mission",
           {"mission-requested", requested_table.schema()}, request_mission,
           {.request_schema = "mission-request",
            .success_status = 202,
            .error_statuses = {404, 409},
            .run = Run::write});
  return part;
}

}  // namespace joulecast::api

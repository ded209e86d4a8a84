#include <chrono>
#include <nlohmann/json.hpp>
#include <utility>

#include "base/json_writer.h"
#include "base/try.h"
#include "server/api/change.h"
#include "server/api/common_parameters.h"
#include "server/api/requests.h"
#include "server/api/services.h"
#include "server/diagnosis/diagnosis_service.h"

// Diagnoses of the gap as jobs: start, follow, cancel, read.
namespace joulecast::api {
namespace {

using history::DiagnosisRecord;

struct DiagnosisAnswer {
  const DiagnosisRecord& record;
  std::optional<server::DiagnosisProgress> progress;  // of one that has not ended
  std::size_t ahead = 0;                              // of one that is about to be queued
};

history::DiagnosisState state_of(const DiagnosisAnswer& a) {
  return a.progress ? a.progress->state : a.record.state;
}

double done_share(const DiagnosisAnswer& a) {
  if (a.progress) return a.progress->fraction;
  return a.record.state == history::DiagnosisState::done ? 1 : 0;
}

// Without the result.
const auto job_table =
    Table<DiagnosisAnswer>()
        .value("id", AT(record.id), "number of the diagnosis, as in /v1/diagnoses/{id}")
        .value("robot_id", AT(record.robot_id), "the robot that is diagnosed")
        .word("state", state_of, history::names_of<history::DiagnosisState>,
              "interrupted: the service stopped while it ran")
        .word("cause", AT(record.cause), history::names_of<history::DiagnosisCause>,
              "request: started by a client; watch: started after a detected drift")
        .value("progress", done_share, "completed share of the work", {{"minimum", 0}, {"maximum", 1}})
        .value(
            "ahead", [](const DiagnosisAnswer& a) { return a.progress ? a.progress->ahead : a.ahead; },
            "jobs before it in the queue")
        .time("created", AT(record.created_utime_us),
              "time of creation, microseconds since 1970 by the host's clock")
        .time(
            "started",
            [](const DiagnosisAnswer& a) {
              return a.progress ? a.progress->started_utime_us : a.record.started_utime_us;
            },
            "start of its execution; null: not started")
        .time("finished", AT(record.finished_utime_us), "its end; null: not ended")
        .value("model_version", AT(record.model_version), "the model that was diagnosed")
        .integers("fitted_on", AT(record.fitted_on), "diagnosed missions")
        .integers("held_back", AT(record.held_back), "missions held back for a back-test")
        .text_or_null("error", AT(record.error), "reason of its failure; null: not failed")
        .json("request", AT(record.request_json), "the request that started it",
              described::of_type("object"));

const auto listed_diagnosis_table =
    Table<DiagnosisAnswer>("A diagnosis of a list, or that has ended")
        .named("listed-diagnosis")
        .include(job_table, std::identity())
        .json("summary", AT(record.summary_json), "verdict, gap, effects and shrinkage of the result",
              described::of_type("object", true));

const auto diagnosis_table =
    Table<DiagnosisAnswer>("A diagnosis of the gap between a robot and its model")
        .include(job_table, std::identity())
        .json("result", AT(record.result_json),
              "output of `joulecast gap --json`; results of earlier versions lack members that were added "
              "later",
              described::or_null(described::of_reference("gap"), true))
        .compact_json(
            "model", AT(record.model_json),
            "robot file with the estimated effects applied; null: no effect was found, or one of several "
            "effects must be selected first",
            described::of_type("object", true));

Response answer_diagnosis(const Services& services, const DiagnosisRecord& diagnosis, std::size_t ahead = 0) {
  return http::json_response(
      diagnosis_table.text({diagnosis, services.diagnoses.progress(diagnosis.id), ahead}));
}

Result<Response> start(Services& services, const Request& request) {
  TRY_ASSIGN(const server::DiagnosisRequest wanted, read_diagnosis_request(*request.json));
  TRY(model_of(services, wanted.robot_id, "/robot_id"));
  RequestChange change(services, request);
  return change.result(
      services.diagnoses.submit(wanted, [&](const history::DiagnosisRecord& record, std::size_t ahead) {
        return change.answered_by([&services, record = record, ahead](std::int64_t id) mutable {
          record.id = id;
          Response response = answer_diagnosis(services, record, ahead);
          response.status = 202;
          response.headers.emplace_back("Location", "/v1/diagnoses/" + std::to_string(id));
          return response;
        });
      }));
}

Result<Response> get_diagnosis(const Services& services, const Request& request) {
  TRY_ASSIGN(const std::int64_t id, path_id(request, "diagnosis"));
  TRY_ASSIGN(const history::DiagnosisRecord stored, services.store.diagnosis(id));
  return answer_diagnosis(services, stored);
}

Result<Response> cancel(Services& services, const Request& request) {
  TRY_ASSIGN(const std::int64_t id, path_id(request, "diagnosis"));
  RequestChange change(services, request);
  return change.result(
      services.diagnoses.cancel(id, [&](const history::DiagnosisRecord& record, std::size_t) {
        return change.answered_by(
            [&services, record](std::int64_t) { return answer_diagnosis(services, record); });
      }));
}

Result<Response> list_diagnoses(const Services& services, const Request& request) {
  std::optional<std::string> robot;
  if (const auto id = request.query_value("robot_id")) robot = std::string(*id);
  const std::int64_t limit = *request.query_integer("limit");
  TRY_ASSIGN(const auto cursor, id_cursor(request));
  TRY_ASSIGN(const auto found,
             services.store.diagnoses(robot, cursor.value_or(history::whole_future), limit));
  const std::string next = next_id_cursor(found, limit, &DiagnosisRecord::id);
  const auto write = [&](JsonWriter& out, const DiagnosisRecord& d) {
    listed_diagnosis_table.write(out, {d, services.diagnoses.progress(d.id)});
  };
  if (request.csv)
    return csv_response(request, "diagnoses",
                        "id robot_id state cause created created_utime_us started_utime_us finished_utime_us "
                        "model_version error",
                        found, write, next);
  return page_response("diagnoses", found, write, next);
}

Result<Response> report(const Services& services, const Request& request) {
  TRY_ASSIGN(const std::int64_t id, path_id(request, "diagnosis"));
  TRY_ASSIGN(std::string html, services.store.diagnosis_report(id));
  Response response;
  response.content_type = "text/html; charset=utf-8";
  response.body = std::move(html);
  // Its scripts and styles are inline; the sandbox keeps them from the page's origin.
  response.headers.emplace_back("Content-Security-Policy",
                                "default-src 'none'; style-src 'unsafe-inline'; script-src 'unsafe-inline'; "
                                "img-src data:; sandbox allow-scripts");
  return response;
}

const auto progress_table =
    Table<server::DiagnosisProgress>("Progress of a diagnosis")
        .value("id", AT(id), "number of the diagnosis")
        .word("state", AT(state), std::array{"queued", "running"}, "queued or running")
        .value("progress", AT(fraction), "completed share of the work", {{"minimum", 0}, {"maximum", 1}})
        .value("ahead", AT(ahead), "diagnoses that run before it", {{"minimum", 0}});

// The progress of one job as events "progress", and its end as one event "ended" with the response of
// GET /v1/diagnoses/{id}, after which the stream ends.
class ProgressStream final : public http::StreamSource {
 public:
  ProgressStream(const Services& services, std::int64_t id) : services_(services), id_(id) {}

  Next pull(std::string& out) override {
    const auto now = std::chrono::steady_clock::now();
    if (const auto progress = services_.diagnoses.progress(id_)) {
      std::string text = progress_table.text(*progress);
      if (text != last_) {
        last_ = std::move(text);
        out += "event: progress\ndata: " + last_ + "\n\n";
        sent_ = now;
      } else if (now - sent_ >= heartbeat) {
        out += ": still here\n\n";
        sent_ = now;
      }
      return Next::wait;
    }
    const Result<history::DiagnosisRecord> stored = services_.store.diagnosis(id_);
    if (!stored) return Next::abort;
    out +=
        "event: ended\ndata: " + listed_diagnosis_table.text({*stored, services_.diagnoses.progress(id_)}) +
        "\n\n";
    return Next::end;
  }
  bool endless() const override { return true; }

 private:
  static constexpr std::chrono::seconds heartbeat{15};
  const Services& services_;
  std::int64_t id_;
  std::string last_;
  std::chrono::steady_clock::time_point sent_ = std::chrono::steady_clock::now();
};

Result<Response> events(const Services& services, const Request& request) {
  TRY_ASSIGN(const std::int64_t id, path_id(request, "diagnosis"));
  TRY(services.store.diagnosis(id));
  Response response;
  response.content_type = "text/event-stream";
  response.headers.emplace_back("Cache-Control", "no-cache");
  response.stream = std::make_shared<ProgressStream>(services, id);
  return response;
}

}  // namespace

Part diagnosis_part() {
  Part part{.schemas = {{"diagnosis-progress", progress_table.schema()},
                        {"listed-diagnosis", listed_diagnosis_table.schema()}}};
  part.add(Method::post, "/v1/diagnoses", "startDiagnosis", Role::operate,
           "Starts a diagnosis of the gap between a robot and its model over its stored missions, some of "
           "which are held back for a back-test",
           {"diagnosis", diagnosis_table.schema()}, start,
           {.request_schema = "diagnosis-request",
            .success_status = 202,
            .error_statuses = {404, 409},
            .run = Run::write});
  part.add(Method::get, "/v1/diagnoses", "listDiagnoses", Role::read,
           "Diagnoses, newest first, without their whole results",
           {"diagnosis-list",
            described::of_page("Diagnoses, newest first", "diagnoses", "the diagnoses, newest first",
                               listed_diagnosis_table.of_member())},
           list_diagnoses,
           {.parameters = {{.name = "robot_id", .description = "only of this robot"},
                           limit_parameter("diagnoses a page", 50, history::max_page_size),
                           cursor_parameter()},
            .csv = true,
            .rounded = true});
  part.add(Method::get, "/v1/diagnoses/{id}", "getDiagnosis", Role::read, "State and result of a diagnosis",
           {"diagnosis"}, get_diagnosis, {.etag = true, .error_statuses = {404}});
  part.add(Method::del, "/v1/diagnoses/{id}", "cancelDiagnosis", Role::operate,
           "Cancels a waiting or running diagnosis", {"diagnosis"}, cancel,
           {.error_statuses = {404, 409}, .run = Run::write});
  part.add(Method::get, "/v1/diagnoses/{id}/events", "streamDiagnosis", Role::read,
           "The progress of a diagnosis as server-sent events, until it has ended", {}, events,
           {.response_type = "text/event-stream",
            .events = {{"progress", "diagnosis-progress", "while it waits or runs, at every step"},
                       {"ended", "listed-diagnosis", "last of the stream"}},
            .error_statuses = {404}});
  part.add(Method::get, "/v1/diagnoses/{id}/report", "getDiagnosisReport", Role::read,
           "The report of a diagnosis as one self-contained page", {}, report,
           {.response_type = "text/html", .error_statuses = {404}, .run = Run::compute});
  return part;
}

}  // namespace joulecast::api

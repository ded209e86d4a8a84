#include "server/diagnosis/diagnosis_service.h"

#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "base/fault_boundary.h"
#include "base/try.h"
#include "base/utc_time.h"
#include "gap/diagnose/recordings.h"
#include "gap/verdict/adopt.h"
#include "gap/verdict/diagnosis_json.h"
#include "report/report.h"
#include "robot/robot_file.h"
#include "server/diagnosis/confined.h"
#include "server/diagnosis/mission_recordings.h"

namespace joulecast::server {
namespace {

using history::DiagnosisRecord;
using history::DiagnosisState;
using Json = nlohmann::json;
using nlohmann::ordered_json;

// Nice level of the working thread: requests go first.
constexpr int low_priority = 10;

Json request_json(const DiagnosisRequest& request) {
  Json text = {{"max_missions", request.max_missions}, {"hold_back", request.hold_back}};
  if (!request.missions.empty()) text["missions"] = request.missions;
  if (request.since_utime_us) text["since_utime_us"] = *request.since_utime_us;
  return text;
}

DiagnosisRequest request_of(const DiagnosisRecord& record) {
  DiagnosisRequest request;
  request.robot_id = record.robot_id;
  request.cause = record.cause;
  const Json text = Json::parse(record.request_json, nullptr, false);
  if (!text.is_object()) return request;
  request.max_missions = text.value("max_missions", request.max_missions);
  request.hold_back = text.value("hold_back", request.hold_back);
  request.missions = text.value("missions", request.missions);
  if (text.contains("since_utime_us")) request.since_utime_us = text["since_utime_us"].get<std::int64_t>();
  return request;
}

// The part of a result that lists show: the verdict, the effects and the reduction of the gap.
Json summary_of(const ordered_json& result) {
  Json effects = Json::array();
  for (const ordered_json& effect : result["effects"])
    effects.push_back({{"id", effect["id"]},
                       {"probability", effect["probability"]},
                       {"share", effect["share"]},
                       {"alternatives", effect["alternatives"]}});
  Json summary{{"effects", std::move(effects)}};
  for (const char* name : {"verdict", "verdict_title", "gap", "shrinkage"}) summary[name] = result[name];
  return summary;
}

// Spread evenly over the missions: every 1/share-th, one at least of three or more.
bool is_held_back(std::size_t index, std::size_t count, double share) {
  if (!(share > 0) || count < 2) return false;
  const double n = static_cast<double>(count);
  if (count >= 3 && share * n < 1) return index == count / 2;
  const double k = static_cast<double>(index);
  return std::floor((k + 1) * share + 1e-9) > std::floor(k * share + 1e-9);
}

// Result, summary, report and model of a diagnosis; the model is empty where there is nothing to adopt.
ordered_json told_of(const DiagnosisRecord& record, const gap::Diagnosis& diagnosis,
                     const telemetry::RecordingSet& recordings, const ingest::ModelInForce& model,
                     std::optional<std::int64_t> since_utime_us, const std::string& made_at) {
  ordered_json result = gap::diagnosis_to_json(diagnosis);
  result["model_version"] = model.version;
  result["since_utime_us"] = since_utime_us ? ordered_json(*since_utime_us) : ordered_json(nullptr);
  report::ReportOrigin origin;
  for (const telemetry::Recording& mission : recordings.missions)
    origin.sources.push_back(mission.mission_id);
  origin.model = "version " + std::to_string(model.version) + " of " + record.robot_id;
  origin.made_at = made_at;
  origin.software = "joulecastd " JOULECAST_VERSION;
  ordered_json found = {{"summary", summary_of(result)},
                        {"report", report::report_html(result, model.robot, origin)},
                        {"model", ""},
                        {"error", ""}};
  found["result"] = std::move(result);
  // The model of a forced adoption; of indistinguishable effects none has been chosen yet.
  const gap::Offer offer = gap::offer_of(diagnosis);
  if (offer.effects.empty()) return found;
  const Result<robot::RobotModel> extended = gap::take(offer, model.robot, {{}, true});
  if (extended)
    found["model"] = robot::to_json_text(*extended);
  else if (extended.error().fault != Fault::conflict)
    found["error"] = describe(extended.error());
  return found;
}

}  // namespace

struct DiagnosisService::Job {
  DiagnosisRecord record;
  DiagnosisRequest request;
  std::atomic<double> fraction = 0;
  std::atomic<bool> cancelled = false;
  std::int64_t started_utime_us = 0;  // written before the job is the running one
};

Result<void> DiagnosisService::start() {
  TRY(parts_.writer.execute(history::InterruptDiagnoses{parts_.now_utime_us()}));
  thread_ = std::jthread([this](const std::stop_token& stop) { work(stop); });
  return {};
}

void DiagnosisService::stop() {
  {
    const std::lock_guard lock(mutex_);
    thread_.request_stop();
    if (running_) running_->cancelled = true;
  }
  if (thread_.joinable()) thread_.join();
}

Result<std::int64_t> DiagnosisService::submit(const DiagnosisRequest& request, const Closing& closing) {
  const auto model = parts_.models.find(request.robot_id);
  if (model == nullptr) return tl::unexpected(ingest::unknown_robot("/robot_id", request.robot_id));
  for (std::size_t k = 0; k < request.missions.size(); ++k) {
    const auto mission = parts_.store.mission(request.missions[k]);
    const std::string field = "/missions/" + std::to_string(k);
    if (!mission) return fail(mission.error().fault, field, mission.error().message);
    if (mission->robot_id != request.robot_id)
      return fail(Fault::not_found, field,
                  "mission " + std::to_string(request.missions[k]) + " is one of robot " + mission->robot_id);
  }
  if (request.missions.empty()) TRY(any_ended(request));
  auto job = std::make_shared<Job>();
  job->request = request;
  DiagnosisRecord& record = job->record;
  record.robot_id = request.robot_id;
  record.created_utime_us = parts_.now_utime_us();
  record.cause = request.cause;
  record.request_json = request_json(request).dump();
  const std::lock_guard submitting(submitting_);
  std::size_t ahead = 0;
  {
    const std::lock_guard lock(mutex_);
    if (stopping()) return fail(Fault::unavailable, "", "the service is stopping");
    if (waiting_.size() >= options_.queue)
      return fail(Fault::unavailable, "",
                  std::to_string(waiting_.size()) + " diagnoses are waiting; try again later");
    ahead = waiting_.size() + (running_ ? 1 : 0);
  }
  history::Change change = closing ? closing(record, ahead) : history::Change{};
  change.command = history::AddDiagnosis{record};
  TRY_ASSIGN(const std::int64_t id, parts_.writer.execute(std::move(change)));
  record.id = id;
  {
    const std::lock_guard lock(mutex_);
    waiting_.push_back(std::move(job));
  }
  wake_.notify_all();
  return id;
}

Result<void> DiagnosisService::take_over(std::int64_t id) {
  TRY_ASSIGN(auto stored, parts_.store.diagnosis(id));
  auto job = std::make_shared<Job>();
  job->request = request_of(stored);
  job->record = std::move(stored);
  job->record.state = DiagnosisState::queued;
  job->record.fitted_on.clear();
  job->record.held_back.clear();
  {
    const std::lock_guard lock(mutex_);
    if (stopping()) return fail(Fault::unavailable, "", "the service is stopping");
    waiting_.push_back(std::move(job));
  }
  wake_.notify_all();
  return {};
}

Result<void> DiagnosisService::cancel(std::int64_t id, const Closing& closing) {
  TRY_ASSIGN(const auto stored, parts_.store.diagnosis(id));
  std::shared_ptr<Job> waiting, running;
  {
    const std::lock_guard lock(mutex_);
    const auto found = std::ranges::find_if(waiting_, [id](const auto& job) { return job->record.id == id; });
    if (found != waiting_.end()) {
      waiting = *found;
      waiting_.erase(found);
    } else if (running_ && running_->record.id == id) {
      running = running_;
    }
  }
  if (waiting) {
    end_record(waiting->record, DiagnosisState::cancelled, "cancelled before it began");
    history::Change change = closing ? closing(waiting->record, 0) : history::Change{};
    change.command = history::UpdateDiagnosis{waiting->record, {}};
    if (const auto done = parts_.writer.execute(std::move(change)); !done) {
      const std::lock_guard lock(mutex_);
      end_record(waiting->record, DiagnosisState::queued, {});
      waiting_.push_front(std::move(waiting));
      wake_.notify_all();
      return tl::unexpected(done.error());
    }
    settle(*waiting);
    return {};
  }
  if (running) {
    // The job ends soon after; until then its progress is what there is to see.
    if (closing) TRY(parts_.writer.execute(closing(stored, 0)));
    running->cancelled = true;
    return {};
  }
  return fail(
      Fault::conflict, "id",
      "diagnosis " + std::to_string(id) + " is " + std::string(history::name(stored.state)) + " already");
}

std::optional<DiagnosisProgress> DiagnosisService::progress(std::int64_t id) const {
  const std::lock_guard lock(mutex_);
  if (running_ && running_->record.id == id)
    return DiagnosisProgress{id, DiagnosisState::running, running_->fraction, 0, running_->started_utime_us};
  for (std::size_t k = 0; k < waiting_.size(); ++k) {
    if (waiting_[k]->record.id == id)
      return DiagnosisProgress{id, DiagnosisState::queued, 0, k + (running_ ? 1 : 0), {}};
  }
  return std::nullopt;
}

bool DiagnosisService::waits_or_runs(const std::string& robot_id) const {
  const std::lock_guard lock(mutex_);
  return (running_ && running_->record.robot_id == robot_id) ||
         std::ranges::any_of(waiting_, [&](const auto& job) { return job->record.robot_id == robot_id; });
}

DiagnosisCounts DiagnosisService::counts() const {
  const std::lock_guard lock(mutex_);
  DiagnosisCounts counts = counts_;
  counts.waiting = waiting_.size();
  counts.running = running_ != nullptr;
  return counts;
}

Result<void> DiagnosisService::any_ended(const DiagnosisRequest& request) const {
  using State = history::MissionState;
  history::MissionFilter ended;
  ended.robot_ids = {request.robot_id};
  ended.started.from_utime_us = request.since_utime_us.value_or(history::whole_past);
  ended.states = {State::finished, State::aborted, State::unfinished, State::superseded, State::interrupted};
  TRY_ASSIGN(const auto page, parts_.store.missions(ended, {.limit = 1, .cursor = {}}));
  if (!page.missions.empty()) return {};
  return fail(Fault::conflict, request.since_utime_us ? "/since_utime_us" : "/robot_id",
              "robot " + request.robot_id + " has no mission" +
                  (request.since_utime_us ? " from then on" : "") + " that has ended: nothing to diagnose");
}

void DiagnosisService::work(const std::stop_token& stop) {
  setpriority(PRIO_PROCESS, static_cast<id_t>(gettid()), low_priority);
  for (;;) {
    std::shared_ptr<Job> job;
    {
      std::unique_lock lock(mutex_);
      wake_.wait(lock, stop, [this] { return !waiting_.empty(); });
      if (stop.stop_requested()) return;  // the next start marks waiting jobs as interrupted
      job = waiting_.front();
      job->started_utime_us = parts_.now_utime_us();
      running_ = job;
      waiting_.pop_front();
    }
    const auto began = std::chrono::steady_clock::now();
    if (!survive("diagnosis", [&] { run(*job); })) {
      survive("diagnosis", [&] { finish(*job, DiagnosisState::failed, "an internal fault", {}); });
      const std::lock_guard lock(mutex_);
      running_.reset();
    }
    const double seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - began).count();
    const std::lock_guard lock(mutex_);
    counts_.seconds += seconds;
  }
}

void DiagnosisService::run(Job& job) {
  DiagnosisRecord& record = job.record;
  record.state = DiagnosisState::running;
  record.started_utime_us = job.started_utime_us;
  if (const auto stored = parts_.writer.execute(history::UpdateDiagnosis{record, {}}); !stored)
    parts_.on_error(stored.error());
  const Result<void> judged = judge(job);
  if (judged) return finish(job, DiagnosisState::done, {}, std::move(report_));
  if (job.cancelled && stopping())
    return finish(job, DiagnosisState::interrupted, "the service stopped before it was done", {});
  if (job.cancelled) return finish(job, DiagnosisState::cancelled, "cancelled", {});
  finish(job, DiagnosisState::failed, judged.error().message, {});
}

Result<void> DiagnosisService::judge(Job& job) {
  DiagnosisRecord& record = job.record;
  const DiagnosisRequest& request = job.request;
  const auto model = parts_.models.find(record.robot_id);
  if (model == nullptr) return fail(Fault::not_found, "robot_id", "the robot has no model any more");
  record.model_version = model->version;
  RecordingsWanted wanted;
  wanted.robot_id = record.robot_id;
  wanted.only = request.missions;
  wanted.since_utime_us = request.since_utime_us;
  // A robot that changed counts as two robots: only the missions since the change are diagnosed.
  if (request.missions.empty() && !request.since_utime_us) {
    TRY_ASSIGN(wanted.since_utime_us, parts_.drift.last_change(record.robot_id, model->version));
  }
  wanted.max_missions = std::min(request.max_missions, options_.max_missions);
  wanted.max_samples = options_.max_samples;
  wanted.battery_capacity_ah = model->robot.battery.capacity_ah;
  TRY_ASSIGN(StoredRecordings history, read_recordings(parts_.store, wanted));
  if (history.missions.empty())
    return invalid("/missions", "none of the robot's missions can be diagnosed (their telemetry: " +
                                    std::to_string(history.left_out.no_telemetry) + " without, " +
                                    std::to_string(history.left_out.open) + " still open, " +
                                    std::to_string(history.left_out.contradicted) +
                                    " have contradictory telemetry: see the robot's contradictions, " +
                                    std::to_string(history.left_out.annulled) + " annulled)");
  std::vector<telemetry::Recording> recordings;
  for (std::size_t k = 0; k < history.missions.size(); ++k) {
    StoredRecording& mission = history.missions[k];
    if (is_held_back(k, history.missions.size(), request.hold_back)) {
      record.held_back.push_back(mission.key);
    } else {
      record.fitted_on.push_back(mission.key);
      recordings.push_back(std::move(mission.recording));
    }
  }
  history.missions.clear();
  TRY_ASSIGN(auto set, telemetry::make_recording_set(record.robot_id, std::move(recordings)));
  const std::string made_at = format_utc(parts_.now_utime_us());
  const auto answer = run_confined(
      {options_.max_memory_bytes, options_.deadline},
      [&](const Report& report) -> Result<std::string> {
        TRY_ASSIGN(const gap::Diagnosis diagnosis, gap::diagnose(set, model->robot, report));
        return told_of(record, diagnosis, set, *model, wanted.since_utime_us, made_at).dump();
      },
      [&job](double fraction) {
        job.fraction = fraction;
        return !job.cancelled.load();
      });
  if (!answer) {
    if (answer.error().fault == Fault::internal || answer.error().fault == Fault::too_large)
      report_fault("diagnosis", answer.error().message);
    return tl::unexpected(answer.error());
  }
  const ordered_json found = ordered_json::parse(*answer);
  record.result_json = found["result"].dump();
  record.summary_json = found["summary"].dump();
  record.model_json = found["model"].get<std::string>();
  report_ = found["report"].get<std::string>();
  if (const auto& error = found["error"]; error != "")
    parts_.on_error({Fault::internal, "model", error.get<std::string>()});
  return {};
}

void DiagnosisService::end_record(DiagnosisRecord& record, DiagnosisState state, std::string error) const {
  record.state = state;
  record.error = std::move(error);
  record.finished_utime_us =
      state == DiagnosisState::queued ? std::nullopt : std::optional(parts_.now_utime_us());
}

void DiagnosisService::finish(Job& job, DiagnosisState state, std::string error, std::string report) {
  const DiagnosisRecord& record = job.record;
  end_record(job.record, state, std::move(error));
  // The result is in the store before the job leaves the queue, so that one of them always has it.
  history::UpdateDiagnosis update{record, std::move(report)};
  if (const auto stored = parts_.writer.execute(update); !stored) {
    parts_.on_error(stored.error());
    // Minutes of work wait until the store takes data again.
    if (stored.error().fault == Fault::unavailable)
      if (const auto waits = parts_.writer.offer(std::move(update)); !waits) parts_.on_error(waits.error());
  }
  settle(job);
}

void DiagnosisService::settle(Job& job) {
  if (on_ended_) on_ended_(job.record);
  const std::lock_guard lock(mutex_);
  if (running_.get() == &job) running_.reset();
  (job.record.state == DiagnosisState::done        ? counts_.done
   : job.record.state == DiagnosisState::cancelled ? counts_.cancelled
                                                   : counts_.failed)++;
}

}  // namespace joulecast::server

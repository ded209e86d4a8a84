#include "server/diagnosis/gap_watch.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <map>
#include <nlohmann/json.hpp>
#include <utility>

#include "base/fault_boundary.h"
#include "base/median.h"
#include "gap/traits.h"

namespace joulecast::server {
namespace {

using Json = nlohmann::json;

// The watch's memory of a robot, kept over restarts.
constexpr const char* topic = "gap_watch";

struct Memory {
  std::int64_t announced_utime_us = 0;  // the newest mark that was announced
  bool stood_out = false;
};

Result<Memory> read_memory(const history::Store& store, const std::string& robot_id) {
  Memory memory;
  const auto learned = store.learned(robot_id, topic);
  if (!learned) return tl::unexpected(learned.error());
  if (!*learned) return memory;
  const Json body = Json::parse((*learned)->body_json, nullptr, false);
  if (!body.is_object()) return memory;
  memory.announced_utime_us = body.value("announced_utime_us", std::int64_t{0});
  memory.stood_out = body.value("stood_out", false);
  return memory;
}

// The cause that the parameters of an effect change with: wear, floor, battery, load, sensors; "model" where
// the table has none.
std::string_view cause_of(std::string_view effect_id) {
  const auto row = std::ranges::find(gap::traits_table, effect_id, &gap::Traits::id);
  return row == gap::traits_table.end() ? "model" : row->cause;
}

Json mark_json(const drift::Mark& mark) {
  return {{"mission", mark.mission_key},
          {"utime_us", mark.utime_us},
          {"model_version", mark.model_version},
          {"ratio_before", mark.before},
          {"ratio_after", mark.after},
          {"change_ci", {mark.interval[0], mark.interval[1]}},
          {"missions", mark.missions}};
}

}  // namespace

GapWatch::GapWatch(const history::Store& store, history::Writer& writer, const ingest::ModelRegistry& models,
                   const DriftView& drift, DiagnosisService& diagnoses,
                   std::function<std::int64_t()> now_utime_us, const WatchOptions& options,
                   std::function<void(const Error&)> on_error)
    : store_(store),
      writer_(writer),
      models_(models),
      drift_(drift),
      diagnoses_(diagnoses),
      now_utime_us_(std::move(now_utime_us)),
      options_(options),
      on_error_(std::move(on_error)) {
  counts_.ratio_min = counts_.ratio_median = counts_.ratio_max = std::nan("");
}

GapWatch::~GapWatch() {
  stop();
}

void GapWatch::start() {
  if (!(options_.period_s > 0)) return;
  thread_ = std::thread([this] {
    const auto period = std::chrono::duration<double>(options_.period_s);
    std::unique_lock lock(mutex_);
    while (!wake_.wait_for(lock, period, [this] { return stopping_; })) {
      lock.unlock();
      survive("gap watch", [this] { look(); });
      lock.lock();
    }
  });
}

void GapWatch::stop() {
  {
    const std::lock_guard lock(mutex_);
    stopping_ = true;
  }
  wake_.notify_all();
  if (thread_.joinable()) thread_.join();
}

void GapWatch::record(const std::string& robot_id, const std::string& kind, std::string detail_json) {
  const auto posted =
      writer_.offer(history::AppendEvent{{0, now_utime_us_(), robot_id, kind, std::move(detail_json)}});
  if (!posted) on_error_(posted.error());
}

Result<void> GapWatch::remember(const std::string& robot_id, std::int64_t announced_utime_us,
                                bool stood_out) {
  const Json body = {{"announced_utime_us", announced_utime_us}, {"stood_out", stood_out}};
  return writer_.execute(history::PutLearned{{robot_id, topic, now_utime_us_(), body.dump()}})
      .map([](const auto&) {});
}

bool GapWatch::watches(const std::string& robot_id) const {
  return options_.robots.empty() || options_.robots.contains(robot_id);
}

bool GapWatch::is_own(const std::string& robot_id) const {
  return !options_.is_own || options_.is_own(robot_id);
}

void GapWatch::look() {
  const std::lock_guard looking(looking_);
  const auto report_fault = [this](const Result<void>& done) {
    if (!done) on_error_(done.error());
  };
  WatchCounts counts;
  std::vector<double> now;
  for (const auto& model : models_.all()) {
    if (!watches(model->robot.robot_id)) continue;
    if (is_own(model->robot.robot_id)) report_fault(look_at(*model, counts));
    const auto recent = drift_.recent(*model);
    if (!recent) {
      on_error_(recent.error());
      continue;
    }
    double measured = 0, modelled = 0;
    for (const drift::MissionRatio& m : *recent) measured += m.measured_j, modelled += m.modelled_j;
    if (modelled > 0) now.push_back(measured / modelled);
  }
  report_fault(compare_kinds(counts));
  if (now.empty()) {
    counts.ratio_min = counts.ratio_median = counts.ratio_max = std::nan("");
  } else {
    counts.ratio_min = std::ranges::min(now);
    counts.ratio_max = std::ranges::max(now);
    counts.ratio_median = upper_median(std::move(now));
  }
  const std::lock_guard lock(mutex_);
  counts.rounds = counts_.rounds + 1;
  counts.drifts += counts_.drifts;
  counts_ = counts;
}

Result<void> GapWatch::compare_kinds(WatchCounts& counts) {
  const auto kinds = drift_.kinds();
  if (!kinds) return tl::unexpected(kinds.error());
  for (const auto& kind : *kinds) {
    for (const drift::SiblingRatio& s : kind) {
      if (!watches(s.robot_id)) continue;
      counts.standing_out += s.stands_out;
      counts.ratios[s.robot_id] = s.ratio;
      if (!is_own(s.robot_id)) continue;
      const Result<Memory> memory = read_memory(store_, s.robot_id);
      if (!memory) return tl::unexpected(memory.error());
      if (memory->stood_out == s.stands_out) continue;
      record(s.robot_id, "gap_sibling",
             Json{{"stands_out", s.stands_out},
                  {"ratio", s.ratio},
                  {"deviation", s.deviation},
                  {"missions", s.missions},
                  {"compared_with", kind.size() - 1}}
                 .dump());
      if (auto kept = remember(s.robot_id, memory->announced_utime_us, s.stands_out); !kept) return kept;
    }
  }
  return {};
}

Result<void> GapWatch::look_at(const ingest::ModelInForce& model, WatchCounts& counts) {
  const std::string& robot_id = model.robot.robot_id;
  const auto marks = drift_.marks(robot_id);
  if (!marks) return tl::unexpected(marks.error());
  if (marks->empty() || marks->back().model_version != model.version) return {};
  const drift::Mark& mark = marks->back();
  ++counts.drifting;
  const Result<Memory> memory = read_memory(store_, robot_id);
  if (!memory) return tl::unexpected(memory.error());
  if (mark.utime_us <= memory->announced_utime_us) return {};
  ++counts.drifts;
  Json detail = mark_json(mark);
  if (options_.diagnose && !diagnoses_.waits_or_runs(robot_id)) {
    DiagnosisRequest request;
    request.robot_id = robot_id;
    request.since_utime_us = mark.utime_us;
    request.cause = history::DiagnosisCause::watch;
    if (const auto id = diagnoses_.submit(request)) {
      detail["diagnosis_id"] = *id;
    } else {
      on_error_(id.error());
    }
  }
  record(robot_id, "gap_drift", detail.dump());
  return remember(robot_id, mark.utime_us, memory->stood_out);
}

void GapWatch::on_diagnosis(const history::DiagnosisRecord& diagnosis) {
  if (diagnosis.cause != history::DiagnosisCause::watch || diagnosis.state != history::DiagnosisState::done)
    return;
  const Json result = Json::parse(diagnosis.result_json, nullptr, false);
  if (!result.is_object()) return;
  Json detail = {{"diagnosis_id", diagnosis.id}, {"verdict", result["verdict"]}, {"gap", result["gap"]}};
  std::map<std::string, double> by_cause;
  detail["effects"] = Json::array();
  for (const Json& effect : result["effects"]) {
    const std::string id = effect["id"];
    detail["effects"].push_back(id);
    by_cause[std::string(cause_of(id))] += effect["share"].is_number() ? effect["share"].get<double>() : 0;
  }
  const auto most = std::ranges::max_element(by_cause, {}, [](const auto& entry) { return entry.second; });
  detail["blames"] = most == by_cause.end() ? Json(nullptr) : Json(most->first);
  record(diagnosis.robot_id, "gap_diagnosed", detail.dump());
}

WatchCounts GapWatch::counts() const {
  const std::lock_guard lock(mutex_);
  return counts_;
}

}  // namespace joulecast::server

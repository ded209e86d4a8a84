#include "server/diagnosis/gap_watch.h"

#include <algorithm>
#include <chrono>
#include <nlohmann/json.hpp>

#include "base/fault_boundary.h"
#include "base/median.h"
#include "base/try.h"
#include "gap/traits.h"
#include "robot/robot_fields.h"

namespace joulecast::server {
namespace {

using Json = nlohmann::json;

// The watch's memory of a robot, kept over restarts.
constexpr const char* topic = "gap_watch";

struct Memory {
  std::int64_t announced_utime_us = 0;  // the newest mark that was announced
  bool stood_out = false;
};
NLOHMANN_DEFINE_TYPE_NON_INTRUSIVE_WITH_DEFAULT(Memory, announced_utime_us, stood_out)

Result<Memory> read_memory(const history::Store& store, const std::string& robot_id) {
  TRY_ASSIGN(const auto learned, store.learned(robot_id, topic));
  const Json body = learned ? Json::parse(learned->body_json, nullptr, false) : Json();
  return body.is_object() ? body.get<Memory>() : Memory{};
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
          {"quantity", mark.quantity_name()},
          {"ratio_before", mark.before},
          {"ratio_after", mark.after},
          {"change_ci", {mark.interval[0], mark.interval[1]}},
          {"missions", mark.missions}};
}

}  // namespace

void GapWatch::start() {
  if (options_.period_s > 0) thread_ = std::jthread([this](const std::stop_token& stop) { run(stop); });
}

void GapWatch::run(const std::stop_token& stop) {
  const auto period = std::chrono::duration_cast<std::chrono::steady_clock::duration>(
      std::chrono::duration<double>(options_.period_s));
  auto next = std::chrono::steady_clock::now();
  for (;;) {
    std::set<std::string> ended;
    {
      std::unique_lock lock(mutex_);
      wake_.wait_until(lock, stop, next, [this] { return !ended_.empty(); });
      if (stop.stop_requested()) return;
      ended.swap(ended_);
    }
    survive("gap watch", [&] {
      if (std::chrono::steady_clock::now() >= next) {
        next += period;
        return look();
      }
      if (const Result<void> stored = parts_.writer.flush(); !stored) return parts_.on_error(stored.error());
      std::vector<std::shared_ptr<const ingest::ModelInForce>> models;
      for (const std::string& robot_id : ended)
        if (auto model = parts_.models.find(robot_id)) models.push_back(std::move(model));
      look_at(models);
    });
  }
}

void GapWatch::mission_ended(const std::string& robot_id) {
  {
    const std::lock_guard lock(mutex_);
    ended_.insert(robot_id);
  }
  wake_.notify_all();
}

void GapWatch::record(const std::string& robot_id, const std::string& kind, std::string detail_json) {
  const auto posted = parts_.writer.offer(
      history::AppendEvent{{0, parts_.now_utime_us(), robot_id, kind, std::move(detail_json)}});
  if (!posted) parts_.on_error(posted.error());
}

Result<void> GapWatch::remember(const std::string& robot_id, std::int64_t announced_utime_us,
                                bool stood_out) {
  const Json body = Memory{announced_utime_us, stood_out};
  return parts_.writer.execute(history::PutLearned{{robot_id, topic, parts_.now_utime_us(), body.dump()}})
      .map([](const auto&) {});
}

bool GapWatch::watches(const std::string& robot_id) const {
  return options_.robots.empty() || options_.robots.contains(robot_id);
}

void GapWatch::look() {
  const auto models = parts_.models.all();
  {
    const std::lock_guard lock(mutex_);
    std::erase_if(findings_, [&](const auto& each) { return parts_.models.find(each.first) == nullptr; });
    ++rounds_;
  }
  look_at(models);
}

Result<WatchFinding> GapWatch::find(const ingest::ModelInForce& model) const {
  const std::string& robot_id = model.robot.robot_id;
  TRY_ASSIGN(auto newest, parts_.drift.recent(model));
  WatchFinding found{robot::kind_of(model.robot), {robot_id, std::move(newest)}, {}, {}};
  if (!watches(robot_id)) return found;
  TRY_ASSIGN(const auto marks, parts_.drift.marks(robot_id));
  if (!marks.empty()) found.change = marks.back();
  return found;
}

void GapWatch::look_at(const std::vector<std::shared_ptr<const ingest::ModelInForce>>& models) {
  const std::lock_guard looking(looking_);
  const auto report_fault = [this](const Result<void>& done) {
    if (!done) parts_.on_error(done.error());
  };
  auto findings = this->findings();
  std::set<std::string> kinds;
  for (const auto& model : models) {
    const std::string& robot_id = model->robot.robot_id;
    Result<WatchFinding> found = find(*model);
    if (!found) {
      parts_.on_error(found.error());
      continue;
    }
    kinds.insert(found->kind);
    forecasts_.set_change(robot_id, found->change);
    if (found->change && found->change->model_version == model->version && is_own(robot_id))
      report_fault(announce_drift(robot_id, *found->change));
    findings[robot_id] = std::move(*found);
  }
  for (const std::string& kind : kinds) {
    std::vector<drift::RobotRatios> robots;
    for (auto& [robot_id, found] : findings) {
      if (found.kind != kind) continue;
      found.among_kind.reset();
      robots.push_back(found.newest);
    }
    const std::vector<drift::SiblingRatio> compared = parts_.drift.compare(robots);
    for (const drift::SiblingRatio& s : compared) {
      if (!watches(s.robot_id)) continue;
      if (is_own(s.robot_id)) report_fault(announce_sibling(s, compared.size() - 1));
      findings[s.robot_id].among_kind = s;
    }
  }
  const std::lock_guard lock(mutex_);
  findings_ = std::move(findings);
}

Result<void> GapWatch::announce_sibling(const drift::SiblingRatio& s, std::size_t compared_with) {
  TRY_ASSIGN(const Memory memory, read_memory(parts_.store, s.robot_id));
  if (memory.stood_out == s.stands_out) return {};
  record(s.robot_id, "gap_sibling",
         Json{{"stands_out", s.stands_out},
              {"ratio", s.ratio},
              {"deviation", s.deviation},
              {"missions", s.missions},
              {"compared_with", compared_with}}
             .dump());
  return remember(s.robot_id, memory.announced_utime_us, s.stands_out);
}

Result<void> GapWatch::announce_drift(const std::string& robot_id, const drift::Mark& mark) {
  TRY_ASSIGN(const Memory memory, read_memory(parts_.store, robot_id));
  if (mark.utime_us <= memory.announced_utime_us) return {};
  {
    const std::lock_guard lock(mutex_);
    ++drifts_;
  }
  Json detail = mark_json(mark);
  if (options_.diagnose && !diagnoses_.waits_or_runs(robot_id)) {
    DiagnosisRequest request;
    request.robot_id = robot_id;
    request.since_utime_us = mark.utime_us;
    request.cause = history::DiagnosisCause::watch;
    if (const auto id = diagnoses_.submit(request)) {
      detail["diagnosis_id"] = *id;
    } else {
      parts_.on_error(id.error());
    }
  }
  record(robot_id, "gap_drift", detail.dump());
  return remember(robot_id, mark.utime_us, memory.stood_out);
}

void GapWatch::on_diagnosis(const history::DiagnosisRecord& diagnosis) {
  if (diagnosis.cause != history::DiagnosisCause::watch || diagnosis.state != history::DiagnosisState::done)
    return;
  Json result = Json::parse(diagnosis.result_json, nullptr, false);
  if (!result.is_object()) return;
  Json detail = {{"diagnosis_id", diagnosis.id},
                 {"verdict", result["verdict"]},
                 {"verdict_title", result["verdict_title"]},
                 {"gap", result["gap"]}};
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

std::optional<drift::Mark> GapWatch::last_change(const std::string& robot_id) const {
  const std::lock_guard lock(mutex_);
  const auto found = findings_.find(robot_id);
  return found == findings_.end() ? std::nullopt : found->second.change;
}

std::map<std::string, WatchFinding> GapWatch::findings() const {
  const std::lock_guard lock(mutex_);
  return findings_;
}

WatchCounts GapWatch::counts() const {
  const std::lock_guard lock(mutex_);
  WatchCounts counts;
  counts.rounds = rounds_;
  counts.drifts = drifts_;
  counts.ratio_min = counts.ratio_median = counts.ratio_max = std::nan("");
  std::vector<double> now;
  for (const auto& [robot_id, found] : findings_) {
    if (!watches(robot_id)) continue;
    const auto model = parts_.models.find(robot_id);
    counts.drifting += found.change && model != nullptr && found.change->model_version == model->version;
    if (found.among_kind) {
      counts.standing_out += found.among_kind->stands_out;
      counts.ratios[robot_id] = found.among_kind->ratio;
    }
    double measured_j = 0, modelled_j = 0;
    for (const drift::MissionRatio& m : found.newest.missions)
      measured_j += m.measured_j, modelled_j += m.modelled_j;
    if (modelled_j > 0) now.push_back(measured_j / modelled_j);
  }
  if (now.empty()) return counts;
  counts.ratio_min = std::ranges::min(now);
  counts.ratio_max = std::ranges::max(now);
  counts.ratio_median = upper_median(std::move(now));
  return counts;
}

}  // namespace joulecast::server

#include "server/diagnosis/gap_watch.h"

#include <algorithm>
#include <chrono>
#include <cmath>
#include <map>
#include <nlohmann/json.hpp>
#include <utility>

#include "base/median.h"
#include "robot/robot_file.h"

namespace joulecast::server {
namespace {

using nlohmann::json;

// What the watch remembers of a robot over restarts.
constexpr const char* topic = "gap_watch";
constexpr std::size_t newest = 10;  // missions that tell how a robot does now

struct Memory {
  std::int64_t announced_utime_us = 0;  // the newest mark that was told of
  bool stood_out = false;
};

Memory read_memory(const history::Store& store, const std::string& robot_id) {
  Memory memory;
  const auto learned = store.learned(robot_id, topic);
  if (!learned || !*learned) return memory;
  const json body = json::parse((*learned)->body_json, nullptr, false);
  if (!body.is_object()) return memory;
  memory.announced_utime_us = body.value("announced_utime_us", std::int64_t{0});
  memory.stood_out = body.value("stood_out", false);
  return memory;
}

std::string kind_of(const robot::RobotModel& robot) {
  json text = robot::robot_to_json(robot);
  for (const char* own : {"robot_id", "idle_power_w", "effects", "note"}) text.erase(own);
  return text.dump();
}

json mark_json(const gap::DriftMark& mark) {
  return {{"mission", mark.mission_key},
          {"utime_us", mark.utime_us},
          {"model_version", mark.model_version},
          {"ratio_before", mark.before},
          {"ratio_after", mark.after},
          {"change_ci", {mark.interval[0], mark.interval[1]}},
          {"missions", mark.missions}};
}

}  // namespace

Result<std::vector<gap::MissionRatio>> mission_ratios(const history::Store& store,
                                                      const std::string& robot_id, std::size_t limit) {
  history::MissionFilter filter;
  filter.robot_id = robot_id;
  history::PageRequest page;
  page.limit = history::max_page_size;
  std::vector<gap::MissionRatio> ratios;
  do {
    Result<history::MissionPage> found = store.missions(filter, page);
    if (!found) return tl::unexpected(std::move(found.error()));
    for (const history::Mission& m : found->missions) {
      const energy::Accounts& a = m.accounts;
      // Only whole missions compare: what was not measured is in neither energy.
      if (m.state == history::MissionState::open || !(a.measured_s > 0.9 * a.duration_s) ||
          !(a.measured_j > 0))
        continue;
      const double modelled_j = a.measured_j - a.ledger[energy::Term::unexplained];
      if (!(modelled_j > 0)) continue;
      ratios.push_back({m.key, m.start_utime_us, m.model_version.value_or(0), a.measured_j, modelled_j});
      if (ratios.size() == limit) break;
    }
    page.cursor = std::move(found->next_cursor);
  } while (!page.cursor.empty() && ratios.size() < limit);
  std::ranges::reverse(ratios);
  return ratios;
}

std::optional<std::int64_t> last_drift(const history::Store& store, const std::string& robot_id,
                                       std::int64_t version, std::size_t limit) {
  const auto missions = mission_ratios(store, robot_id, limit);
  if (!missions) return std::nullopt;
  const std::vector<gap::DriftMark> marks = gap::drift_marks(*missions);
  if (marks.empty() || marks.back().model_version != version) return std::nullopt;
  return marks.back().utime_us;
}

std::vector<std::string> robots_of_kind(const ModelRegistry& models, const std::string& robot_id) {
  const auto model = models.find(robot_id);
  if (model == nullptr) return {};
  const std::string kind = kind_of(model->robot);
  std::vector<std::string> ids;
  for (const auto& other : models.all())
    if (kind_of(other->robot) == kind) ids.push_back(other->robot.robot_id);
  return ids;
}

GapWatch::GapWatch(const history::Store& store, history::Writer& writer, const ModelRegistry& models,
                   DiagnosisService& diagnoses, std::function<std::int64_t()> now_utime_us,
                   const WatchOptions& options, std::function<void(const Error&)> on_error)
    : store_(store),
      writer_(writer),
      models_(models),
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
      look();
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

void GapWatch::look() {
  const std::lock_guard looking(looking_);
  WatchCounts counts;
  std::map<std::string, std::vector<gap::RobotRatios>> kinds;
  std::vector<double> now;
  for (const auto& model : models_.all()) {
    const std::string& id = model->robot.robot_id;
    if (!options_.robots.empty() && !options_.robots.contains(id)) continue;
    auto missions = mission_ratios(store_, id, options_.max_missions);
    if (!missions) {
      on_error_(missions.error());
      continue;
    }
    look_at(id, *missions, counts);
    // Siblings are compared as they are now, under the model in force.
    std::erase_if(*missions, [&](const auto& m) { return m.model_version != model->version; });
    if (missions->size() > newest) missions->erase(missions->begin(), missions->end() - newest);
    double measured = 0, modelled = 0;
    for (const gap::MissionRatio& m : *missions) measured += m.measured_j, modelled += m.modelled_j;
    if (modelled > 0) now.push_back(measured / modelled);
    kinds[kind_of(model->robot)].push_back({id, std::move(*missions)});
  }
  for (const auto& [kind, robots] : kinds) {
    for (const gap::SiblingRatio& s : gap::compare_siblings(robots, options_.drift)) {
      counts.standing_out += s.stands_out;
      Memory memory = read_memory(store_, s.robot_id);
      if (memory.stood_out == s.stands_out) continue;
      record(s.robot_id, "gap_sibling",
             json{{"stands_out", s.stands_out},
                  {"ratio", s.ratio},
                  {"deviation", s.deviation},
                  {"missions", s.missions},
                  {"compared_with", robots.size() - 1}}
                 .dump());
      const json body = {{"announced_utime_us", memory.announced_utime_us}, {"stood_out", s.stands_out}};
      (void)writer_.execute(history::PutLearned{{s.robot_id, topic, now_utime_us_(), body.dump()}});
    }
  }
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

void GapWatch::look_at(const std::string& robot_id, const std::vector<gap::MissionRatio>& missions,
                       WatchCounts& counts) {
  const std::vector<gap::DriftMark> marks = gap::drift_marks(missions, options_.drift);
  if (marks.empty()) return;
  const gap::DriftMark& mark = marks.back();
  const auto model = models_.find(robot_id);
  if (model == nullptr || mark.model_version != model->version) return;
  ++counts.drifting;
  const Memory memory = read_memory(store_, robot_id);
  if (mark.utime_us <= memory.announced_utime_us) return;
  ++counts.drifts;
  json detail = mark_json(mark);
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
  const json body = {{"announced_utime_us", mark.utime_us}, {"stood_out", memory.stood_out}};
  if (const auto kept = writer_.execute(history::PutLearned{{robot_id, topic, now_utime_us_(), body.dump()}});
      !kept)
    on_error_(kept.error());
}

void GapWatch::on_diagnosis(const history::DiagnosisRecord& diagnosis) {
  if (diagnosis.cause != history::DiagnosisCause::watch || diagnosis.state != history::DiagnosisState::done)
    return;
  const json result = json::parse(diagnosis.result_json, nullptr, false);
  if (!result.is_object()) return;
  json detail = {{"diagnosis_id", diagnosis.id}, {"verdict", result["verdict"]}, {"gap", result["gap"]}};
  std::map<std::string, double> blame;
  detail["effects"] = json::array();
  for (const json& effect : result["effects"]) {
    const std::string id = effect["id"];
    detail["effects"].push_back(id);
    blame[std::string(gap::cause_of(id))] += effect["share"].is_number() ? effect["share"].get<double>() : 0;
  }
  const auto most = std::ranges::max_element(blame, {}, [](const auto& entry) { return entry.second; });
  detail["blames"] = most == blame.end() ? json(nullptr) : json(most->first);
  record(diagnosis.robot_id, "gap_diagnosed", detail.dump());
}

WatchCounts GapWatch::counts() const {
  const std::lock_guard lock(mutex_);
  return counts_;
}

}  // namespace joulecast::server

#include "ingest/stored_robot.h"

#include <algorithm>
#include <chrono>
#include <nlohmann/json.hpp>
#include <utility>

#include "base/fault_boundary.h"
#include "base/json_number.h"
#include "base/try.h"
#include "ingest/refinement_watch.h"

namespace joulecast::ingest {
namespace {

using history::Mission;
using history::MissionState;

constexpr std::int64_t recalled_missions = 16;  // that a robot may repeat the events of
constexpr std::chrono::seconds read_again{1};   // after the store could not be read

std::vector<Contradiction> contradictions_of(const Mission& ended) {
  const nlohmann::json findings = nlohmann::json::parse(ended.findings_json, nullptr, false);
  std::vector<Contradiction> found;
  if (!findings.is_object() || !findings.contains("contradictions")) return found;
  for (const nlohmann::json& each : findings["contradictions"]) {
    if (!each.is_object()) continue;
    const auto kind = std::ranges::find(contradiction_kind_names, each.value("kind", ""));
    if (kind == contradiction_kind_names.end()) continue;
    found.push_back({static_cast<ContradictionKind>(kind - contradiction_kind_names.begin()),
                     each.value("id", ""), each.value("channel", ""), number_at(each, "value"),
                     each.value("says", ""), true, ended.end_utime_us});
  }
  return found;
}

Result<std::vector<Mission>> ended_missions(const history::Store& store, const std::string& robot_id,
                                            std::int64_t limit) {
  history::MissionFilter ended;
  ended.robot_ids = {robot_id};
  ended.states = {MissionState::finished, MissionState::aborted, MissionState::superseded,
                  MissionState::unfinished, MissionState::interrupted};
  TRY_ASSIGN(auto page, store.missions(ended, {.limit = limit, .cursor = {}}));
  return std::move(page.missions);
}

Result<std::string> memory(const history::Store& store, const std::string& robot_id, std::string_view topic) {
  TRY_ASSIGN(const auto learned, store.learned(robot_id, topic));
  return learned ? learned->body_json : std::string();
}

Result<std::vector<signals::Sample>> tail_of(const history::Store& store, const Mission& open) {
  std::vector<signals::Sample> tail;
  for (std::int64_t reach_us = tail_us;; reach_us *= 8) {
    TRY_ASSIGN(auto page, store.telemetry(open.key, {open.end_utime_us - reach_us, history::whole_future},
                                          {.limit = history::max_telemetry_samples, .cursor = {}}));
    tail = std::move(page.items);
    if (tail.size() >= tail_samples || open.end_utime_us - reach_us <= open.start_utime_us) break;
  }
  // Where the robot's clock was set back, those before have times that come again.
  const auto set_back = std::ranges::is_sorted_until(tail.rbegin(), tail.rend(), std::greater_equal{},
                                                     &signals::Sample::utime_us);
  tail.erase(tail.begin(), set_back.base());
  return tail;
}

Result<void> read_open_mission(const history::Store& store, StoredRobot& robot) {
  history::MissionFilter filter;
  filter.robot_ids = {robot.robot_id};
  filter.states = {MissionState::open};
  TRY_ASSIGN(auto page, store.missions(filter, {.limit = 1, .cursor = {}}));
  if (page.missions.empty()) return {};
  robot.open = std::move(page.missions.front());
  TRY_ASSIGN(robot.tail, tail_of(store, *robot.open));
  if (!robot.open->implicit && robot.open->model_version)
    robot.model = stored_model(store, robot.robot_id, *robot.open->model_version);
  if (!robot.model && robot.model.error().fault == Fault::unavailable)
    return tl::unexpected(robot.model.error());
  return {};
}

}  // namespace

Result<StoredRobot> read_stored_robot(const history::Store& store, const std::string& robot_id) {
  StoredRobot robot{robot_id};
  TRY_ASSIGN(robot.state, store.resume_state(robot_id));
  TRY_ASSIGN(robot.charge_memory, memory(store, robot_id, charge_topic));
  TRY_ASSIGN(robot.refinement_memory, memory(store, robot_id, RefinementWatch::topic));
  TRY_ASSIGN(robot.requests, stored_mission_requests(store, robot_id));
  TRY_ASSIGN(robot.ended, ended_missions(store, robot_id, recalled_missions));
  if (!robot.ended.empty()) robot.contradictions = contradictions_of(robot.ended.front());
  TRY(read_open_mission(store, robot));
  return robot;
}

std::vector<Contradiction> stored_contradictions(const history::Store& store, const std::string& robot_id) {
  const auto last = ended_missions(store, robot_id, 1);
  return last && !last->empty() ? contradictions_of(last->front()) : std::vector<Contradiction>{};
}

void RobotReader::want(const std::string& robot_id, history::Epoch epoch) {
  {
    const std::lock_guard lock(mutex_);
    wanted_.push_back({robot_id, epoch});
  }
  wake_.notify_one();
}

std::vector<StoredRobot> RobotReader::take() {
  std::unique_lock lock(mutex_);
  while (!thread_.joinable() && !wanted_.empty() && read_next(lock)) {
  }
  return std::exchange(done_, {});
}

bool RobotReader::read_next(std::unique_lock<std::mutex>& lock) {
  Wanted next = std::move(wanted_.front());
  wanted_.pop_front();
  lock.unlock();
  Result<StoredRobot> robot = fail(Fault::unavailable, "database", "not read");
  survive("reading the store", [&] { robot = read_(next.robot_id); });
  lock.lock();
  if (!robot) {
    wanted_.push_back(std::move(next));
    return false;
  }
  robot->epoch = next.epoch;
  done_.push_back(std::move(*robot));
  return true;
}

void RobotReader::run(const std::stop_token& stop) {
  std::unique_lock lock(mutex_);
  while (wake_.wait(lock, stop, [this] { return !wanted_.empty(); }) && !stop.stop_requested())
    if (!read_next(lock)) wake_.wait_for(lock, stop, read_again, [] { return false; });
}

}  // namespace joulecast::ingest

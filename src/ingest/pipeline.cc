#include "ingest/pipeline.h"

#include <algorithm>
#include <limits>
#include <utility>

namespace joulecast::ingest {
namespace {

constexpr std::size_t waiting_units = 131'072;  // some 30 MB of messages
constexpr std::int64_t stranger_silence_us = 60'000'000, forget_period_us = 1'000'000,
                       tell_period_us = 600'000'000;
// Of robots that others keep: how long a message may be on its way to the store behind the samples after it.
constexpr std::int64_t held_us = 30'000'000;
constexpr std::int64_t recalled_missions = 16;  // that a robot may repeat the events of

}  // namespace

Pipeline::Pipeline(const SessionSettings& settings, std::size_t max_unknown_robots,
                   const ModelRegistry& models, SessionOutputs outputs, Keeping* keeping,
                   std::size_t held_room_bytes)
    : settings_(settings),
      max_unknown_robots_(max_unknown_robots),
      models_(models),
      outputs_(std::move(outputs)),
      waiting_room_(waiting_units),
      keeping_(keeping),
      held_(held_us, held_room_bytes) {}

Pipeline::Robot& Pipeline::add(const std::string& robot_id, const SessionOutputs& outputs) {
  unknown_robots_.erase(robot_id);
  auto made = std::unique_ptr<Robot>(
      new Robot{{robot_id, settings_, outputs}, {settings_.sender_takeover_us, waiting_room_}});
  const auto model = models_.find(robot_id);
  made->had_model = model != nullptr;
  made->session.set_model(model);
  return *robots_.emplace(robot_id, std::move(made)).first->second;
}

Pipeline::Robot* Pipeline::find(const std::string& robot_id) {
  if (const auto found = robots_.find(robot_id); found != robots_.end()) return found->second.get();
  if (keeping_ != nullptr) return nullptr;
  if (models_.find(robot_id) == nullptr) return nullptr;
  Robot& robot = add(robot_id, outputs_);
  follow_requests(robot);
  return &robot;
}

void Pipeline::merge(const std::vector<MissionRequest>& requests,
                     const std::vector<history::Mission>& latest_missions, Robot& robot,
                     std::deque<InboundMessage>& messages) {
  for (const MissionRequest& request : requests) {
    if (!latest_missions.empty() && has_effect(request.event, latest_missions.front())) {
      robot.session.recall(request);
      continue;
    }
    const auto later = std::ranges::find_if(messages, [&](const InboundMessage& message) {
      return message.host_utime_us > request.request_utime_us;
    });
    messages.insert(later, {robot.session.robot_id(), request, request.request_utime_us});
  }
}

void Pipeline::follow_requests(Robot& robot) {
  history::MissionFilter of_robot;
  of_robot.robot_ids = {robot.session.robot_id()};
  const auto latest = outputs_.store.missions(of_robot, {.limit = 1, .cursor = {}}, {});
  const auto requests = stored_mission_requests(outputs_.store, robot.session.robot_id());
  robot.requests_unread = !latest || !requests;
  if (robot.requests_unread) return;
  std::deque<InboundMessage> messages;
  merge(*requests, latest->missions, robot, messages);
  for (const InboundMessage& message : messages) deliver(robot, message);
}

Result<void> Pipeline::recover() {
  if (keeping_ != nullptr) return {};
  Result<std::vector<history::Mission>> open = outputs_.store.recover();
  if (!open) return tl::unexpected(std::move(open.error()));
  for (const history::Mission& mission : *open) {
    const auto found = robots_.find(mission.robot_id);
    RobotSession& session =
        found != robots_.end() ? found->second->session : add(mission.robot_id, outputs_).session;
    const auto tail = tail_of(mission);
    if (!tail) return tl::unexpected(tail.error());
    session.resume(mission, *tail);
    session.publish();
  }
  for (const auto& model : models_.all()) {
    const std::string& id = model->robot.robot_id;
    const auto requests = stored_mission_requests(outputs_.store, id);
    if (!requests) return tl::unexpected(requests.error());
    if (requests->empty()) continue;
    const auto resumed = robots_.find(id);
    resumed != robots_.end() ? follow_requests(*resumed->second) : void(find(id));
  }
  return {};
}

Result<std::vector<signals::Sample>> Pipeline::tail_of(const history::Mission& open) const {
  std::vector<signals::Sample> tail;
  for (std::int64_t reach_us = RobotSession::tail_us;; reach_us *= 8) {
    auto page = outputs_.store.telemetry(open.key, {open.end_utime_us - reach_us, history::whole_future},
                                         {.limit = history::max_telemetry_samples, .cursor = {}});
    if (!page) return tl::unexpected(std::move(page.error()));
    tail = std::move(page->samples);
    if (tail.size() >= RobotSession::tail_samples || open.end_utime_us - reach_us <= open.start_utime_us)
      break;
  }
  // Where the robot's clock was set back, those before have times that come again.
  const auto set_back = std::ranges::is_sorted_until(tail.rbegin(), tail.rend(), std::greater_equal{},
                                                     &signals::Sample::utime_us);
  tail.erase(tail.begin(), set_back.base());
  return tail;
}

void Pipeline::refresh_models() {
  const std::uint64_t now = models_.epoch();
  if (now == epoch_) return;
  epoch_ = now;
  for (auto each = robots_.begin(); each != robots_.end();) {
    const auto model = models_.find(each->first);
    if (model != nullptr || !each->second->had_model) {
      each->second->had_model = model != nullptr;
      (each++)->second->session.set_model(model);
      continue;
    }
    // A robot that was removed: its mission ends, and its messages are counted only.
    for (const InboundMessage& held : each->second->gate.release(std::numeric_limits<std::int64_t>::max()))
      deliver(each->second->session, held);
    each->second->session.on_tick(std::numeric_limits<std::int64_t>::max());
    outputs_.fleet.remove(each->first);
    if (keeping_ == nullptr) {
      each = robots_.erase(each);
    } else {  // the lease goes on, and so does the robot when it is given a model again
      each->second->had_model = false;
      (each++)->second->session.set_model(nullptr);
    }
  }
  for (auto unknown = unknown_robots_.begin(); unknown != unknown_robots_.end();) {
    const std::string id = (unknown++)->first;
    if (models_.find(id) == nullptr) continue;
    keeping_ == nullptr ? void(find(id)) : void(unknown_robots_.erase(id));
  }
}

SessionOutputs Pipeline::outputs_under(history::Epoch epoch) const {
  SessionOutputs outputs = outputs_;
  outputs.post = [post = outputs_.post, epoch](history::Command command) {
    put_under(command, epoch);
    post(std::move(command));
  };
  return outputs;
}

void Pipeline::hold(const InboundMessage& message, bool has_model) {
  if (std::holds_alternative<RefusedMessage>(message.content)) return;
  if (has_model)
    keeping_->hear(message.robot_id, message.host_utime_us);
  else if (!unknown_robots_.contains(message.robot_id))
    return;
  keeping_->held_dropped += held_.add(message);
}

void Pipeline::follow_orders() {
  if (keeping_ == nullptr) return;
  if (keeping_->has_orders()) {
    Keeping::Orders orders = keeping_->take_orders();
    for (const Keeping::Withdrawal& each : orders.withdrawals) let_go(each);
    for (Keeping::Grant& each : orders.grants) granted_.push_back(std::move(each));
  }
  if (granted_.empty()) return;
  refresh_models();
  std::erase_if(granted_, [this](const Keeping::Grant& grant) { return take_up(grant); });
}

bool Pipeline::take_up(const Keeping::Grant& grant) {
  const std::string& id = grant.robot_id;
  if (models_.find(id) == nullptr) return false;  // another daemon was given it a moment ago
  RobotSession::Handover handover;
  handover.position = grant.position;
  history::MissionFilter of_robot;
  of_robot.robot_ids = {id};
  const auto latest = outputs_.store.missions(of_robot, {.limit = recalled_missions, .cursor = {}}, {});
  const auto requests = stored_mission_requests(outputs_.store, id);
  if (!latest || !requests) return false;
  handover.missions = latest->missions;
  for (const history::Mission& mission : handover.missions) {
    if (mission.state != history::MissionState::open) continue;
    auto tail = tail_of(mission);
    if (!tail) return false;
    handover.tail = std::move(*tail);
    ++keeping_->resumed_missions;
    break;
  }
  Robot& robot = add(id, outputs_under(grant.epoch));
  robot.epoch = grant.epoch;
  robot.session.take_over(handover);
  std::deque<InboundMessage> held = held_.take(id);
  keeping_->replayed_messages += held.size();
  merge(*requests, handover.missions, robot, held);
  robot.session.begin_repeats();
  for (const InboundMessage& message : held) deliver(robot, message);
  robot.session.end_repeats();
  robot.session.publish();
  return true;
}

void Pipeline::suspend(Robot& robot) const {
  for (const InboundMessage& each : robot.gate.release(std::numeric_limits<std::int64_t>::max()))
    deliver(robot.session, each);
  keeping_ != nullptr ? robot.session.hand_over() : robot.session.suspend();
}

void Pipeline::let_go(const Keeping::Withdrawal& withdrawal) {
  std::erase_if(granted_, [&](const Keeping::Grant& grant) { return grant.robot_id == withdrawal.robot_id; });
  const auto found = robots_.find(withdrawal.robot_id);
  if (withdrawal.orderly) {
    if (found != robots_.end()) suspend(*found->second);
    outputs_.post(history::ReleaseLease{withdrawal.robot_id, withdrawal.epoch});
  }
  if (found != robots_.end()) robots_.erase(found);
}

bool Pipeline::discard_unknown_robot(std::int64_t host_utime_us) {
  if (host_utime_us - forgot_utime_us_ < forget_period_us && host_utime_us >= forgot_utime_us_) return false;
  forgot_utime_us_ = host_utime_us;
  const auto silent = std::ranges::min_element(
      unknown_robots_, {}, [](const auto& each) { return each.second.snapshot.received_utime_us; });
  if (silent == unknown_robots_.end() ||
      host_utime_us - silent->second.snapshot.received_utime_us < stranger_silence_us)
    return false;
  outputs_.fleet.remove(silent->first);
  unknown_robots_.erase(silent);
  return true;
}

void Pipeline::count_unknown_robot(const InboundMessage& message) {
  IngestFault fault = IngestFault::unknown_robot;
  if (const auto* refused = std::get_if<RefusedMessage>(&message.content)) {
    fault = refused->fault;  // counted already
  } else {
    outputs_.counters.add(fault);
  }
  auto found = unknown_robots_.find(message.robot_id);
  if (found == unknown_robots_.end()) {
    if (unknown_robots_.size() >= max_unknown_robots_ && !discard_unknown_robot(message.host_utime_us))
      return outputs_.counters.add(IngestFault::too_many_robots);
    found = unknown_robots_.try_emplace(message.robot_id).first;
    found->second.snapshot.robot_id = message.robot_id;
    if (told_utime_us_ == 0 || message.host_utime_us - told_utime_us_ >= tell_period_us) {
      told_utime_us_ = message.host_utime_us;
      outputs_.warn(message.robot_id, "has no model: its messages are counted and not accounted for");
    }
  }
  RobotSnapshot& snapshot = found->second.snapshot;
  snapshot.received_utime_us = message.host_utime_us;
  ++snapshot.faults[name_of(fault)];
  found->second.changed = true;
}

void Pipeline::deliver(RobotSession& session, const InboundMessage& message) {
  if (const auto* sample = std::get_if<signals::Sample>(&message.content)) {
    session.on_sample(*sample, message.host_utime_us, message.one_of);
  } else if (const auto* covariates = std::get_if<signals::CovariateMessage>(&message.content)) {
    session.on_covariates(*covariates, message.host_utime_us);
  } else {
    session.on_event(std::get<signals::MissionEvent>(message.content), message.host_utime_us);
  }
}

void Pipeline::handle(const InboundMessage& message) {
  refresh_models();
  Robot* robot = find(message.robot_id);
  // Another daemon that keeps the robot finds a request in the store.
  if (robot == nullptr && std::holds_alternative<MissionRequest>(message.content)) return;
  if (robot == nullptr) {
    const bool has_model = models_.find(message.robot_id) != nullptr;
    if (!has_model) count_unknown_robot(message);
    if (keeping_ != nullptr) hold(message, has_model);
    return;
  }
  const bool heard = !std::holds_alternative<MissionRequest>(message.content);
  if (keeping_ != nullptr && heard) keeping_->hear(message.robot_id, message.host_utime_us);
  deliver(*robot, message);
}

void Pipeline::deliver(Robot& robot, const InboundMessage& message) {
  if (const auto* refused = std::get_if<RefusedMessage>(&message.content))
    return robot.session.note_fault(refused->fault, 1, refused->why, message.host_utime_us);
  if (const auto* request = std::get_if<MissionRequest>(&message.content))
    return robot.session.on_request(*request);
  const SenderGate::Verdict verdict = robot.gate.take(message);
  for (const InboundMessage& each : verdict.released) deliver(robot.session, each);
  if (verdict.refused > 0)
    robot.session.on_fault(IngestFault::second_sender, verdict.refused, robot.gate.describe());
  if (verdict.pass) deliver(robot.session, message);
}

void Pipeline::tick(std::int64_t host_utime_us) {
  refresh_models();
  for (auto& [id, robot] : robots_) {
    for (const InboundMessage& each : robot->gate.release(host_utime_us)) deliver(robot->session, each);
    if (robot->requests_unread) follow_requests(*robot);
    robot->session.on_tick(host_utime_us);
  }
  if (keeping_ == nullptr) return;
  auto leases = keeping_->take_leases();
  const bool now_read = leases.has_value();
  if (leases) leases_ = std::move(*leases);
  held_.forget_stored(host_utime_us, leases_, now_read);
  keeping_->held_messages = held_.size();
  keeping_->held_bytes = held_.bytes();
}

void Pipeline::on_host_clock_step(std::int64_t host_utime_us, std::int64_t step_us) {
  for (auto& [id, robot] : robots_) robot->session.on_host_clock_step(host_utime_us, step_us);
}

void Pipeline::publish() {
  for (auto& [id, robot] : robots_) robot->session.publish();
  for (auto& [id, unknown] : unknown_robots_) {
    if (std::exchange(unknown.changed, false))
      outputs_.fleet.publish(std::make_shared<const RobotSnapshot>(unknown.snapshot));
  }
}

void Pipeline::finish() {
  tick(std::numeric_limits<std::int64_t>::max());
  publish();
}

void Pipeline::suspend() {
  follow_orders();  // only this daemon may have the messages of a robot that was granted a moment ago
  for (auto& [id, robot] : robots_) suspend(*robot);
  if (keeping_ == nullptr) return;
  for (const auto& [id, epoch] : keeping_->kept()) outputs_.post(history::ReleaseLease{id, epoch});
}

}  // namespace joulecast::ingest

#include "ingest/pipeline.h"

#include <algorithm>
#include <limits>
#include <nlohmann/json.hpp>
#include <set>
#include <utility>

#include "base/json_number.h"
#include "base/try.h"

namespace joulecast::ingest {
namespace {

constexpr std::int64_t second_us = 1'000'000;
// A sender that has missed this number of its usual intervals is gone, unless two came at once recently.
constexpr double missed_intervals = 50;
constexpr std::int64_t least_patience_us = second_us / 10;
constexpr std::int64_t contest_memory_us = 60 * second_us;
constexpr std::size_t waiting_units_a_robot = 16'384;
// Greatest loss between two samples of one stream.
constexpr std::int64_t stream_step = 1000, stream_span_us = 60 * second_us;
// Going back to a stream that was left happens to a robot that boots while its last datagrams are late; going
// back and forth does not.
constexpr int most_returns = 3;
constexpr std::int64_t returns_memory_us = 10 * second_us;
// Publishers that open a socket for each message go on with their numbers.
constexpr std::int64_t port_step = 16;

std::size_t message_units(const InboundMessage& message) {
  if (const auto* covariates = std::get_if<signals::CovariateMessage>(&message.content))
    return 1 + covariates->covariates.size() / 2;
  return std::holds_alternative<signals::MissionEvent>(message.content) ? 4 : 1;
}

constexpr std::size_t waiting_units = 131'072;  // some 30 MB of messages
constexpr std::int64_t stranger_silence_us = 60'000'000, forget_period_us = 1'000'000,
                       tell_period_us = 600'000'000;
// Of robots that others keep: how long a message may be on its way to the store behind the samples after it.
constexpr std::int64_t held_us = 30'000'000;

}  // namespace

bool SenderGate::Stream::continued_by(const signals::Sample& sample) const {
  return sequence >= 0 && sample.sequence > sequence && sample.sequence - sequence <= stream_step &&
         std::abs(sample.utime_us - utime_us) <= stream_span_us;
}

bool SenderGate::is_of_first(const InboundMessage& message, const signals::Sample* sample) const {
  if (!any_ || message.sender == first_) return true;
  if (sample != nullptr) {
    // The same publisher from another port.
    return message.sender.address == first_.address && main_.continued_by(*sample) &&
           sample->sequence - main_.sequence <= port_step && (waiting_.empty() || message.sender != other_);
  }
  // Missions may be announced by another sender, such as a fleet manager.
  const bool waits = !waiting_.empty() && message.sender == other_;
  const bool live = message.host_utime_us - heard_us_ < takeover_us_;
  return !waits && !(announcer_ == first_ && live);
}

SenderGate::Verdict SenderGate::take(const InboundMessage& message) {
  const auto* sample = std::get_if<signals::Sample>(&message.content);
  heard_us_ = std::min(heard_us_, message.host_utime_us);  // the host's clock was set back
  std::vector<InboundMessage> released = release(message.host_utime_us);
  Verdict verdict = is_of_first(message, sample) ? take_first(message, sample) : take_other(message);
  verdict.released = std::move(released);
  return verdict;
}

SenderGate::Verdict SenderGate::take_first(const InboundMessage& message, const signals::Sample* sample) {
  Verdict verdict{.pass = true};
  if (sample == nullptr) {
    if (std::holds_alternative<signals::MissionEvent>(message.content)) announcer_ = message.sender;
    return verdict;
  }
  if (is_second_stream(*sample, message.host_utime_us)) return {.refused = 1};
  if (!waiting_.empty()) {
    contested_us_ = message.host_utime_us;
    verdict.refused = drop_waiting();
  }
  if (any_) interval_us_ += 0.1 * (static_cast<double>(message.host_utime_us - heard_us_) - interval_us_);
  any_ = true;
  first_ = message.sender;
  heard_us_ = message.host_utime_us;
  return verdict;
}

SenderGate::Verdict SenderGate::take_other(const InboundMessage& message) {
  const std::size_t needed = message_units(message);
  const bool third = !waiting_.empty() && message.sender != other_;
  if (third || needed > room_ || waiting_units_ + needed > waiting_units_a_robot) return {.refused = 1};
  other_ = message.sender;
  waiting_.push_back(message);
  waiting_units_ += needed;
  room_ -= needed;
  return {};
}

bool SenderGate::is_second_stream(const signals::Sample& sample, std::int64_t host_utime_us) {
  if (host_utime_us - returned_us_ > returns_memory_us) returns_ = 0;
  const Stream now{sample.sequence, sample.utime_us};
  if (main_.continued_by(sample) || main_.sequence < 0) {
    main_ = now;
    return false;
  }
  if (side_.continued_by(sample)) {
    returned_us_ = host_utime_us;
    if (++returns_ > most_returns && host_utime_us - heard_us_ < takeover_us_) {
      side_ = now;
      return true;
    }
    side_ = std::exchange(main_, now);
    return false;
  }
  const bool repeated =
      sample.sequence <= main_.sequence && main_.sequence - sample.sequence <= stream_step &&
      std::abs(sample.utime_us - main_.utime_us) <= stream_span_us && sample.utime_us <= main_.utime_us;
  if (!repeated) side_ = std::exchange(main_, now);
  return false;
}

std::int64_t SenderGate::patience_us(std::int64_t host_utime_us) const {
  if (contested_us_ > 0 && host_utime_us - contested_us_ < contest_memory_us) return takeover_us_;
  const double usual = missed_intervals * interval_us_;
  return std::min(takeover_us_,
                  std::max(least_patience_us, static_cast<std::int64_t>(std::min(usual, 1e12))));
}

std::vector<InboundMessage> SenderGate::release(std::int64_t host_utime_us) {
  if (waiting_.empty()) return {};
  std::int64_t& since_us = waiting_.front().host_utime_us;
  if (host_utime_us != std::numeric_limits<std::int64_t>::max()) {
    since_us = std::min(since_us, host_utime_us);
    if (host_utime_us - since_us < patience_us(host_utime_us)) return {};
  }
  std::vector<InboundMessage> released(std::make_move_iterator(waiting_.begin()),
                                       std::make_move_iterator(waiting_.end()));
  heard_us_ = released.back().host_utime_us;
  first_ = other_;
  main_ = side_ = {};
  for (const InboundMessage& message : released) {
    if (const auto* sample = std::get_if<signals::Sample>(&message.content))
      main_ = {sample->sequence, sample->utime_us};
    if (std::holds_alternative<signals::MissionEvent>(message.content)) announcer_ = first_;
  }
  drop_waiting();
  return released;
}

std::size_t SenderGate::drop_waiting() {
  const std::size_t count = waiting_.size();
  waiting_.clear();
  room_ += std::exchange(waiting_units_, 0);
  return count;
}

std::string SenderGate::describe() const {
  if (returns_ > most_returns)
    return telemetry::to_string(first_) +
           " sends two streams of sequence numbers under this robot's id; the one at sequence " +
           std::to_string(side_.sequence) + " is not accounted for";
  return telemetry::to_string(other_) + " publishes under this robot's id in addition to " +
         telemetry::to_string(first_) + ", which alone is accounted for";
}

Pipeline::Pipeline(const SessionSettings& settings, std::size_t max_unknown_robots,
                   const ModelRegistry& models, SessionOutputs outputs, Keeping* keeping,
                   std::size_t held_room_bytes)
    : settings_(settings),
      max_unknown_robots_(max_unknown_robots),
      models_(models),
      outputs_(std::move(outputs)),
      waiting_room_(waiting_units),
      keeping_(keeping),
      held_(held_us, held_room_bytes),
      reader_([this](const std::string& robot_id) { return read(robot_id); }) {}

Pipeline::Robot& Pipeline::add(const StoredRobot& stored, const SessionOutputs& outputs) {
  const std::string& robot_id = stored.robot_id;
  unknown_robots_.erase(robot_id);
  auto made = std::unique_ptr<Robot>(
      new Robot{{stored, settings_, outputs}, {settings_.sender_takeover_us, waiting_room_}});
  const auto model = models_.find(robot_id);
  made->had_model = model != nullptr;
  made->session.set_model(model);
  return *robots_.emplace(robot_id, std::move(made)).first->second;
}

Pipeline::Robot* Pipeline::find(const std::string& robot_id) {
  auto found = robots_.find(robot_id);
  if (found == robots_.end() && keeping_ == nullptr && models_.find(robot_id) != nullptr) {
    want(robot_id);
    take_read();
    found = robots_.find(robot_id);
  }
  return found != robots_.end() ? found->second.get() : nullptr;
}

void Pipeline::merge(const StoredRobot& stored, Robot& robot, std::deque<InboundMessage>& messages) {
  const history::Mission* latest = stored.ended.empty() ? nullptr : &stored.ended.front();
  if (stored.open && (latest == nullptr || stored.open->start_utime_us >= latest->start_utime_us))
    latest = &*stored.open;
  for (const MissionRequest& request : stored.requests) {
    if (latest != nullptr && has_effect(request.event, *latest)) {
      robot.session.recall(request);
      continue;
    }
    const auto later = std::ranges::find_if(messages, [&](const InboundMessage& message) {
      return message.host_utime_us > request.request_utime_us;
    });
    messages.insert(later, {stored.robot_id, request, request.request_utime_us});
  }
}

Result<StoredRobot> Pipeline::read(const std::string& robot_id) const {
  if (outputs_.prepare) TRY(outputs_.prepare(robot_id));
  return read_stored_robot(outputs_.store, robot_id);
}

Result<void> Pipeline::recover() {
  if (keeping_ != nullptr) return {};
  std::set<std::string> robot_ids;
  TRY_ASSIGN(const auto open, outputs_.store.recover());
  for (const history::Mission& mission : open) robot_ids.insert(mission.robot_id);
  TRY_ASSIGN(const auto requested, outputs_.store.all_learned(mission_request_topic));
  for (const history::Learned& of_robot : requested)
    if (models_.find(of_robot.robot_id) != nullptr) robot_ids.insert(of_robot.robot_id);
  for (const std::string& robot_id : robot_ids) {
    TRY_ASSIGN(const auto stored, read(robot_id));
    take_up(stored, nullptr);
  }
  return {};
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
    if (models_.find(unknown->first) == nullptr) {
      ++unknown;
      continue;
    }
    if (keeping_ == nullptr) want(unknown->first);
    unknown = unknown_robots_.erase(unknown);
  }
  take_read();
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
  const bool requested = std::holds_alternative<MissionRequest>(message.content);
  const bool waits = reading_.contains(message.robot_id);
  // Another daemon that keeps the robot finds a request in the store.
  const bool is_held =
      requested || keeping_ == nullptr ? waits : has_model || unknown_robots_.contains(message.robot_id);
  if (!is_held) return;
  const std::size_t dropped = held_.add(message);
  if (keeping_ == nullptr) return outputs_.counters.add(IngestFault::queue_full, dropped);
  if (has_model && !requested) keeping_->hear(message.robot_id, message.host_utime_us);
  keeping_->held_dropped += dropped;
}

void Pipeline::follow_orders() {
  if (keeping_ != nullptr && keeping_->has_orders()) {
    Keeping::Orders orders = keeping_->take_orders();
    for (const Keeping::Withdrawal& each : orders.withdrawals) let_go(each);
    for (Keeping::Grant& each : orders.grants) granted_.push_back(std::move(each));
  }
  if (!granted_.empty()) refresh_models();
  // Of one without a model, another daemon was given it a moment ago.
  for (const Keeping::Grant& grant : granted_)
    if (models_.find(grant.robot_id) != nullptr) want(grant.robot_id, grant.epoch);
  take_read();
}

void Pipeline::want(const std::string& robot_id, history::Epoch epoch) {
  const auto [asked, first] = reading_.try_emplace(robot_id, epoch);
  if (!first && std::exchange(asked->second, epoch) == epoch) return;
  reader_.want(robot_id, epoch);
}

void Pipeline::take_read() {
  for (const StoredRobot& stored : reader_.take()) {
    const std::string& id = stored.robot_id;
    const auto asked = reading_.find(id);
    if (asked == reading_.end() || asked->second != stored.epoch) continue;  // withdrawn meanwhile
    reading_.erase(asked);
    if (keeping_ == nullptr) {
      models_.find(id) != nullptr ? take_up(stored, nullptr) : void(held_.take(id));
      continue;
    }
    const auto grant = std::ranges::find_if(granted_, [&](const Keeping::Grant& each) {
      return each.robot_id == id && each.epoch == stored.epoch;
    });
    if (models_.find(id) == nullptr || grant == granted_.end()) continue;
    take_up(stored, &*grant);
    granted_.erase(grant);
  }
}

void Pipeline::take_up(const StoredRobot& stored, const Keeping::Grant* grant) {
  const std::string& id = stored.robot_id;
  Robot& robot = add(stored, grant != nullptr ? outputs_under(grant->epoch) : outputs_);
  std::deque<InboundMessage> held = held_.take(id);
  if (grant != nullptr) {
    robot.session.take_over(stored, grant->position);
    keeping_->resumed_missions += stored.open ? 1 : 0;
    robot.session.begin_repeats();
  } else {
    robot.session.resume(stored);
  }
  merge(stored, robot, held);
  for (const InboundMessage& message : held) deliver(robot, message);
  robot.session.end_repeats();
  robot.session.publish();
}

void Pipeline::suspend(Robot& robot) const {
  for (const InboundMessage& each : robot.gate.release(std::numeric_limits<std::int64_t>::max()))
    deliver(robot.session, each);
  keeping_ != nullptr ? robot.session.hand_over() : robot.session.suspend();
}

void Pipeline::let_go(const Keeping::Withdrawal& withdrawal) {
  std::erase_if(granted_, [&](const Keeping::Grant& grant) { return grant.robot_id == withdrawal.robot_id; });
  reading_.erase(withdrawal.robot_id);
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
      outputs_.warn(message.robot_id,
                    "has no robot file: until one is added, its telemetry is counted, not recorded");
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
  if (robot == nullptr) {
    const bool has_model = models_.find(message.robot_id) != nullptr;
    if (!has_model && !std::holds_alternative<MissionRequest>(message.content)) count_unknown_robot(message);
    return hold(message, has_model);
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
  reader_.stop();
  follow_orders();  // only this daemon may have the messages of a robot that waits for the reader
  if (keeping_ == nullptr)
    for (const auto& [id, epoch] : std::exchange(reading_, {})) take_up({id}, nullptr);
  for (auto& [id, robot] : robots_) suspend(*robot);
  if (keeping_ == nullptr) return;
  for (const auto& [id, epoch] : keeping_->kept()) outputs_.post(history::ReleaseLease{id, epoch});
}

void report_reused_name(const history::Mission& begun, history::MissionKey earlier,
                        std::int64_t host_utime_us, IngestCounters& counters,
                        const std::function<void(history::Command)>& post) {
  counters.add(IngestFault::reused_mission_id);
  const nlohmann::json detail{{"mission", begun.key},
                              {"mission_id", begun.mission_id},
                              {"start_utime_us", begun.start_utime_us},
                              {"earlier_mission", earlier}};
  post(history::AppendEvent{{0, host_utime_us, begun.robot_id, "mission_id_reused", json_text(detail)}});
}

}  // namespace joulecast::ingest

#include "server/ingest/pipeline.h"

#include <limits>
#include <utility>

namespace joulecast::server {

std::optional<InboundMessage> decode_message(std::string_view channel, std::span<const std::uint8_t> data,
                                             std::int64_t host_utime_us, IngestCounters& counters) {
  const std::optional<telemetry::ChannelName> name = telemetry::parse_channel(channel);
  if (!name || name->subject == telemetry::Subject::energy_state) return std::nullopt;
  counters.messages.fetch_add(1, std::memory_order_relaxed);
  const auto refuse = [&](IngestFault fault) {
    counters.add(fault);
    return std::nullopt;
  };
  if (name->subject == telemetry::Subject::telemetry) {
    Result<telemetry::DecodedTelemetry> decoded = telemetry::decode_telemetry(data);
    if (!decoded) return refuse(IngestFault::undecodable);
    if (decoded->robot_id != name->robot_id) return refuse(IngestFault::wrong_channel);
    return InboundMessage{std::move(decoded->robot_id), decoded->sample, host_utime_us};
  }
  if (name->subject == telemetry::Subject::covariates) {
    Result<telemetry::DecodedCovariates> decoded = telemetry::decode_covariates(data);
    if (!decoded) return refuse(IngestFault::undecodable);
    if (decoded->robot_id != name->robot_id) return refuse(IngestFault::wrong_channel);
    return InboundMessage{std::move(decoded->robot_id), std::move(decoded->message), host_utime_us};
  }
  Result<telemetry::DecodedMissionEvent> decoded = telemetry::decode_mission_event(data);
  if (!decoded) return refuse(IngestFault::undecodable);
  if (decoded->robot_id != name->robot_id) return refuse(IngestFault::wrong_channel);
  return InboundMessage{std::move(decoded->robot_id), std::move(decoded->event), host_utime_us};
}

Pipeline::Pipeline(const SessionSettings& settings, std::size_t max_robots, const ModelRegistry& models,
                   SessionOutputs outputs)
    : settings_(settings), max_robots_(max_robots), models_(models), outputs_(std::move(outputs)) {}

RobotSession* Pipeline::session(const std::string& robot_id) {
  if (const auto found = sessions_.find(robot_id); found != sessions_.end()) return found->second.get();
  if (sessions_.size() >= max_robots_) {
    outputs_.counters.add(IngestFault::too_many_robots);
    return nullptr;
  }
  auto made = std::make_unique<RobotSession>(robot_id, settings_, outputs_);
  made->set_model(models_.find(robot_id));
  return sessions_.emplace(robot_id, std::move(made)).first->second.get();
}

Result<void> Pipeline::recover() {
  Result<std::vector<history::Mission>> open = outputs_.store.recover();
  if (!open) return tl::unexpected(std::move(open.error()));
  for (const history::Mission& mission : *open) {
    RobotSession* robot = session(mission.robot_id);
    if (robot == nullptr) continue;
    robot->resume(mission);
    robot->publish();
  }
  return {};
}

void Pipeline::refresh_models() {
  if (const std::uint64_t now = models_.epoch(); now != epoch_) {
    epoch_ = now;
    for (auto& [id, robot] : sessions_) robot->set_model(models_.find(id));
  }
}

void Pipeline::handle(const InboundMessage& message) {
  refresh_models();
  RobotSession* robot = session(message.robot_id);
  if (robot == nullptr) return;
  if (const auto* sample = std::get_if<signals::Sample>(&message.content)) {
    robot->on_sample(*sample, message.host_utime_us);
  } else if (const auto* covariates = std::get_if<signals::CovariateMessage>(&message.content)) {
    robot->on_covariates(*covariates);
  } else {
    robot->on_event(std::get<signals::MissionEvent>(message.content), message.host_utime_us);
  }
}

void Pipeline::tick(std::int64_t host_utime_us) {
  refresh_models();
  for (auto& [id, robot] : sessions_) robot->on_tick(host_utime_us);
}

void Pipeline::on_host_clock_step(std::int64_t host_utime_us, std::int64_t step_us) {
  for (auto& [id, robot] : sessions_) robot->on_host_clock_step(host_utime_us, step_us);
}

void Pipeline::publish() {
  for (auto& [id, robot] : sessions_) robot->publish();
}

void Pipeline::finish() {
  tick(std::numeric_limits<std::int64_t>::max());
}

void Pipeline::suspend() {
  for (auto& [id, robot] : sessions_) robot->suspend();
}

}  // namespace joulecast::server

#include "history/commands.h"

#include <algorithm>
#include <iterator>
#include <utility>

namespace joulecast::history {
namespace {

std::size_t content_bytes(const AddModel& c) {
  return c.robot_id.size() + c.note.size() + c.model_json.size() + c.evidence_json.size();
}
std::size_t content_bytes(const ActivateModel& c) {
  return c.robot_id.size();
}

std::size_t content_bytes(const Mission& mission) {
  constexpr std::size_t map_node = 64;  // allocated by std::map around an entry
  std::size_t bytes = mission.robot_id.size() + mission.mission_id.size() + mission.note.size() +
                      mission.incomplete_reason.size() + mission.findings_json.size();
  for (const auto& [reason, count] : mission.sample_faults)
    bytes += reason.size() + sizeof(reason) + sizeof(count) + map_node;
  for (const CovariateSummary& covariate : mission.covariates)
    bytes += covariate.name.size() + sizeof(covariate);
  return bytes;
}
std::size_t content_bytes(const StartMission& c) {
  return content_bytes(c.mission);
}

std::size_t content_bytes(const CheckpointMission& c) {
  return content_bytes(c.mission) + c.trace.capacity() * sizeof(TraceBucket) +
         c.samples.capacity() * sizeof(signals::Sample) +
         c.covariates.capacity() * (sizeof(signals::CovariateChange) + signals::max_covariate_name_length) +
         (c.resume_state ? c.resume_state->robot_id.size() : 0);
}
std::size_t content_bytes(const PutResumeState& c) {
  return c.state.robot_id.size();
}
std::size_t content_bytes(const PutLearned& c) {
  return c.learned.robot_id.size() + c.learned.topic.size() + c.learned.body_json.size();
}
std::size_t content_bytes(const AppendEvent& c) {
  return c.event.robot_id.size() + c.event.kind.size() + c.event.detail_json.size();
}
std::size_t content_bytes(const AppendAudit& c) {
  const AuditEntry& e = c.entry;
  return e.actor.size() + e.address.size() + e.request_id.size() + e.action.size() + e.detail_json.size();
}
std::size_t content_bytes(const Prune&) {
  return 0;
}
std::size_t content_bytes(const DiagnosisRecord& d) {
  return d.robot_id.size() + d.request_json.size() + d.summary_json.size() + d.result_json.size() +
         d.model_json.size() + d.error.size() +
         (d.fitted_on.capacity() + d.held_back.capacity()) * sizeof(MissionKey);
}
std::size_t content_bytes(const AddDiagnosis& c) {
  return content_bytes(c.diagnosis);
}
std::size_t content_bytes(const UpdateDiagnosis& c) {
  return content_bytes(c.diagnosis) + c.report_html.size();
}
std::size_t content_bytes(const InterruptDiagnoses&) {
  return 0;
}
std::size_t content_bytes(const AddProposal& c) {
  const Proposal& p = c.proposal;
  return p.robot_id.size() + p.kind.size() + p.note.size() + p.model_json.size() + p.detail_json.size() +
         p.fitted_on.capacity() * sizeof(MissionKey);
}
std::size_t content_bytes(const CloseProposal&) {
  return 0;
}
std::size_t content_bytes(const PruneMissions&) {
  return 0;
}
std::size_t content_bytes(const PruneEvents&) {
  return 0;
}
std::size_t content_bytes(const PruneAudit&) {
  return 0;
}
std::size_t content_bytes(const KeepAnswer& c) {
  const RequestAnswer& a = c.answer;
  return a.actor.size() + a.key.size() + a.fingerprint.size() + a.location.size() + a.body.size();
}
std::size_t content_bytes(const PutFloorPlan& c) {
  return c.plan.image.size() + c.plan.chargers.capacity() * sizeof(c.plan.chargers[0]);
}
std::size_t content_bytes(const RemoveRobot& c) {
  return c.robot_id.size();
}

std::size_t content_bytes(const ReleaseLease& c) {
  return c.robot_id.size();
}
std::size_t content_bytes(const TakeSpool& c) {
  return c.hash.size() + c.after.store.size() + c.after.writer.size();
}
std::size_t content_bytes(const CommitChange& c) {
  return c.change->command ? weight_bytes(*c.change->command) : 0;
}

template <class T>
concept Fenced = requires(T command) {
  command.epoch;
};

const std::string& robot_of(const StartMission& c) {
  return c.mission.robot_id;
}
const std::string& robot_of(const CheckpointMission& c) {
  return c.mission.robot_id;
}
const std::string& robot_of(const PutResumeState& c) {
  return c.state.robot_id;
}
const std::string& robot_of(const PutLearned& c) {
  return c.learned.robot_id;
}
const std::string& robot_of(const AppendEvent& c) {
  return c.event.robot_id;
}
const std::string& robot_of(const AddProposal& c) {
  return c.proposal.robot_id;
}
const std::string& robot_of(const ReleaseLease& c) {
  return c.robot_id;
}

}  // namespace

std::optional<Fence> fence_of(const Command& command) {
  return std::visit(
      []<class T>(const T& c) -> std::optional<Fence> {
        if constexpr (Fenced<T>) {
          if (c.epoch != 0) return Fence{robot_of(c), c.epoch};
        }
        return std::nullopt;
      },
      command);
}

void put_under(Command& command, Epoch epoch) {
  std::visit(
      [epoch]<class T>(T& c) {
        if constexpr (Fenced<T>) c.epoch = epoch;
      },
      command);
}

void Change::add_before(std::function<std::vector<Command>(std::int64_t)> commands) {
  follow = [first = std::move(commands), then = std::move(follow)](std::int64_t outcome) {
    std::vector<Command> all = first(outcome);
    if (then) std::ranges::move(then(outcome), std::back_inserter(all));
    return all;
  };
}

std::size_t weight_bytes(const Command& command) {
  return sizeof(Command) + std::visit([](const auto& c) { return content_bytes(c); }, command);
}

}  // namespace joulecast::history

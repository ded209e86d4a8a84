#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

#include "history/records.h"

// Everything that changes the store. A command is applied whole, in one transaction, or not at all.
namespace joulecast::history {

// Commands on a robot's telemetry carry the epoch of the robot's lease where daemons share a fleet
// (leases.h). The command is dropped if the lease has another epoch by then. 0: no lease is required.
using Epoch = std::int64_t;

// A sample's place in its robot's stream.
struct StreamPosition {
  std::int64_t utime_us = 0;  // robot's clock
  std::int64_t sequence = 0;

  friend bool operator==(const StreamPosition&, const StreamPosition&) = default;
};

// Adds the next version of a robot's model and makes it the active one. The robot is created when new.
// Outcome: the version. A text equal to the active version's adds nothing and answers the active version.
struct AddModel {
  std::string robot_id;
  std::int64_t utime_us = 0;
  ModelOrigin origin = ModelOrigin::file;
  std::string note;
  std::string model_json;
  // When set, the active version that the caller has seen (0: none); another one is a Fault::conflict.
  std::optional<std::int64_t> expected_active;
  std::string evidence_json = {};
};

// Makes an existing version the active one (roll back, roll forward). Outcome: the version.
struct ActivateModel {
  std::string robot_id;
  std::int64_t version = 0;
};

// Begins a mission under a key from Store::new_mission_key, or restarts it: a stored mission of that robot,
// name and start is replaced. The robot is created when new. Outcome: the key of the last mission of that
// robot and name that started before; 0: the name is new, or the mission was not announced.
struct StartMission {
  Mission mission;
  Epoch epoch = 0;
};

// Brings a started mission up to date, ends it (by its state), and appends the data since the last
// checkpoint, all in one transaction. `mission` replaces the stored record but for its identity (key, robot,
// mission_id, start). Buckets replace stored ones of the same start; samples and changes of covariates are
// appended in the order given. Outcome: the key.
struct CheckpointMission {
  Mission mission;
  std::vector<TraceBucket> trace;
  std::vector<signals::Sample> samples;
  std::optional<ResumeState> resume_state;
  std::vector<signals::CovariateChange> covariates = {};
  Epoch epoch = 0;
  std::optional<StreamPosition> position = {};  // of the last of all samples that missions have taken in
};

// Replaces a robot's energy state, for robots outside missions, with its position in the stream. The robot is
// created when new. Outcome: 0.
struct PutResumeState {
  ResumeState state;
  Epoch epoch = 0;
};

// Replaces the robot's training state under the topic. The robot is created when new. Outcome: 0.
struct PutLearned {
  Learned learned;
  Epoch epoch = 0;
  // When set, the stored time that is expected (0: none); another one is a Fault::conflict.
  std::optional<std::int64_t> expected_utime_us = {};
};

// Outcome: the event's id; `event.id` is ignored.
struct AppendEvent {
  Event event;
  Epoch epoch = 0;
};

// Adds an entry to the audit. Outcome: the entry's id; `entry.id` and `entry.hash` are ignored.
struct AppendAudit {
  AuditEntry entry;
};

// How much raw telemetry, covariates among it, to keep; an absent bound does not bind.
struct Retention {
  std::optional<std::int64_t> telemetry_max_age_us;  // since it was stored: a replayed old log is young
  std::optional<std::int64_t> telemetry_max_bytes;   // of encoded chunks, oldest dropped first
};

// Drops raw telemetry and covariates beyond the retention, oldest first, at most `max_chunks` of it.
// Missions, ledgers and traces stay. Outcome: the number of chunks; below max_chunks the retention now holds.
struct Prune {
  Retention retention;
  std::int64_t max_chunks = 1000;
};

// Diagnoses kept of one robot; older ones that have ended go when a new one is added.
inline constexpr std::int64_t kept_diagnoses = 200;

// Outcome: the diagnosis's id; `diagnosis.id` is ignored.
struct AddDiagnosis {
  DiagnosisRecord diagnosis;
};

// Replaces a stored diagnosis but for its identity (id, robot, creation, cause, request). A report that is
// not empty replaces the stored one. Outcome: the id.
struct UpdateDiagnosis {
  DiagnosisRecord diagnosis;
  std::string report_html;
};

// At start: marks the diagnoses that the last daemon left queued or running. Outcome: how many.
struct InterruptDiagnoses {
  std::int64_t utime_us = 0;
};

// Supersedes the robot's open proposals of the same kind. Outcome: its id; `proposal.id` is ignored.
struct AddProposal {
  Proposal proposal;
  Epoch epoch = 0;
};

// Fault::conflict unless the proposal is open. Outcome: its id.
struct CloseProposal {
  std::int64_t id = 0;
  ProposalState state = ProposalState::dismissed;
  std::optional<std::int64_t> adopted_version;
};

// Deletes ended missions, their accounts, traces and recordings among it, that ended longer ago than
// `max_age_us` by the robots' clocks, oldest first, at most `max_missions` of them. Outcome: how many.
struct PruneMissions {
  std::int64_t max_age_us = 0;
  std::int64_t max_missions = 0;
};

// Deletes the oldest events beyond the `keep` newest (at least 1), at most `max_events`. Outcome: how many.
struct PruneEvents {
  std::int64_t keep = 0;
  std::int64_t max_events = 0;
};

// Removes the audit's first entries that are older than `max_age_us`, in whole days (UTC), at most
// `max_entries` of them, and adds an entry that states how many, the last one's number and its hash: see
// history/audit.h. Outcome: how many.
struct PruneAudit {
  std::int64_t max_age_us = 0;
  std::int64_t max_entries = 0;
};

// How long the answer of a request with an idempotency key is kept.
inline constexpr std::int64_t kept_answer_us = std::int64_t{7 * 86400} * 1'000'000;

// Keeps a request's answer in place of one under the same actor and key, and drops those that are more than
// kept_answer_us older than it. Outcome: 0.
struct KeepAnswer {
  RequestAnswer answer;
};

// Replaces the plan of its map and level; without an image deletes it. Outcome: 0. Fault::not_found: none.
struct PutFloorPlan {
  FloorPlan plan;
};

// Takes a robot's model out of force. With `purge` all data of the robot except its events are deleted:
// models, missions, recordings, training state, diagnoses, proposals. Otherwise they are kept, and open
// missions are interrupted. Outcome: the number of missions deleted. Fault::not_found: unknown.
struct RemoveRobot {
  std::string robot_id;
  bool purge = false;
};

// Releases a robot's lease, after all that was commanded under it. Outcome: 0.
struct ReleaseLease {
  std::string robot_id;
  Epoch epoch = 0;
};

// The last batch that a writer committed to a store.
struct BatchMark {
  std::string store;  // its identity
  std::string writer;
  std::int64_t batch = 0;  // of that writer

  friend bool operator==(const BatchMark&, const BatchMark&) = default;
};

// First of the commands of a spool, which are applied only with it: records that the spool is taken in.
// Outcome: how many commands behind it the store has already, since the commit that ran when they were
// spooled succeeded; they are skipped. Fault::conflict: the store is another one, or has moved on since the
// mark; Fault::invalid: the spool was taken in before.
struct TakeSpool {
  std::string hash;  // SHA-256 of the spool
  BatchMark after;
  std::int64_t attempted = 0;  // of the commands behind it, in the commit that ran
};

// Commands that are committed in one transaction or not at all.
struct Change;
struct CommitChange {
  std::shared_ptr<Change> change;
};

using Command =
    std::variant<AddModel, ActivateModel, StartMission, CheckpointMission, PutResumeState, PutLearned,
                 AppendEvent, Prune, AddDiagnosis, UpdateDiagnosis, InterruptDiagnoses, AddProposal,
                 CloseProposal, AppendAudit, PruneMissions, RemoveRobot, ReleaseLease, PruneEvents,
                 KeepAnswer, TakeSpool, CommitChange, PutFloorPlan, PruneAudit>;

// A change within the transaction of a command. Outcome of the change: its command's, or 0 without one.
// Fault::conflict on `key_field` when the key has an answer, or another program on the store is handling a
// request under it; nothing is done then.
struct Change {
  static constexpr std::string_view key_field = "idempotency_key";

  std::optional<RequestAnswer> key = {};  // claimed first; status, location and body are ignored
  std::optional<Command> command = {};
  // Returns the commands that follow from the command's outcome. Called on the writer's thread, perhaps more
  // than once; must neither block nor call the writer, and refers to nothing that ends before the writer.
  std::function<std::vector<Command>(std::int64_t outcome)> follow = {};
  std::vector<Command> followed = {};  // the last of these, for the store

  // Adds commands before those that follow.
  void add_before(std::function<std::vector<Command>(std::int64_t outcome)> commands);
};

// The lease that a command with an epoch requires.
struct Fence {
  std::string_view robot_id;
  Epoch epoch = 0;
};
// Absent: the command carries no epoch.
std::optional<Fence> fence_of(const Command& command);
// Gives the epoch to a command that can carry one.
void put_under(Command& command, Epoch epoch);

// Approximate memory that a queued command holds, in bytes.
std::size_t weight_bytes(const Command& command);

}  // namespace joulecast::history

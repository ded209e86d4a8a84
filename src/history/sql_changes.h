#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <span>
#include <string>
#include <vector>

#include "base/error.h"
#include "history/commands.h"
#include "history/mission_days.h"
#include "history/sql.h"
#include "history/sql_rows.h"
#include "history/store.h"

namespace joulecast::history {

struct DroppedCommands {
  Epoch epoch = 0;  // that they carried
  std::uint64_t count = 0;
  std::uint64_t samples = 0;  // raw ones that were stored nevertheless
};

// The commands as SQL, on the one writing connection.
class SqlChanges {
 public:
  // `writer`: this program's name among those that write at the same time; empty: it is the only one.
  SqlChanges(Database& database, std::function<std::int64_t()> now_utime_us, std::string writer = {});
  ~SqlChanges();

  // As Store::apply. `before_commit` is called in the transaction. Throws SqlError if nothing was applied, or
  // if the COMMIT's outcome is unknown; `outcomes` are then valid provided that it was committed.
  void apply(std::span<const Command> commands, const std::function<void()>& before_commit,
             std::vector<Outcome>& outcomes);

  // The store's record of the last committed batch: see BatchMark.
  static BatchMark mark_of(Database& database);

  // The leases under which the last apply() dropped commands: they have other epochs now.
  const std::map<std::string, DroppedCommands>& dropped() const { return dropped_; }

 private:
  // Rows of checkpoints, to be stored by one statement for each table; null: each is stored immediately.
  struct Bulk;
  // How many samples and changes of covariates a mission has, and how many of them are in its tails.
  struct Tails {
    std::int64_t samples = 0, changes = 0, samples_in_tail = 0, changes_in_tail = 0;
  };
  // Where a mission goes on.
  struct Place : Tails {
    std::string robot_id;
    std::int64_t start_utime_us = 0;
    bool was_ended = false;
  };

  void begin(std::span<const Command> commands);
  void forget_collected();
  // Stores the collected rows.
  void flush();
  void look_up_places(std::span<const Command> commands);
  void read_places(Rows& rows);
  void find_tails(MissionKey key, Place& place);
  std::optional<Place> take_place(MissionKey key);
  void update(const CheckpointMission& command);
  // Locks the leases that the commands require until the transaction ends.
  void lock_leases(std::span<const Command> commands);
  // Whether the command's lease holds, or it needs none; counts it if not.
  bool stands(const Command& command);
  // Of a spool's command that does not stand.
  Outcome keep_samples(const Command& command);
  // False when a command was refused.
  bool apply_unguarded(std::span<const Command> commands, std::vector<Outcome>& outcomes);
  Outcome apply_guarded(const Command& command);
  Outcome run_one(const Command& command);

  Outcome run(const AddModel& command);
  Outcome run(const ActivateModel& command);
  Outcome run(const StartMission& command);
  Outcome run(const CheckpointMission& command);
  Outcome run(const PutResumeState& command);
  Outcome run(const PutLearned& command);
  Outcome run(const AppendEvent& command);
  Outcome run(const AppendAudit& command);
  Outcome run(const Prune& command);
  Outcome run(const AddDiagnosis& command);
  Outcome run(const UpdateDiagnosis& command);
  Outcome run(const InterruptDiagnoses& command);
  Outcome run(const AddProposal& command);
  Outcome run(const CloseProposal& command);
  Outcome run(const PruneMissions& command);
  Outcome run(const PruneEvents& command);
  Outcome run(const PruneAudit& command);
  Outcome run(const KeepAnswer& command);
  Outcome run(const PutFloorPlan& command);
  Outcome run(const RemoveRobot& command);
  Outcome run(const ReleaseLease& command);
  Outcome run(const TakeSpool& command);
  Outcome run(const CommitChange& command);
  // Claims the key of a request that is answered within this transaction.
  Result<void> claim(const RequestAnswer& key);

  // Where others write too: until the transaction ends, since each entry's hash covers the one before.
  void lock_audit();
  // Whether this program is the one that runs the diagnosis.
  bool has_job(std::int64_t diagnosis_id);
  void make_robot(const std::string& robot_id);
  void lock_robot(const std::string& robot_id);  // until the transaction ends; where others write too
  void put(const ResumeState& state);
  void put_position(const std::string& robot_id, const StreamPosition& position);
  void put(MissionKey key, const std::vector<TraceBucket>& trace);
  // Drops what belongs to the missions of a DELETE that returns robot, start and key; returns their number.
  std::int64_t drop_missions(Rows& deleted);

  Database& database_;
  std::function<std::int64_t()> now_utime_us_;
  const std::string writer_;
  std::map<std::string, Epoch, std::less<>> epochs_;  // of the leases locked
  std::map<std::string, DroppedCommands> dropped_;    // by robot
  ChangedDays days_;
  std::unique_ptr<Bulk> bulk_;
  std::map<MissionKey, Place> places_;  // read ahead
  bool committed_ = false;              // the last transaction
  bool in_spool_ = false;               // the commands are a spool's
  std::int64_t stored_already_ = 0;     // of a spool's next commands
  // Of open missions, as they were left: the rows there need not be read where the counts are still these.
  std::map<MissionKey, Tails> tails_;
  std::set<std::string> known_robots_;  // that are stored
};

}  // namespace joulecast::history

#pragma once

#include <cstdint>
#include <functional>
#include <span>
#include <vector>

#include "base/error.h"
#include "history/commands.h"
#include "history/sql.h"
#include "history/store.h"

namespace joulecast::history {

// The commands as SQL, on the one writing connection.
class SqlChanges {
 public:
  SqlChanges(Database& database, std::function<std::int64_t()> now_utime_us);

  // As Store::apply. `before_commit` is called in the transaction. Throws SqlError when nothing was applied,
  // or when the COMMIT's outcome is not known; then `outcomes` are what they are if it was done.
  void apply(std::span<const Command> commands, const std::function<void()>& before_commit,
             std::vector<Outcome>& outcomes);

 private:
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
  Outcome run(const RemoveRobot& command);

  void make_robot(const std::string& robot_id);
  void put(const ResumeState& state);

  Database& database_;
  std::function<std::int64_t()> now_utime_us_;
};

}  // namespace joulecast::history

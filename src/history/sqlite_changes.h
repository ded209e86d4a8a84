#pragma once

#include <cstdint>
#include <functional>
#include <span>
#include <vector>

#include "base/error.h"
#include "history/commands.h"
#include "history/sqlite.h"
#include "history/store.h"

namespace joulecast::history {

// The commands as SQL, on the one writing connection.
class SqliteChanges {
 public:
  SqliteChanges(Database& database, std::function<std::int64_t()> now_utime_us);

  // As Store::apply. Throws SqliteError when nothing was applied.
  std::vector<Outcome> apply(std::span<const Command> commands);

 private:
  Outcome apply_whole(const Command& command);

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

  // Gives free pages back to the disk, some at a time, where they are many.
  void give_back();
  void make_robot(const std::string& robot_id);
  void put(const ResumeState& state);

  Database& database_;
  std::function<std::int64_t()> now_utime_us_;
};

}  // namespace joulecast::history

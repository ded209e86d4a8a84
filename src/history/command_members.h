#pragma once

#include <concepts>
#include <cstdint>
#include <string_view>

#include "history/columns.h"
#include "history/commands.h"
#include "signals/archive_members.h"

namespace joulecast::history {

template <class T, class... Each>
concept OneOf = (std::same_as<T, Each> || ...);

// The members of commands and all that they hold, for the archives of base/byte_archive.h and for
// weight_bytes(). A command with another number of members does not compile.
struct CommandMembers : signals::ArchiveMembers {
  using ArchiveMembers::of;
  template <class Archive, class Record>
  requires requires(Record& record) {
    visit_columns(record, [](const auto&...) {});
  }
  static void of(Archive& a, Record& record) {
    visit_columns(record, [&a](std::string_view, auto& value, auto...) { a(value); });
  }
  template <class Archive,
            OneOf<AppendAudit, AddDiagnosis, InterruptDiagnoses, KeepAnswer, PutFloorPlan> Command>
  static void of(Archive& a, Command& command) {
    auto& [first] = command;
    a(first);
  }
  template <class Archive, OneOf<ActivateModel, StartMission, PutResumeState, AppendEvent, Retention, Prune,
                                 UpdateDiagnosis, AddProposal, PruneMissions, PruneEvents, PruneAudit,
                                 RemoveRobot, ReleaseLease, StreamPosition>
                               Command>
  static void of(Archive& a, Command& command) {
    auto& [first, second] = command;
    a(first, second);
  }
  template <class Archive,
            OneOf<PutLearned, CloseProposal, TakeSpool, BatchMark, signals::CovariateChange> Command>
  static void of(Archive& a, Command& command) {
    auto& [first, second, third] = command;
    a(first, second, third);
  }
  template <class Archive, OneOf<AddModel, CheckpointMission> Command>
  static void of(Archive& a, Command& command) {
    auto& [first, second, third, fourth, fifth, sixth, seventh] = command;
    a(first, second, third, fourth, fifth, sixth, seventh);
  }
  template <class Archive, OneOf<CovariateSummary> Summary>
  static void of(Archive& a, Summary& summary) {
    auto& [first, second, third, fourth, fifth, sixth, seventh, eighth] = summary;
    a(first, second, third, fourth, fifth, sixth, seventh, eighth);
  }
  // A change has a waiting caller, who is answered, so that none is spooled. Its address identifies it.
  template <class Archive, OneOf<CommitChange> Command>
  static void of(Archive& a, Command& command) {
    auto address = reinterpret_cast<std::uintptr_t>(command.change.get());
    a(address);
  }
};

}  // namespace joulecast::history

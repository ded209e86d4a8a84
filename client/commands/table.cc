#include "client/commands/table.h"

#include <array>

namespace joulecast::client {

std::span<const AddCommand> commands() {
  static constexpr auto table = std::to_array<AddCommand>(
      {add_profile, add_estimate, add_autonomy,  add_matrix,  add_robots,    add_state,   add_missions,
       add_ledger,  add_export,   add_proposals, add_adopt,   add_check,     add_import,  add_replay,
       add_spy,     add_simulate, add_calibrate, add_battery, add_gap,       add_effects, add_store,
       add_key,     add_token,    add_audit,     add_study,   add_completion});
  return table;
}

}  // namespace joulecast::client

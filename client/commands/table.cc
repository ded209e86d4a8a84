#include "client/commands/table.h"

#include <array>

namespace joulecast::client {

std::span<const AddCommand> commands() {
  static constexpr auto table = std::to_array<AddCommand>({add_simulate, add_replay});
  return table;
}

}  // namespace joulecast::client

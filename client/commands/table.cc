#include "client/commands/table.h"

namespace joulecast::client {

std::span<const AddCommand> commands() {
#define ADD_COMMAND(name) add_##name,
  static constexpr AddCommand table[] = {FOR_EACH_COMMAND(ADD_COMMAND)};
  return table;
}

}  // namespace joulecast::client

#pragma once

#include <cstddef>
#include <functional>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "base/error.h"
#include "history/store.h"

// Commands that a store did not take before its program had to end, in a file beside it. The file's layout is
// that of the program that wrote it; another one refuses it and leaves it as it is.
namespace joulecast::history {

// The commands as the bytes of a spool: equal for equal commands.
std::vector<std::byte> command_bytes(std::span<const Command* const> commands);
// And back; absent for bytes that are not whole commands.
std::optional<std::vector<Command>> commands_of(std::span<const std::byte> bytes);

// Replaces the file whole; it is on the disk when this returns.
Result<void> write_spool(const std::string& path, std::span<const Command* const> commands);

// Fault::corrupt for bytes that are no whole spool of this program's layout.
Result<std::vector<Command>> read_spool(const std::string& path);

// Applies what a spool holds, in one transaction, and removes the file. Answers the number of commands, 0
// when there is no file. A command that the store refuses is left out and reported to `refused`.
Result<std::size_t> take_in_spool(const std::string& path, Store& store,
                                  const std::function<void(const Error&)>& refused);

}  // namespace joulecast::history

#pragma once

#include <cstddef>
#include <functional>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "base/error.h"
#include "history/store.h"

// Commands that a store had not accepted when its program had to end, in a file next to it. The file has the
// layout of the program that wrote it; a program with another layout rejects it and leaves it unchanged.
namespace joulecast::history {

// The commands as the bytes of a spool: equal for equal commands.
std::vector<std::byte> command_bytes(std::span<const Command* const> commands);
// And back; absent for bytes that are not whole commands.
std::optional<std::vector<Command>> commands_of(std::span<const std::byte> bytes);

// Makes the file, which must not be there: Fault::conflict. It is on the disk when this returns.
Result<void> write_spool(const std::string& path, const TakeSpool& first,
                         std::span<const Command* const> commands);

// The first is the TakeSpool, with the file's hash. Fault::corrupt: no whole spool of this layout.
Result<std::vector<Command>> read_spool(const std::string& path);

struct TakenSpool {
  std::size_t commands = 0;  // of the spool
  std::size_t already = 0;   // of them those that the store had
  std::size_t refused = 0;   // by the store, for their content
  std::size_t fenced = 0;    // for the robot's lease being another's
  std::size_t samples = 0;   // raw ones of the fenced commands, stored since no mission had them
  bool before = false;       // the whole spool was taken in before
  std::string kept_as;       // the file, put aside; empty: it was removed
};

// Takes in the spool of the store's previous program: applies its commands once, in one transaction, and
// removes the file; all zero without a file. A file with refused or fenced commands is set aside, as is one
// that cannot be applied: Fault::corrupt, or ::conflict if it belongs to another store or the store has
// changed since the spool was written; the message then names it. After any other error it is left in place,
// to be tried again. Refused commands are reported to `refused`.
Result<TakenSpool> take_in_spool(const std::string& path, Store& store,
                                 const std::function<void(const Error&)>& refused);

}  // namespace joulecast::history

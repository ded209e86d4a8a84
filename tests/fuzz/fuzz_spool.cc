#include <array>
#include <cstddef>
#include <cstring>
#include <span>
#include <vector>

#include "fuzz.h"
#include "history/spool.h"

using namespace joulecast;
using namespace joulecast::history;

namespace {

void try_bytes(std::span<const std::byte> bytes) {
  const auto commands = commands_of(bytes);
  if (!commands) return;
  std::vector<const Command*> read;
  for (const Command& command : *commands) read.push_back(&command);
  const auto again = commands_of(command_bytes(read));
  testing::require(again && again->size() == commands->size());
}

std::vector<std::byte> sample() {
  CheckpointMission checkpoint;
  checkpoint.mission.robot_id = "amr-1";
  checkpoint.trace.resize(2);
  checkpoint.samples.resize(3);
  checkpoint.resume_state.emplace();
  checkpoint.covariates.resize(1);
  const std::array<Command, 6> commands = {Command(AddModel{"amr-1", 1, ModelOrigin::http, "", "{}", {}}),
                                           Command(checkpoint),
                                           Command(AddDiagnosis{}),
                                           Command(AppendEvent{{0, 1, "amr-1", "kind", "{}"}}),
                                           Command(KeepAnswer{{"a", "k", "f", 1, 200, "", "{}"}}),
                                           Command(TakeSpool{"h", {"s", "w", 3}, 1})};
  std::vector<const Command*> pointers;
  for (const Command& command : commands) pointers.push_back(&command);
  return command_bytes(pointers);
}

}  // namespace

// The bytes themselves, and a valid spool overwritten with the input at an offset given by the input.
JOULECAST_FUZZ_TARGET(spool) {
  static const std::vector<std::byte> sound = sample();
  const auto bytes = std::as_bytes(std::span(data, size));
  try_bytes(bytes);
  if (size < 3) return;
  std::vector<std::byte> laid = sound;
  const std::size_t at = (data[0] + 256u * data[1]) % laid.size();
  const std::size_t length = std::min({std::size_t{data[2]} % 9, size - 3, laid.size() - at});
  if (length > 0) std::memcpy(&laid[at], data + 3, length);
  try_bytes(laid);
  try_bytes(std::span(laid).first(at));
}

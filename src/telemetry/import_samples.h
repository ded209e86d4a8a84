#pragma once

#include <cstddef>
#include <vector>

#include "signals/sample.h"
#include "telemetry/import_mapping.h"

// Processing of a mission's samples after all its rows are read. Only the import's own sources use this.
namespace joulecast::telemetry {

// Range of positions that leap through more than half of it, such as angles within a turn; 0 of others.
[[nodiscard]] double leap_of(const std::vector<signals::Sample>& samples, std::size_t number);

// Puts the rate of a number in its place, over a window. Two samples at least; where fewer than two are
// measured within the window there is no rate. Returns the thrown jumps: of a position that jumps between two
// samples, in which the rate is many times farther from that before and that behind than rates change
// elsewhere. Jumps are taken out.
std::vector<double> differentiate(std::vector<signals::Sample>& samples, std::size_t number, double window_s);

// In a table of changes: repeats each sample until just before the next one, once in the usual interval of
// the rows or in a second, whichever is longer. Returns how many were added.
std::size_t hold_between(std::vector<signals::Sample>& samples);

}  // namespace joulecast::telemetry

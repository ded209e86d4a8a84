#pragma once

#include <cstddef>
#include <span>

namespace joulecast::gap {

// Number of runs of `rows` equal readings in a channel.
struct Repetitions {
  std::size_t rows = 0, count = 0;
};

// Number of rows for which a reading is held before the next one; 1 where none is repeated, or changes are
// too few. Lengths ascend. A coarse converter repeats values by chance, so that their lengths are geometric;
// those of a held channel are whole numbers of periods.
std::size_t rows_held(std::span<const Repetitions> lengths);

}  // namespace joulecast::gap

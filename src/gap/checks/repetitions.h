#pragma once

#include <cstddef>
#include <span>

namespace joulecast::gap {

// How many times a channel showed one value for so many rows.
struct Repetitions {
  std::size_t rows = 0, count = 0;
};

// For how many rows a reading stands before the next one is there; 1 where none is repeated, or too few
// changes tell. Lengths ascend. A coarse converter repeats values by chance, so that their lengths are
// geometric; those of a held channel are whole numbers of periods.
std::size_t rows_held(std::span<const Repetitions> lengths);

}  // namespace joulecast::gap

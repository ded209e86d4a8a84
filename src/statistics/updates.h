#pragma once

#include <cstddef>
#include <span>
#include <vector>

namespace joulecast::statistics {

// How many times a channel showed one value for so many rows.
struct Repetitions {
  std::size_t rows = 0, count = 0;
};

// For how many rows a reading stands before the next one is there; 1 where none is repeated, or too few
// changes tell. Lengths ascend. A coarse converter repeats values by chance, so that their lengths are
// geometric; those of a held channel are whole numbers of periods.
std::size_t rows_held(std::span<const Repetitions> lengths);

// At which rows of a table a channel really was read anew. Loggers write rows faster than a sensor answers
// and repeat its last reading; whoever takes each row for a reading counts it many times, and compares it
// with a motion that has gone on since.
struct Updates {
  std::vector<std::size_t> at;  // rows with a new reading; every known row where none is repeated
  double period_s = 0;          // between readings; 0 without two known rows
  bool held = false;            // readings last for more than one row
};

// NaN rows are no readings. Inside a longer repetition readings are taken to come at the period, so that a
// steady state counts as often as it was read. The two spans are equally long, time ascending.
Updates find_updates(std::span<const double> time_s, std::span<const double> value);

}  // namespace joulecast::statistics

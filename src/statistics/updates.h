#pragma once

#include <cstddef>
#include <span>
#include <vector>

namespace joulecast::statistics {

// Rows of a table with a new reading of a channel. Loggers write rows faster than a sensor answers and repeat
// its last reading. Taking each row as a reading counts it many times, and compares it with later motion.
struct Updates {
  std::vector<std::size_t> at;  // rows with a new reading; every finite row where none is repeated
  double period_s = 0;          // between readings; 0 without two finite rows
  bool held = false;            // a reading lasts for more than one row, repeated or followed by NaN
};

// NaN rows are no readings. A coarse converter repeats a value by chance and not for a fixed time: readings
// are repeated only where repetitions are whole numbers of one period, of at least two rows. Inside a longer
// repetition readings are taken to come at the period, so that a steady state counts as often as it was read.
// The two spans are equally long, time ascending.
Updates find_updates(std::span<const double> time_s, std::span<const double> value);

}  // namespace joulecast::statistics

#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <map>
#include <string>
#include <vector>

namespace joulecast::forecast {

// Forecasts of one kind of request after as many missions, counted against the missions' costs.
struct RowCoverage {
  std::vector<double> energy_error, duration_error;    // measured over the median, less 1
  double energy_width = 0;                             // sum of the interval's width over the median
  std::size_t energy_inside = 0, duration_inside = 0;  // the 90 % interval
  std::size_t count() const { return energy_error.size(); }
};

// Success probabilities between the tenths: how many were stated, their sum, and how many budgets held.
struct StatedChances {
  std::size_t count = 0, held = 0;
  double sum = 0;
};

struct ForeignCoverage {
  std::map<std::string, RowCoverage> rows;
  // Of robots from five missions on and of those with fewer; payloads not carried before are with the latter.
  std::array<StatedChances, 10> known, little_known;
};

// Five robots of each of so many kinds from the seed on drive 45 missions, of every second kind exactly by
// plan. Requests for the last fifteen are forecast after 1, 2, 5, 10 and 30 missions: with nothing but ways
// stated, with cruises and halts, and with everything. Further rows: payloads after at most 20 missions
// without one, and robots without missions, with four siblings of 24 each.
ForeignCoverage foreign_coverage(std::uint64_t seed, std::size_t kinds);

}  // namespace joulecast::forecast

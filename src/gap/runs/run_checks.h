#pragma once

#include <vector>

#include "gap/runs/run_rows.h"
#include "gap/verdict/diagnosis.h"

namespace joulecast::gap {

// Faults of a table of runs, found before any effect is estimated: energies in another unit, or constant over
// all runs, which contradicts all of them; single runs that are far from the prediction of all others.
struct RunChecks {
  std::vector<Check> checks;
  std::vector<std::size_t> apart;  // runs that are far from the others
};
RunChecks check_runs(const RunRows& rows);

}  // namespace joulecast::gap

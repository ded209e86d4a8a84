#pragma once

#include <vector>

#include "gap/checks/check.h"
#include "gap/runs/run_rows.h"

namespace joulecast::gap {

// What is wrong with a table of runs before any effect is judged: energies in another unit, or the same for
// whatever run, which contradicts them all; single runs that are far from what all others let expect.
struct RunChecks {
  std::vector<Check> checks;
  std::vector<std::size_t> apart;  // runs that are far from the others
};
RunChecks check_runs(const RunRows& rows);

}  // namespace joulecast::gap

#pragma once

#include <vector>

#include "gap/checks/check.h"
#include "gap/runs/run_columns.h"

namespace joulecast::gap {

// What is wrong with a table of runs before any effect is judged: energies in another unit, or the same for
// whatever run, which contradicts them all; single runs that are far from what all others let expect.
std::vector<Check> check_runs(const RunColumns& columns);

}  // namespace joulecast::gap

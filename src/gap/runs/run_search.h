#pragma once

#include <functional>
#include <optional>
#include <span>
#include <vector>

#include "gap/diagnose/explain.h"
#include "gap/runs/run_problem.h"
#include "gap/verdict/diagnosis.h"

namespace joulecast::gap {

// What is found in runs: the explanation, and what of it is named, with its strengths.
struct RunFinding {
  RunScatter scatter;
  Problem problem;
  Explanation explanation;
  HypothesisSet named;
  std::vector<Cause> causes;  // in the order of `named`
};

// Of the runs that are not left out: scatter, choice and strengths are theirs alone. Blocks hold no two runs
// of which one is left out and the other is not.
RunFinding search_runs(const RunColumns& columns, std::span<const std::size_t> block,
                       const std::vector<bool>& left_out = {});

// Surrogate tables: the conditions of the runs, energies as the explanation has them without one of its
// members, and what it leaves over in any order. How often is that member, or one of its group, found there
// as well? One answer a member; nothing where `goes_on` returns false.
std::optional<std::vector<Controls>> control_runs(const RunColumns& columns,
                                                  std::span<const std::size_t> block,
                                                  const RunFinding& finding, std::size_t surrogates,
                                                  const std::function<bool(double)>& goes_on);

}  // namespace joulecast::gap

#pragma once

#include <functional>
#include <optional>
#include <span>
#include <vector>

#include "gap/diagnose/explain.h"
#include "gap/diagnose/linear.h"

namespace joulecast::gap {

struct FitSettings {
  ExplainSettings explain;
  std::vector<double> shares{0.07};  // of the mean power, that an effect which is there may move
};

struct FitResult {
  Linear linear;
  Shapes shapes;
  std::vector<Cause> causes;  // around which it rests
  // What every robot has (base_fit), where the file is so far off that all of it is estimated anew; empty:
  // not so.
  std::vector<Cause> base;
  double log_joint = 0;  // of the best explanation, to compare starts by
};

// Searches from `start`, linearises around what it finds, narrows shapes and searches again until the set and
// its strengths rest. Empty when `goes_on` returns false.
std::optional<FitResult> fit_windows(const Material& material, std::span<const Cause> start,
                                     const FitSettings& settings, const std::function<bool()>& goes_on);

}  // namespace joulecast::gap

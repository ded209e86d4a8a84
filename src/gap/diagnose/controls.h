#pragma once

#include <functional>
#include <optional>

#include "gap/diagnose/explain.h"
#include "gap/diagnose/linear.h"
#include "gap/verdict/diagnosis.h"

namespace joulecast::gap {

struct ControlSettings {
  ExplainSettings explain;
  std::size_t surrogates = 20;
  std::size_t threads = 1;
};

// Negative controls on the recordings themselves: the recorded motion and channels, readings as the
// explanation predicts them without one of its members, and its own leftovers, resampled in blocks of some
// seconds. How often is that member, or one of its group, found there as well? One answer a member, in the
// explanation's order. Empty when `goes_on` returns false; it is called by one thread at a time.
std::optional<std::vector<Controls>> control(const Material& material, const Linear& linear,
                                             const Problem& problem, const Explanation& explanation,
                                             const ControlSettings& settings,
                                             const std::function<bool(double)>& goes_on);

}  // namespace joulecast::gap

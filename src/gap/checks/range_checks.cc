#include <fmt/format.h>

#include <limits>

#include "gap/checks/evaluation.h"

namespace joulecast::gap {
namespace {

constexpr double biased_share = 0.1;  // of the samples; beyond, the remaining samples are biased

}  // namespace

std::vector<Check> check_ranges(const telemetry::RecordingSet& recordings) {
  constexpr double not_known = std::numeric_limits<double>::quiet_NaN();
  std::vector<Check> checks;
  for (const auto& [field, beyond] : recordings.beyond_range) {
    const double samples = static_cast<double>(beyond.samples);
    const double share = samples / (samples + static_cast<double>(recordings.samples));
    if (share < biased_share) continue;
    checks.push_back(
        {"implausible_readings",
         field,
         share,
         {not_known, not_known},
         fmt::format(
             "{} of {} samples are left out for a {} that no robot reads, as far as {:.4g}{}: what is "
             "left is a biased choice.",
             beyond.samples, beyond.samples + recordings.samples, field, beyond.farthest,
             telemetry::in_other_unit(field, beyond.farthest)),
         true});
  }
  return checks;
}

}  // namespace joulecast::gap

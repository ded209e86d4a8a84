#pragma once

#include <array>
#include <string_view>

#include "base/error.h"
#include "gap/diagnose/recordings.h"

namespace joulecast::trial {

// The method with one of its parts left out.
enum class Ablation { channels };
inline constexpr std::array ablations{Ablation::channels};
[[nodiscard]] std::string_view name_of(Ablation ablation);

[[nodiscard]] Result<gap::Diagnosis> diagnose_without(Ablation ablation,
                                                      const telemetry::RecordingSet& recordings,
                                                      const robot::RobotModel& robot);

}  // namespace joulecast::trial

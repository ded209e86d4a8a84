#pragma once

#include <array>
#include <string_view>

#include "base/error.h"
#include "gap/diagnosis.h"

namespace joulecast::trial {

// The method with one of its parts left out.
enum class Ablation { channels, weak_form, whitening, scatter, tolerances, open_set };
inline constexpr std::array ablations{Ablation::channels, Ablation::weak_form,  Ablation::whitening,
                                      Ablation::scatter,  Ablation::tolerances, Ablation::open_set};
[[nodiscard]] std::string_view name_of(Ablation ablation);

[[nodiscard]] Result<gap::Diagnosis> diagnose_without(Ablation ablation, const telemetry::RecordingSet& recordings,
                                                      const robot::RobotModel& robot);

}  // namespace joulecast::trial

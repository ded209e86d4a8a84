#pragma once

#include <span>
#include <vector>

#include "dynamics/drive_model.h"
#include "windows/windows.h"

// Battery power of windows by the drive model, computed by the trial itself: the scoring shares no code with
// the diagnosis.
namespace joulecast::trial {

// The power required by the motion of a window, as the robot's meter would read it [W].
template <class S>
[[nodiscard]] S window_power_w(const dynamics::BasicDriveModel<S>& model, const windows::Window& window);

extern template double window_power_w(const dynamics::BasicDriveModel<double>&, const windows::Window&);
extern template dynamics::Dual window_power_w(const dynamics::BasicDriveModel<dynamics::Dual>&,
                                              const windows::Window&);

// The same for every window, by the robot file with these effects added to its own.
[[nodiscard]] std::vector<double> window_powers_w(const robot::RobotModel& robot,
                                                  std::span<const dynamics::ActiveEffect> effects,
                                                  std::span<const windows::Window> windows);

}  // namespace joulecast::trial

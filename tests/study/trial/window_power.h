#pragma once

#include <span>
#include <vector>

#include "dynamics/drive_model.h"
#include "windows/windows.h"

// Battery power of windows by the drive model, as the trial works it out for itself: what judges the
// diagnosis shares no code with it.
namespace joulecast::trial {

// That the motion of a window asks, as the robot's meter would read it [W].
template <class S>
[[nodiscard]] S window_power_w(const dynamics::BasicDriveModel<S>& model, const windows::Window& window);

extern template double window_power_w(const dynamics::BasicDriveModel<double>&, const windows::Window&);
extern template dynamics::Dual window_power_w(const dynamics::BasicDriveModel<dynamics::Dual>&,
                                              const windows::Window&);

// The same of every window, by the robot file with these effects beside its own.
[[nodiscard]] std::vector<double> window_powers_w(const robot::RobotModel& robot,
                                                  std::span<const dynamics::ActiveEffect> effects,
                                                  std::span<const windows::Window> windows);

}  // namespace joulecast::trial

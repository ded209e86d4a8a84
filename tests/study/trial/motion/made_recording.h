#pragma once

#include <vector>

#include "client/virtual_robot/rng.h"
#include "tests/study/trial/motion/plant.h"

namespace joulecast::trial::motion {

// Residuals for every instant of every mission, in blocks of 5 to 20 s of the given ones, each from a random
// place; a mission shorter than its block gives all that it has.
[[nodiscard]] std::vector<std::vector<double>> resampled(const std::vector<std::vector<double>>& residual_w,
                                                         double period_s, virtual_robot::Rng& rng);

// The recording if its battery had given this power at each instant: the current is held between instants and
// rounded as it was recorded, missing where it was missing; the voltage falls by the battery's own resistance
// times the change of the current. Motion is kept. Readings of the motors, which do not include this power,
// are removed.
[[nodiscard]] std::vector<telemetry::Recording> made_recording(
    const MotionLog& log, const std::vector<std::vector<MeteredPower>>& power);

}  // namespace joulecast::trial::motion

#pragma once

#include <span>
#include <string>
#include <string_view>

#include "tests/study/exploration/explore.h"
#include "tests/study/exploration/mission_energy.h"

namespace joulecast::report {

// An SVG that shows an exploration from start to end: the whole path with its numbered looks on the left, the
// steps in words, legend and energy on the right, and below one small picture a round with the next best
// view's candidates.
std::string draw_exploration(std::string_view title, const exploration::Map& map,
                             const exploration::Exploration& exploration,
                             std::span<const exploration::MissionEnergy> energy);

}  // namespace joulecast::report

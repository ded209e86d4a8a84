#pragma once

#include <array>

namespace joulecast::planning {

// Gauss-Legendre rules on [0, 1] (Abramowitz & Stegun, table 25.4): where to look, and its weight.
struct GaussNode {
  double at, weight;
};
inline constexpr std::array<GaussNode, 2> gauss2{{{0.21132486540518713, 0.5}, {0.7886751345948129, 0.5}}};
inline constexpr std::array<GaussNode, 3> gauss3{
    {{0.1127016653792583, 5.0 / 18}, {0.5, 8.0 / 18}, {0.8872983346207417, 5.0 / 18}}};

}  // namespace joulecast::planning

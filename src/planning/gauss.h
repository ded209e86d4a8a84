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
inline constexpr std::array<GaussNode, 4> gauss4{{{0.06943184420297371, 0.17392742256872692},
                                                  {0.33000947820757187, 0.32607257743127307},
                                                  {0.6699905217924281, 0.32607257743127307},
                                                  {0.9305681557970263, 0.17392742256872692}}};

}  // namespace joulecast::planning

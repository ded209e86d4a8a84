#pragma once

#include <optional>
#include <span>
#include <vector>

#include "gap/diagnosis.h"
#include "gap/posterior.h"

namespace joulecast::gap {

// The explanation that the data prefer, in the terms of the catalogue. Shares are of the mean power.
struct Naming {
  std::vector<std::size_t> whole;  // hypotheses preferred, with what lies outside the catalogue
  std::vector<std::size_t> set;    // those of them that the gap needs
  std::vector<Chosen> chosen;      // the effects of the set,
  std::vector<dynamics::ActiveEffect> effects;
  std::vector<DiagnosedEffect> named;  // in the same order; shares of the gap not yet told
  double weakest_group = 1;            // probability of the least sure effect or one of its alternatives
  double named_share = 0, unknown_share = 0;
  double to_and_fro_share = 0;         // moved by all effects of the whole, whichever way
  std::optional<std::size_t> unknown;  // the largest of the set outside the catalogue
  double largest_unknown_share = 0;
};

// `windows` and `measured` [W]: what was fitted; `power_gap`: integral of |P_measured - P_model| over that of
// |P_measured|.
Naming name_effects(const Fit& fit, const Posterior& posterior, const MovedShares& moved,
                    const robot::RobotModel& robot, std::span<const Window> windows,
                    std::span<const double> measured, double power_gap);

// Wheels that slip while driving and while braking alike burn that part of what passes through them: to the
// channels a smaller wheel with a gear that loses as much. Gives such a pair its name.
void name_burning_slip(std::vector<DiagnosedEffect>& effects);

}  // namespace joulecast::gap

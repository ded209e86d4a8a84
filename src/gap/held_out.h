#pragma once

#include <span>
#include <vector>

#include "gap/diagnosis.h"
#include "gap/fit.h"

namespace joulecast::gap {

// The coefficients of the effects of a set as these data estimate them; outside families are left out.
std::vector<Chosen> coefficients_of(const Fit& fit, const Information& total,
                                    std::span<const std::size_t> set);

// Leave one mission out, or half of one that the others cannot speak for, fit the rest, predict it.
// `measured` is of these windows, `plain` and `nominal` of the ones without any delay taken out; `floor` of
// noise beside the mean power.
Shrinkage held_out(const Fit& fit, const robot::RobotModel& robot, std::span<const std::size_t> set,
                   std::span<const Window> windows, std::span<const double> measured,
                   std::span<const double> plain, std::span<const double> nominal, double floor);

}  // namespace joulecast::gap

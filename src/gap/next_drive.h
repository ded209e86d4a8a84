#pragma once

#include <vector>

#include "gap/diagnosis.h"
#include "gap/fit.h"

namespace joulecast::gap {

// For each effect that has alternatives: of a list of manoeuvres, the ones that raise the expected log
// evidence for the named effect over its best alternative most.
std::vector<NextDrive> next_drives(const Fit& fit, const robot::RobotModel& robot,
                                   const Diagnosis& diagnosis);

// What shows whether something follows a variable, and how.
std::vector<NextDrive> drives_for(const Outside& outside);

// What to drive before anything can be said: the first of the list.
std::vector<NextDrive> first_drives(const robot::RobotModel& robot);

}  // namespace joulecast::gap

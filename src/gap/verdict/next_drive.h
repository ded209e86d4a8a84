#pragma once

#include <vector>

#include "gap/posterior/walk.h"
#include "gap/verdict/diagnosis.h"

namespace joulecast::gap {

// For each effect that has alternatives: of a list of manoeuvres, the ones that raise the expected log
// evidence for the named effect over its best alternative most.
std::vector<NextDrive> next_drives(const posterior::Fit& fit, const std::vector<DiagnosedEffect>& effects);

// What shows whether something follows a variable, and how.
std::vector<NextDrive> drives_for(const Outside& outside);

// What to drive before anything can be said: the first of the list.
std::vector<NextDrive> first_drives(const robot::RobotModel& robot);

}  // namespace joulecast::gap

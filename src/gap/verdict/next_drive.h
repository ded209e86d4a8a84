#pragma once

#include <vector>

#include "gap/posterior/walk.h"
#include "gap/verdict/diagnosis.h"

namespace joulecast::gap {

// Returns for each effect with alternatives the manoeuvre that raises the expected log evidence for it over
// its best alternative most, by a Bayes factor of 3 or more; none where the recordings should have done so
// already.
std::vector<NextDrive> next_drives(const posterior::Fit& fit, const std::vector<DiagnosedEffect>& effects);

// Manoeuvres that show whether and how a cause follows a variable.
std::vector<NextDrive> drives_for(const Outside& outside);

// Manoeuvres for recordings without a result yet: the first of the list.
std::vector<NextDrive> first_drives(const robot::RobotModel& robot);

}  // namespace joulecast::gap

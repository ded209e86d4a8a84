#pragma once

#include "gap/naming.h"

namespace joulecast::gap {

// Sets the verdict of `d` and its probability, and those of the effects that it names, from what `d` holds
// already (gap, outside, shrinkage, effects). Verdicts and names are no surer than they came true in trials.
void judge(Diagnosis& d, const Naming& naming, const Posterior& posterior, const ColumnSet& columns,
           const robot::RobotModel& robot, double report_probability);

}  // namespace joulecast::gap

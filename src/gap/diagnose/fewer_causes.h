#pragma once

#include "gap/diagnose/explain.h"
#include "gap/diagnose/linear.h"

namespace joulecast::gap {

// A third judge, where battery power from motion is all that says something of power: by the yardstick that
// an answer is reported by, the absolute error over parts left out. Evidence weighs rows by how far each
// scatters and lets a function outside the catalogue repair a wrong name, so that the one cause that is there
// may lose to two that are not. Nothing, single causes, pairs, functions beside one cause, and what the
// explanation says are fitted without each part (fitted_to_power). Every cause has to close as much as one
// must to be named at all (least_necessary_part), a function twice that; the set that leaves least then is
// taken. Where that is another set than the explanation's, it takes its place: with the causes that leave
// hardly more in place of each as its group, and with the probability that two judges who disagree leave.
//
// `mixture` is of the same blocks as `equations`.
void prefer_fewer_causes(const Equations& equations, const Mixture& mixture, Explanation& explanation);

}  // namespace joulecast::gap

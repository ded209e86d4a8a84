#pragma once

#include <optional>
#include <vector>

#include "gap/diagnose/ripple.h"
#include "gap/diagnose/held_out.h"
#include "gap/verdict/diagnosis.h"

namespace joulecast::gap {

// Everything observed of one robot's recordings that a verdict rests on. Observations rename nothing: what they say is
// brought together in judge() alone.
struct Findings {
  const Problem& problem;
  const Explanation& explanation;
  std::vector<Controls> controls;  // of each member of the explanation; empty: not made
  // The named effects with their own strengths, and how much of the gap comes back without each, the others fitted
  // again (in units of the measured power).
  HypothesisSet named;
  std::vector<dynamics::ActiveEffect> strengths;
  std::vector<double> opened;
  std::vector<double> shares;  // of the gap, Shapley
  std::vector<double> power_w; // mean |change of battery power|
  const std::optional<HeldOut>& held_out;
  const std::optional<Ripple>& ripple;
  std::optional<std::size_t> wandering;  // member whose strength does not stand still, the one that moves most
  std::array<double, 2> wandering_power_w{};
};

// Whether an effect has to show in battery power (or in the motors') to be worth a name. The others are seen by other
// channels however little power they move.
bool shows_in_power(std::string_view id);

// Share of the mean power that something outside the catalogue has to move to be told, beside a gap that noise does
// not make of this size.
double least_outside_share(double gap_share);

// Sets verdict, effects, outside, reasons, corrections, what may be adopted and why not, from what `d` holds already
// (gap, noise floor, checks, baseline, shrinkage) and the findings.
void judge(Diagnosis& d, const Findings& findings, const robot::RobotModel& robot);

}  // namespace joulecast::gap

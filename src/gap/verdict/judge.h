#pragma once

#include <optional>
#include <vector>

#include "gap/diagnose/held_out.h"
#include "gap/diagnose/naming.h"
#include "gap/diagnose/ripple.h"
#include "gap/verdict/diagnosis.h"

namespace joulecast::gap {

// Everything observed of one robot's recordings that a verdict rests on. Observations rename nothing: what
// they say is brought together in judge() alone.
struct Findings {
  const Problem& problem;
  const Explanation& explanation;
  std::vector<Controls> controls;  // of each member of the explanation; empty: not made
  HypothesisSet named;
  std::vector<Cause> causes{};  // the named, with their own strengths
  std::vector<Cause> base{};    // what else was estimated where the robot file is far off
  bool calibrated = false;      // whether that is so
  // Of each, what would be there in its place: its alternatives, the others fitted again.
  std::vector<std::vector<dynamics::ActiveEffect>> instead{};
  std::vector<double> shares{};   // of the gap, Shapley
  std::vector<double> power_w{};  // mean |change of battery power|
  const std::optional<HeldOut>& held_out;
  std::optional<Ripple> ripple{};
  // Member whose strength does not stand still, the one that moves most.
  std::optional<std::size_t> wandering{};
  std::array<double, 2> wandering_power_w{};
  // Of a load independent of motion: what is measured beyond the other causes in the first and in the last
  // third of the time since a mission began.
  std::array<double, 2> load_by_time_w{};
  bool of_groups = false;  // strengths are differences between groups: large ones make no other robot
};

// A gap beyond the noise, of the power, from which on the file is another robot's.
inline constexpr double far_off = 0.30;

// Share of the mean power that something outside the catalogue has to move to be told, beside a gap that
// noise does not make of this size.
double least_outside_share(double gap_share);

// Sets verdict, effects, outside, reasons, corrections, what may be adopted and why not, from what `d` holds
// already (gap, noise floor, checks, baseline, shrinkage) and the findings.
void judge(Diagnosis& d, const Findings& findings, const robot::RobotModel& robot);

}  // namespace joulecast::gap

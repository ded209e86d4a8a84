#pragma once

#include <nlohmann/json_fwd.hpp>
#include <span>
#include <string>
#include <vector>

#include "base/error.h"
#include "describe/table.h"
#include "gap/verdict/diagnosis.h"
#include "robot/robot_model.h"

namespace joulecast::gap {

// Returns the robot file with the effects of a diagnosis added. Where the file has one of them already,
// strengths add up, and shapes (a zone's place, a time constant) become means weighted by strength.
// Fault::invalid names the effect and parameter where the sum leaves the catalogue's bounds.
Result<robot::RobotModel> with_effects(robot::RobotModel robot, std::span<const robot::AdoptedEffect> found);

// The same for a mismatched file: effects that correct a parameter of the file (Traits::calibrates) change
// that parameter; the others are adopted.
Result<robot::RobotModel> with_corrections(robot::RobotModel robot,
                                           std::span<const robot::AdoptedEffect> found);

// The changes by with_corrections() to the robot file, with the deviations of the strengths, one each.
std::vector<FileCorrection> corrections_of(const robot::RobotModel& robot,
                                           std::span<const robot::AdoptedEffect> found,
                                           std::span<const double> deviations);

// One effect that a robot file could take, or one of several that the data do not distinguish.
struct OfferedEffect {
  robot::AdoptedEffect effect;
  std::vector<robot::AdoptedEffect> instead;  // without parameters: its strength is unknown
};

// The effects that a diagnosis offers to the robot file it was made with, and the reason against adopting
// them. It is a part of the diagnosis's JSON, so that it can be adopted later.
struct Offer {
  std::vector<OfferedEffect> effects;
  bool corrects_file = false;  // effects that replace a parameter of the file correct it
  std::string refusal;         // why it is not to be taken; empty: it may be
};

// A user's request.
struct Choice {
  std::vector<std::string> effects;  // one of each group that the data do not distinguish
  bool force = false;                // in spite of the refusal
};

Offer offer_of(const Diagnosis& diagnosis);

// `adoption` of a diagnosis's JSON, which offer_from_json() reads from the whole diagnosis; Fault::corrupt
// without it.
const described::Table<Offer>& offer_table();
Result<Offer> offer_from_json(const nlohmann::json& diagnosis);

// Returns the robot file with the offered effects, or with those chosen in their place. Fault::conflict with
// the refusal, which `force` overrides. Fault::invalid of field "effect" for a choice that is not on offer.
Result<robot::RobotModel> take(const Offer& offer, const robot::RobotModel& robot, const Choice& choice = {});

}  // namespace joulecast::gap

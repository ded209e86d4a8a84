#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

#include "base/error.h"
#include "gap/verdict/diagnosis.h"
#include "robot/robot_model.h"

namespace joulecast::gap {

// One effect that a robot file could take, or one of several that the data do not distinguish.
struct OfferedEffect {
  robot::AdoptedEffect effect;
  std::vector<robot::AdoptedEffect> instead;  // without parameters: its strength is not known
};

// What a diagnosis offers to the robot file that it was made with, and what speaks against taking it. It is a
// part of the diagnosis's JSON, so that it can be taken later.
struct Offer {
  std::vector<OfferedEffect> effects;
  bool corrects_file = false;   // effects that say that a parameter of the file is another one correct it
  std::string refusal;          // why it is not to be taken; empty: it may be
  bool choice_settles = false;  // choosing among effects that are not distinguished is all that it takes
};

// What a person asks for.
struct Choice {
  std::vector<std::string> effects;  // one of each group that the data do not distinguish
  bool force = false;                // in spite of the refusal
};

Offer offer_of(const Diagnosis& diagnosis);

// `adoption` of a diagnosis's JSON, and back from the whole of it. Diagnoses of earlier versions lack it:
// theirs is made from verdict, effects and alternatives. Fault::corrupt where there is neither.
nlohmann::ordered_json offer_to_json(const Offer& offer);
Result<Offer> offer_from_json(const nlohmann::json& diagnosis);

// The robot file with what is offered. Fault::conflict with the refusal, which `force` overrides, or naming
// the effects between which to choose, which it does not: none of a group is taken because it stands first.
// Fault::invalid of field "effect" for a choice that is not on offer.
Result<robot::RobotModel> take(const Offer& offer, const robot::RobotModel& robot, const Choice& choice = {});

}  // namespace joulecast::gap

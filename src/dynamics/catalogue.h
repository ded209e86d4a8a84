#pragma once

#include <span>
#include <string>
#include <string_view>

#include "base/error.h"
#include "dynamics/effect.h"
#include "robot/robot_model.h"

namespace joulecast::dynamics {

// Every effect of the catalogue, in the order in which they are applied.
std::span<const Effect* const> catalogue();

// The effect with that id, or null.
const Effect* find_effect(std::string_view id);

// An effect with its numbers.
struct ActiveEffect {
  const Effect* effect = nullptr;
  EffectValues<double> values{};
};

// An effect at zero strength with its shape parameters at their initial values.
ActiveEffect initial(const Effect& effect);

// Reads an adopted effect; unknown ids, unknown or missing parameters and values outside their bounds are
// errors that name "/effects/<id>/<parameter>". Absent shape parameters take their initial values.
Result<ActiveEffect> activate(const robot::AdoptedEffect& adopted);

// The inverse of activate.
robot::AdoptedEffect adopt(const ActiveEffect& active);

// "wheel torque", "inertia", ...
std::string_view name_of(ActsOn acts_on);

// The catalogue as one Markdown document: each effect with formula, parameters, units, bounds, validity and
// source. It is part of the reference that the daemon serves.
std::string catalogue_markdown();

// The same for a terminal, two lines an effect.
std::string catalogue_listing();

}  // namespace joulecast::dynamics

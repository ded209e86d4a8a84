#pragma once

#include <string>
#include <string_view>

#include "dynamics/effect.h"

namespace joulecast::dynamics {

// "wheel torque", "inertia", ...
std::string_view name_of(ActsOn acts_on);

// The catalogue as one Markdown document: each effect with formula, parameters, units, bounds, validity and
// source. It is part of the reference that the daemon serves.
std::string catalogue_markdown();

// The same for a terminal, two lines an effect.
std::string catalogue_listing();

}  // namespace joulecast::dynamics

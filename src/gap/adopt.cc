#include "gap/adopt.h"

#include <algorithm>
#include <cmath>

#include "dynamics/catalogue.h"

namespace joulecast::gap {

Result<robot::RobotModel> with_effects(robot::RobotModel robot, std::span<const robot::AdoptedEffect> found) {
  for (const robot::AdoptedEffect& effect : found) {
    Result<dynamics::ActiveEffect> more = dynamics::activate(effect);
    if (!more) return tl::unexpected(std::move(more.error()));
    const auto present = std::ranges::find(robot.effects, effect.id, &robot::AdoptedEffect::id);
    if (present == robot.effects.end()) {
      robot.effects.push_back(effect);
      continue;
    }
    const Result<dynamics::ActiveEffect> had = dynamics::activate(*present);
    if (!had) return tl::unexpected(had.error());
    const double a = std::fabs(had->values[0]), b = std::fabs(more->values[0]);
    const double weight = a + b > 0 ? b / (a + b) : 0;
    for (std::size_t k = 1; k < more->effect->info().parameters.size(); ++k)
      more->values[k] = std::lerp(had->values[k], more->values[k], weight);
    more->values[0] += had->values[0];
    *present = dynamics::adopt(*more);
    if (const auto valid = dynamics::activate(*present); !valid) return tl::unexpected(valid.error());
  }
  return robot;
}

}  // namespace joulecast::gap

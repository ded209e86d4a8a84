#include "dynamics/catalogue.h"

#include <algorithm>
#include <string>

#include "base/bounds.h"
#include "base/nearest_word.h"

namespace joulecast::dynamics {

const Effect* find_effect(std::string_view id) {
  const auto found =
      std::ranges::find_if(catalogue(), [&](const Effect* effect) { return effect->info().id == id; });
  return found == catalogue().end() ? nullptr : *found;
}

ActiveEffect initial(const Effect& effect) {
  ActiveEffect active{&effect, {}};
  const auto& parameters = effect.info().parameters;
  for (std::size_t k = 0; k < parameters.size(); ++k) active.values[k] = parameters[k].initial;
  return active;
}

Result<ActiveEffect> activate(const robot::AdoptedEffect& adopted) {
  const std::string at = "/effects/" + adopted.id;
  const Effect* effect = find_effect(adopted.id);
  if (effect == nullptr) {
    const auto id = [](const Effect* known) { return known->info().id; };
    return invalid(at, "is not an effect of the catalogue" + did_you_mean(adopted.id, catalogue(), id));
  }
  ActiveEffect active = initial(*effect);
  const auto& parameters = effect->info().parameters;
  bool strength_given = false;
  for (const auto& [name, value] : adopted.parameters) {
    const auto found =
        std::ranges::find_if(parameters, [&](const EffectParameter& p) { return p.name == name; });
    if (found == parameters.end()) return invalid(at + "/" + name, "is not a parameter of this effect");
    if (const Bounds bounds{found->minimum, found->maximum}; !bounds.contain(value))
      return invalid(at + "/" + name, out_of_bounds(value, bounds, found->unit));
    const auto index = static_cast<std::size_t>(found - parameters.begin());
    active.values[index] = value;
    strength_given = strength_given || index == 0;
  }
  if (!strength_given) return invalid(at + "/" + std::string(parameters[0].name), "is required");
  return active;
}

robot::AdoptedEffect adopt(const ActiveEffect& active) {
  const EffectInfo& info = active.effect->info();
  robot::AdoptedEffect adopted{std::string(info.id), {}};
  for (std::size_t k = 0; k < info.parameters.size(); ++k)
    adopted.parameters.emplace_back(info.parameters[k].name, active.values[k]);
  return adopted;
}

}  // namespace joulecast::dynamics

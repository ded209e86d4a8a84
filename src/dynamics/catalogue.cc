#include "dynamics/catalogue.h"

#include <algorithm>
#include <array>
#include <cstdio>

#include "base/bounds.h"
#include "base/nearest_word.h"

namespace joulecast::dynamics {
namespace {

constexpr std::array groups{ActsOn::wheel_torque, ActsOn::inertia,    ActsOn::motor,
                            ActsOn::battery_side, ActsOn::kinematics, ActsOn::sensors};

std::string number(double value) {
  char text[32];
  std::snprintf(text, sizeof text, "%g", value);
  return text;
}

std::string unit_of(const EffectParameter& p) {
  return p.unit == "1" ? "" : std::string(" ").append(p.unit);
}

std::string bounds_of(const EffectParameter& p) {
  return number(p.minimum) + " to " + number(p.maximum) + unit_of(p);
}

// A vertical bar ends a cell of a Markdown table even inside code.
std::string cell(std::string_view text) {
  std::string out;
  for (const char c : text) out += c == '|' ? std::string("\\|") : std::string(1, c);
  return out;
}

void add_entry(std::string& out, const EffectInfo& info) {
  out += "### `" + std::string(info.id) + "`\n\n";
  out += "    " + std::string(info.formula) + "\n\n";
  out += "| parameter | unit | bounds | unless given | meaning |\n|---|---|---|---|---|\n";
  char name = 'a';
  for (const EffectParameter& p : info.parameters)
    out += "| `" + std::string(1, name++) + "` `" + std::string(p.name) + "` | " +
           (p.unit == "1" ? "-" : cell(p.unit)) + " | " + number(p.minimum) + " to " + number(p.maximum) +
           " | " + (&p == info.parameters.data() ? "required" : number(p.initial)) + " | " + cell(p.meaning) +
           " |\n";
  out += "\nHolds for: " + std::string(info.validity) + ".";
  if (info.needs == Needs::position) out += " Needs the position on the map.";
  if (info.needs == Needs::heading) out += " Needs the heading.";
  if (info.needs == Needs::climb) out += " Needs the climb: `pitch`, or the covariate `height_m`.";
  out += "\nSource: " + std::string(info.source) + ".\n\n";
}

}  // namespace

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

std::string_view name_of(ActsOn acts_on) {
  constexpr std::string_view names[] = {"wheel torque", "inertia",    "motor electrics",
                                        "battery side", "kinematics", "sensors"};
  return names[static_cast<std::size_t>(acts_on)];
}

std::string catalogue_markdown() {
  std::string out =
      "# Effects\n\n"
      "What a robot may do that its robot file leaves out. Each is one object that the online meter, the\n"
      "planner, the forward simulation and the diagnosis share; a robot file adopts it by an entry of\n"
      "`effects` such as `\"coulomb_friction\": {\"ratio\": 0.3}`. The first parameter is the\n"
      "strength: at zero the effect is absent. Letters stand for the parameters in their order; `r` wheel\n"
      "radius, `l` half track, `w` wheel speed, `v` speed, `m` mass with payload, `i` motor current.\n\n";
  for (const ActsOn group : groups) {
    out += "## Acting on: " + std::string(name_of(group)) + "\n\n";
    for (const Effect* effect : catalogue())
      if (effect->info().acts_on == group) add_entry(out, effect->info());
  }
  out.pop_back();
  return out;
}

std::string catalogue_listing() {
  std::string out;
  for (const ActsOn group : groups) {
    out += std::string(name_of(group)) + "\n";
    for (const Effect* effect : catalogue()) {
      const EffectInfo& info = effect->info();
      if (info.acts_on != group) continue;
      out += "  " + std::string(info.id) + ": " + std::string(info.formula) + "\n    ";
      const char* separator = "";
      for (const EffectParameter& p : info.parameters) {
        out += separator + std::string(p.name) + " " + bounds_of(p);
        separator = "; ";
      }
      out += "\n";
    }
  }
  return out;
}

}  // namespace joulecast::dynamics

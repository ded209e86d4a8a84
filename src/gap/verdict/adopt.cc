#include "gap/verdict/adopt.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>
#include <set>

#include "base/try.h"
#include "dynamics/catalogue.h"
#include "gap/traits.h"
#include "gap/verdict/words.h"
#include "robot/robot_file.h"

namespace joulecast::gap {
namespace {

using Json = nlohmann::json;
using described::Table;
using robot::AdoptedEffect;

// An effect with its numbers, without a check of the catalogue's bounds: a negative strength may reduce the
// file's own.
Result<dynamics::ActiveEffect> as_found(const AdoptedEffect& adopted) {
  const dynamics::Effect* effect = dynamics::find_effect(adopted.id);
  if (effect == nullptr) return invalid("/effects/" + adopted.id, "is not an effect of the catalogue");
  dynamics::ActiveEffect active = dynamics::initial(*effect);
  const auto& parameters = effect->info().parameters;
  for (const auto& [name, value] : adopted.parameters) {
    const auto at = std::ranges::find(parameters, name, &dynamics::EffectParameter::name);
    if (at != parameters.end()) active.values[static_cast<std::size_t>(at - parameters.begin())] = value;
  }
  return active;
}

// How an effect changes a parameter of the robot file: (1 + times) * value + plus.
struct Change {
  std::string pointer;
  double times = 0, plus = 0;
};

void change_number(Json& value, const Change& change) {
  if (value.is_array()) {
    for (Json& one : value) change_number(one, change);
  } else {
    value = (1 + change.times) * value.get<double>() + change.plus;
  }
}

// None where no parameter corresponds, or where it would become impossible, as of a base load below zero.
std::optional<Change> change_of(const dynamics::ActiveEffect& effect, const Json& file) {
  const Traits& traits = traits_of(effect.effect->info().id);
  if (traits.calibrates.empty()) return std::nullopt;
  const auto& parameters = effect.effect->info().parameters;
  Change change{std::string(traits.calibrates), traits.adds ? 0 : effect.values[0],
                traits.adds ? effect.values[0] : 0};
  for (std::size_t k = 1; k < parameters.size(); ++k)
    if (parameters[k].strength) change.plus += effect.values[k];
  Json changed = file;
  change_number(changed[Json::json_pointer(change.pointer)], change);
  return robot::parse_robot(changed.dump()) ? std::optional(std::move(change)) : std::nullopt;
}

double mean_of(const Json& value) {
  if (!value.is_array()) return value.get<double>();
  double sum = 0;
  for (const Json& one : value) sum += one.get<double>();
  return sum / static_cast<double>(value.size());
}

AdoptedEffect effect_from(const Json& document) {
  AdoptedEffect effect{document.at("id").get<std::string>(), {}};
  for (const auto& [name, value] : document.at("parameters").items())
    if (value.is_number()) effect.parameters.emplace_back(name, value.get<double>());
  return effect;
}

std::vector<std::string> ids_of(const OfferedEffect& offered) {
  std::vector<std::string> ids{offered.effect.id};
  for (const AdoptedEffect& other : offered.instead) ids.push_back(other.id);
  return ids;
}

// The chosen effects.
Result<std::vector<AdoptedEffect>> choose(const Offer& offer, const std::vector<std::string>& wanted) {
  std::set<std::string> unused(wanted.begin(), wanted.end());
  std::vector<AdoptedEffect> chosen;
  for (const OfferedEffect& offered : offer.effects) {
    const std::vector<std::string> ids = ids_of(offered);
    std::vector<std::string> named;
    for (const std::string& id : ids) {
      if (std::ranges::find(wanted, id) != wanted.end()) named.push_back(id);
      unused.erase(id);
    }
    if (named.size() > 1)
      return invalid("effect", fmt::format("{} are not distinguished: name one of them", enumerate(named)));
    const auto other =
        std::ranges::find(offered.instead, named.empty() ? "" : named.front(), &AdoptedEffect::id);
    chosen.push_back(other == offered.instead.end() ? offered.effect : *other);
    if (chosen.back().parameters.empty())
      return fail(Fault::conflict, "effect",
                  fmt::format("the diagnosis has no strength of {}: only {} can be adopted", chosen.back().id,
                              offered.effect.id));
  }
  if (unused.empty()) return chosen;
  std::vector<std::string> known;
  for (const OfferedEffect& offered : offer.effects)
    for (std::string& id : ids_of(offered)) known.push_back(std::move(id));
  return invalid("effect",
                 fmt::format("{} is not among what was found: {}", *unused.begin(), enumerate(known)));
}

}  // namespace

Result<robot::RobotModel> with_effects(robot::RobotModel robot, std::span<const AdoptedEffect> found) {
  for (const AdoptedEffect& effect : found) {
    TRY_ASSIGN(dynamics::ActiveEffect more, as_found(effect));
    auto present = std::ranges::find(robot.effects, effect.id, &AdoptedEffect::id);
    if (present == robot.effects.end()) {
      robot.effects.push_back(dynamics::adopt(more));
      present = robot.effects.end() - 1;
    } else {
      TRY_ASSIGN(const dynamics::ActiveEffect had, dynamics::activate(*present));
      const double a = std::fabs(had.values[0]), b = std::fabs(more.values[0]);
      const double weight = a + b > 0 ? b / (a + b) : 0;
      const auto& parameters = more.effect->info().parameters;
      for (std::size_t k = 0; k < parameters.size(); ++k)
        more.values[k] = k == 0 || parameters[k].strength ? had.values[k] + more.values[k]
                                                          : std::lerp(had.values[k], more.values[k], weight);
      *present = dynamics::adopt(more);
    }
    TRY(dynamics::activate(*present));
  }
  return robot;
}

Result<robot::RobotModel> with_corrections(robot::RobotModel robot, std::span<const AdoptedEffect> found) {
  Json file = robot::robot_to_json(robot);
  std::vector<AdoptedEffect> others;
  for (const AdoptedEffect& effect : found) {
    TRY_ASSIGN(const dynamics::ActiveEffect active, as_found(effect));
    if (const auto change = change_of(active, file)) {
      change_number(file[Json::json_pointer(change->pointer)], *change);
    } else {
      others.push_back(effect);
    }
  }
  TRY_ASSIGN(auto corrected, robot::parse_robot(file.dump()));
  return with_effects(std::move(corrected), others);
}

std::vector<FileCorrection> corrections_of(const robot::RobotModel& robot,
                                           std::span<const AdoptedEffect> found,
                                           std::span<const double> deviations) {
  const Json file = robot::robot_to_json(robot);
  std::vector<FileCorrection> corrections;
  for (std::size_t k = 0; k < found.size(); ++k) {
    const Result<dynamics::ActiveEffect> active = as_found(found[k]);
    if (!active) continue;
    const auto change = change_of(*active, file);
    if (!change) {
      const auto had = std::ranges::find(robot.effects, found[k].id, &AdoptedEffect::id);
      const auto in_file = had == robot.effects.end() ? std::nullopt : std::optional(as_found(*had));
      const auto parameters = active->effect->info().parameters;
      std::size_t at = 0;  // of its strength, which has a value
      while (at + 1 < parameters.size() && active->values[at] == 0) ++at;
      const double before = in_file && *in_file ? (**in_file).values[at] : 0;
      corrections.push_back({fmt::format("effects.{}.{}", found[k].id, parameters[at].name), before,
                             before + active->values[at], deviations[k]});
      continue;
    }
    const double value = mean_of(file[Json::json_pointer(change->pointer)]);
    std::string name = change->pointer.substr(1);
    std::ranges::replace(name, '/', '.');
    if ((1 + change->times) * value + change->plus == value) continue;
    const bool scales = change->times != 0;
    corrections.push_back({std::move(name), value, (1 + change->times) * value + change->plus,
                           scales ? deviations[k] * std::fabs(value) : deviations[k]});
  }
  return corrections;
}

Offer offer_of(const Diagnosis& d) {
  Offer offer;
  for (const AdoptedEffect& effect : d.adoptable) {
    OfferedEffect& offered = offer.effects.emplace_back();
    offered.effect = effect;
    const auto diagnosed = std::ranges::find(d.effects, effect.id, &DiagnosedEffect::id);
    if (diagnosed == d.effects.end()) continue;
    for (const std::string& id : diagnosed->alternatives) {
      const auto known = std::ranges::find(diagnosed->instead, id, &AdoptedEffect::id);
      offered.instead.push_back(known == diagnosed->instead.end() ? AdoptedEffect{id, {}} : *known);
    }
  }
  offer.corrects_file = d.verdict == Verdict::not_this_robot;
  offer.refusal = d.refusal;
  return offer;
}

const Table<Offer>& offer_table() {
  static const auto effect = Table<AdoptedEffect>()
                                 .value("id", &AdoptedEffect::id, "effect of the catalogue")
                                 .map("parameters", &AdoptedEffect::parameters, "by name", true);
  static const auto offered =
      Table<OfferedEffect>()
          .include(effect, &OfferedEffect::effect)
          .list("instead", &OfferedEffect::instead,
                "alternatives that the data do not distinguish from it; without parameters: of unknown "
                "strength",
                effect);
  static const auto table =
      Table<Offer>()
          .text_or_null("refusal", &Offer::refusal, "reason against adoption; null: can be adopted")
          .value("corrects_file", &Offer::corrects_file,
                 "effects with a parameter in the robot file correct that parameter")
          .list("effects", &Offer::effects, "effects with the parameters to adopt", offered);
  return table;
}

Result<Offer> offer_from_json(const Json& diagnosis) {
  try {
    const Json& adoption = diagnosis.at("adoption");
    Offer offer;
    for (const Json& e : adoption.at("effects")) {
      OfferedEffect& offered = offer.effects.emplace_back(effect_from(e));
      for (const Json& other : e.at("instead")) offered.instead.push_back(effect_from(other));
    }
    offer.corrects_file = adoption.at("corrects_file").get<bool>();
    if (const Json& refusal = adoption.at("refusal"); refusal.is_string())
      offer.refusal = refusal.get<std::string>();
    return offer;
  } catch (const Json::exception&) {
    return fail(Fault::corrupt, "", "the diagnosis does not state what may be adopted");
  }
}

Result<robot::RobotModel> take(const Offer& offer, const robot::RobotModel& robot, const Choice& choice) {
  if (offer.effects.empty()) return fail(Fault::conflict, "", offer.refusal);
  if (!offer.refusal.empty() && !choice.force) return fail(Fault::conflict, "", offer.refusal);
  TRY_ASSIGN(const std::vector<AdoptedEffect> chosen, choose(offer, choice.effects));
  return offer.corrects_file ? with_corrections(robot, chosen) : with_effects(robot, chosen);
}

}  // namespace joulecast::gap

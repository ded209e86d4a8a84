#include "gap/verdict/offer.h"

#include <fmt/format.h>

#include <algorithm>
#include <nlohmann/json.hpp>
#include <set>

#include "base/try.h"
#include "gap/verdict/adopt.h"
#include "gap/verdict/words.h"

namespace joulecast::gap {
namespace {

using Json = nlohmann::json;
using described::Table;
using robot::AdoptedEffect;

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
    if (chosen.back().parameters.empty()) {
      return fail(Fault::conflict, "effect",
                  fmt::format("the diagnosis has no strength of {}: only {} can be adopted", chosen.back().id,
                              offered.effect.id));
    }
  }
  if (unused.empty()) return chosen;
  std::vector<std::string> known;
  for (const OfferedEffect& offered : offer.effects) {
    for (std::string& id : ids_of(offered)) known.push_back(std::move(id));
  }
  return invalid("effect",
                 fmt::format("{} is not among what was found: {}", *unused.begin(), enumerate(known)));
}

}  // namespace

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

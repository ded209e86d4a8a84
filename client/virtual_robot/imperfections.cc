#include "client/virtual_robot/imperfections.h"

#include <algorithm>
#include <cmath>
#include <sstream>

#include "base/nearest_word.h"

namespace joulecast::virtual_robot {
namespace {

constexpr auto table = std::to_array<EffectEntry>({
#define IMPERFECTION(name, unit, search_limit) \
  {#name, &Imperfections::name, unit, search_limit, std::string_view(#name).starts_with("x_")},
#include "client/virtual_robot/imperfections.def"
#undef IMPERFECTION
});

}  // namespace

std::span<const EffectEntry> all_effects() {
  return table;
}

Result<Imperfections> make_imperfections(const std::vector<EffectStrength>& effects) {
  Imperfections result;
  for (const auto& [id, strength] : effects) {
    const auto* entry = std::find_if(table.begin(), table.end(), [&](const auto& e) { return e.id == id; });
    if (entry == table.end())
      return invalid("--effect", id + " is not an effect; --list-effects lists them" +
                                     did_you_mean(id, table, &EffectEntry::id));
    if (!std::isfinite(strength) || std::abs(strength) > entry->search_limit) {
      std::ostringstream text;
      text << "the strength of " << id << " must be -" << entry->search_limit << " to "
           << entry->search_limit;
      if (entry->unit != "1") text << ' ' << entry->unit;
      return invalid("--effect", text.str());
    }
    result.*(entry->strength) = strength;
  }
  return result;
}

std::vector<EffectStrength> effects_of(const Imperfections& imperfections) {
  std::vector<EffectStrength> result;
  for (const auto& entry : table)
    if (imperfections.*(entry.strength) != 0) result.emplace_back(entry.id, imperfections.*(entry.strength));
  return result;
}

}  // namespace joulecast::virtual_robot

#include "gap/verdict/diagnosis.h"

#include <algorithm>

namespace joulecast::gap {

std::string_view name_of(PowerSource source) {
  constexpr std::array<std::string_view, 3> names{"battery", "motors", "none"};
  return names[static_cast<std::size_t>(source)];
}

std::string_view name_of(Verdict verdict) {
  constexpr std::array<std::string_view, 5> names{"none", "effects", "outside", "inconclusive",
                                                  "not_this_robot"};
  return names[static_cast<std::size_t>(verdict)];
}

bool Baseline::wins() const {
  constexpr double slight = 1.05, clear = 1.1;
  const double best = std::min(held_out, unchanged_model_held_out);
  return explanation_held_out > clear * best ||
         (explanation_held_out > slight * best && explanation_held_out - best > deviation);
}

}  // namespace joulecast::gap

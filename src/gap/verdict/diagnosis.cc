#include "gap/verdict/diagnosis.h"

#include <algorithm>

namespace joulecast::gap {

std::string_view name_of(PowerSource source) {
  return power_source_names[static_cast<std::size_t>(source)];
}

std::string_view name_of(Verdict verdict) {
  return verdict_names[static_cast<std::size_t>(verdict)];
}

std::string_view title_of(Verdict verdict) {
  return verdict_titles[static_cast<std::size_t>(verdict)];
}

bool Baseline::wins() const {
  constexpr double slight = 1.05, clear = 1.1;
  const double best = std::min(held_out, unchanged_model_held_out);
  return explanation_held_out > clear * best ||
         (explanation_held_out > slight * best && explanation_held_out - best > deviation);
}

}  // namespace joulecast::gap

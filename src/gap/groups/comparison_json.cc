#include <nlohmann/json.hpp>

#include "gap/groups/compare.h"
#include "gap/verdict/diagnosis_json.h"

namespace joulecast::gap {

nlohmann::ordered_json comparison_to_json(const Comparison& comparison) {
  using described::Table;
  using G = ComparedGroup;
  static const auto group =
      Table<G>()
          .value("name", &G::name, "of the group")
          .value("missions", &G::missions, "number of missions")
          .value("samples", &G::samples, "number of samples")
          .number_or_null("way_m", &G::way_m, "distance driven")
          .number_or_null("energy_per_m_j", &G::energy_per_m_j, "measured energy of a metre")
          .number_or_null("model_per_m_j", &G::model_per_m_j,
                          "the same by the model with the common effects");
  using S = GroupStrength;
  static const auto strength =
      Table<S>()
          .number_or_null("value", &S::value, "strength above that of the group where it is weakest")
          .number_or_null("sd", &S::deviation, "standard deviation of value")
          .number_or_null("energy_per_m_j", &S::energy_per_m_j, "energy of a metre by it");
  using E = ComparedEffect;
  static const auto effect = Table<E>()
                                 .value("id", &E::id, "effect of the catalogue, or covariate:<name>")
                                 .value("parameter", &E::parameter, "name of the strength")
                                 .value("unit", &E::unit, "SI; \"1\" for ratios")
                                 .map("groups", &E::groups, "by their names", &S::group, strength);
  using D = GroupDifference;
  static const auto difference =
      Table<D>()
          .value("from", &D::from, "group with the least energy of a metre")
          .value("to", &D::to, "group with the most")
          .number_or_null("energy_per_m_j", &D::energy_per_m_j,
                          "difference of the measured energy of a metre")
          .number_or_null("by_motion_j", &D::by_motion_j, "part of it by motion and payload")
          .map("by_effect_j", &D::by_effect_j, "parts by the effects", true)
          .number_or_null("unexplained_j", &D::unexplained_j, "the remainder");
  using C = Comparison;
  static const auto table =
      Table<C>("Comparison of groups of missions, as printed by `joulecast gap --compare-by --json`")
          .include(diagnosis_table(), &C::diagnosis)
          .value(
              "kind", [](const C&) { return "comparison"; }, "distinguishes it from other diagnoses")
          .list("groups", &C::groups, "the groups, one by one", group)
          .texts("common", &C::common, "effects that all groups have")
          .list("strengths", &C::effects, "effects whose strengths differ between groups", effect)
          .object("difference", &C::difference,
                  "between the groups that take least and most; null: no power was measured", difference)
          .texts("limits", &C::limits, "limits of the comparison, in sentences");
  return table.document(comparison);
}

}  // namespace joulecast::gap

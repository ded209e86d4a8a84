#include "gap/verdict/diagnosis_json.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <nlohmann/json.hpp>

#include "gap/traits.h"
#include "gap/verdict/adopt.h"
#include "gap/verdict/text.h"

namespace joulecast::gap {
namespace {

using described::Schema;
using described::Table;

constexpr const char* measured_channel = "channel of measurement, e.g. battery power";
constexpr const char* deviation_words = "standard deviation";

const Table<DiagnosedParameter>& value_table() {
  using P = DiagnosedParameter;
  static const auto table =
      Table<P>()
          .named("gap.value")
          .number_or_null("value", &P::value, "in unit; null: not determined")
          .number_or_null("sd", &P::deviation, "standard deviation; null: not estimated")
          .value("unit", &P::unit, "SI; \"1\" for ratios");
  return table;
}

double probability_of(const Check& check) {
  return std::isfinite(check.probability) ? check.probability : check.error;
}

// What to inspect for the effect and for each alternative; covariates have no row.
std::string workshop_of(const DiagnosedEffect& effect) {
  std::vector<std::string> ids = effect.alternatives;
  ids.insert(ids.begin(), effect.id);
  std::string text;
  for (const std::string& id : ids) {
    const auto row = std::ranges::find(traits_table, id, &Traits::id);
    if (row != traits_table.end() && !row->workshop.empty())
      text.append(text.empty() ? "" : "; ").append(row->workshop);
  }
  return text;
}

// Where nothing was added, before is after.
Shrinkage shrinkage_of(const Diagnosis& d) {
  if (d.shrinkage) return *d.shrinkage;
  const double gap = d.power_absolute_relative;
  return {.before = gap, .after = gap, .remaining_over_noise_floor = gap / d.noise_floor};
}

}  // namespace

const Table<Diagnosis>& diagnosis_table() {
  static const auto check_table =
      Table<Check>()
          .value("id", &Check::id,
                 "such as battery_current_reversed, wheel_velocity_scale, dead_channel, held_samples, "
                 "step_between_missions")
          .text_or_null("channel", &Check::channel,
                        "field of robot_telemetry_t, with its side; several are separated by commas")
          .number_or_null("value", &Check::value, "value of the check")
          .numbers("interval", &Check::interval, "of the value, 95 %")
          .value("says", &Check::says, "the finding, its likely cause and the expected input")
          .value("contradicted", &Check::contradicted, "the channel is not used in the diagnosis")
          .known("factor", &Check::factor,
                 "by which the channel is divided for the diagnosis: -1 for a reversed sign")
          .value("probability", probability_of,
                 "of a wrong sign, unit or side, against every other explanation; of a channel that is used "
                 "as it is, of any error of the readings")
          .only([](const Check& check) { return std::isfinite(probability_of(check)); })
          .known("first_mission", &Check::first_mission,
                 "of a step between missions: index of the first one after it")
          .integers("few_missions", &Check::few_missions,
                    "indices of the affected missions, if only few of several are affected")
          .only([](const Check& check) { return !check.few_missions.empty(); });
  using D = Diagnosis;
  static const auto size_table =
      Table<D>()
          .number_or_null("energy_relative", &D::energy_relative, "(measured - modelled) / measured energy")
          .number_or_null("power_absolute_relative", &D::power_absolute_relative,
                          "integral of |measured - modelled power| over that of |measured power|")
          .number_or_null("noise_floor", &D::noise_floor,
                          "part of it that an unstructured model cannot remove")
          .number_or_null("detectable_share", &D::detectable_share,
                          "smallest share of the power that an effect must change to be detectable in these "
                          "recordings")
          .later();
  using C = ChannelGap;
  static const auto channel_table =
      Table<C>()
          .number_or_null("absolute_relative", &C::absolute_relative,
                          "mean of |measured - modelled| over the mean of |measured|")
          .number_or_null("noise_floor", &C::noise_floor, "part of it that is due to noise");
  using E = DiagnosedEffect;
  static const auto effect_table =
      Table<E>()
          .value("id", &E::id, "effect of the catalogue, or covariate:<name>")
          .number_or_null("probability", &E::probability,
                          "probability that the effect is present, averaged over resampled blocks")
          .map("parameters", &E::parameters, "by name, the strength first", &DiagnosedParameter::name,
               value_table())
          .number_or_null("share", &E::share, "share of the gap that it closes")
          .texts("alternatives", &E::alternatives, "effects that these data do not distinguish from it")
          .number_or_null("group", &E::group,
                          "probability that it or one of its alternatives is present; absent from diagnoses "
                          "of earlier versions")
          .later()
          .number_or_null("power_w", &E::power_w, "mean |change of battery power|")
          .later()
          .number_or_null("varies", &E::varies,
                          "standard deviation of its strength along the recordings over the strength")
          .later()
          .text_or_null("calibrates", &E::calibrates,
                        "JSON pointer of the robot file's parameter that it corrects")
          .later()
          .text_or_null("workshop", workshop_of, "what to check on the robot")
          .later();
  using O = Outside;
  static const auto outside_table =
      Table<O>()
          .number_or_null("probability", &O::probability,
                          "probability of a deviation that no effect of the catalogue describes")
          .text_or_null("channel", &O::channel, measured_channel)
          .text_or_null("follows", &O::follows, "the variable on which it depends")
          .text_or_null("like", &O::like,
                        "effect of the same form as the deviation, which varies in strength")
          .later()
          .numbers(
              "power_w",
              [](const O& o) {
                return o.power_w[0] != o.power_w[1] ? std::optional(o.power_w) : std::nullopt;
              },
              "power of that form, at the beginning and at the end of a mission")
          .later()
          .text_or_null(
              "says", [](const O& o) { return o.channel.empty() ? std::string() : outside_words(o); },
              "the same in a sentence")
          .later();
  using S = Shrinkage;
  static const auto shrinkage_table =
      Table<S>()
          .number_or_null("held_out_before", &S::before,
                          "gap of the parts of the recordings that were not used to find the effects")
          .number_or_null("held_out_after", &S::after, "the same gap with the findings in the model")
          .number_or_null("fraction", &S::fraction, "1 - after / before")
          .numbers("ci", &S::interval, "of the fraction, 95 %")
          .number_or_null("remaining_over_noise_floor", &S::remaining_over_noise_floor,
                          "remaining gap relative to the noise floor")
          .value("parts", &S::parts, "number of parts that were left out, one after the other")
          .later();
  using T = BaselineTerm;
  static const auto term = Table<T>()
                               .number_or_null("value", &T::value, "of the term; null: not determined")
                               .number_or_null("sd", &T::deviation, deviation_words)
                               .value("unit", &T::unit, "of value")
                               .number_or_null("model", &T::model, "the robot file's value of the same term")
                               .number_or_null("explained", &T::explained, "the same with the effects found")
                               .later();
  using B = Baseline;
  static const auto baseline_table =
      Table<B>()
          .map("terms", &B::terms, "of the regression, by name", &T::name, term)
          .number_or_null("held_out", &B::held_out,
                          "mean |error| over mean |power| of the regression on held-out parts")
          .number_or_null("unchanged_model_held_out", &B::unchanged_model_held_out,
                          "the same of the robot file")
          .number_or_null("explanation_held_out", &B::explanation_held_out,
                          "the same of the effects estimated without each part, including the function "
                          "outside the catalogue if one is reported")
          .number_or_null("deviation", &B::deviation,
                          "standard error of the difference between the explanation and the better of the "
                          "other two")
          .value("wins", &B::wins,
                 "the regression or the robot file predicts better than the effects found, by more than a "
                 "tenth, or by more than a twentieth and one standard error")
          .texts("says", &B::says, "comparison of its terms with those of the model, in sentences");
  static const auto sum_table =
      Table<TermSum>()
          .texts("of", &TermSum::effects, "effects of this form, closest first")
          .value("terms", &TermSum::terms, "terms of the regression that show it")
          .number_or_null("value", &TermSum::difference_w, "measured minus modelled power at the mean motion")
          .number_or_null("sd", &TermSum::deviation_w, "standard deviation of value")
          .value(
              "unit", [](const TermSum&) { return "W"; }, "of value")
          .text_or_null("adopts_as", &TermSum::parameter,
                        "parameter of the robot file that could take all of it")
          .object(
              "fits",
              [](const TermSum& s) {
                return DiagnosedParameter{{}, s.unit, s.value, s.deviation};
              },
              "value of that parameter that takes it", value_table())
          .later();
  static const auto correction_table =
      Table<FileCorrection>()
          .value("parameter", &FileCorrection::parameter, "of the robot file, as motor.friction_torque_nm")
          .number_or_null("file", &FileCorrection::file, "value of the robot file")
          .number_or_null("fits", &FileCorrection::fits, "value that fits these recordings")
          .number_or_null("sd", &FileCorrection::deviation, deviation_words);
  using W = WhereRegion;
  const auto end = [](double W::*number) {
    return [number](const W& w) {
      return w.label.empty() ? std::variant<double, std::string>(w.*number) : w.label;
    };
  };
  static const Schema either{{"type", {"number", "string", "null"}}};
  static const auto where_table =
      Table<W>()
          .value("channel", &W::channel, measured_channel)
          .value("variable", &W::variable, "variable by which the channel is divided into regions")
          .value("from", end(&W::from), "a number, or the name of a phase or floor cell", either)
          .value("to", end(&W::to), "upper end of the range; text for a category", either)
          .number_or_null("share", &W::share,
                          "share of the gap, signed; positive: higher consumption than modelled")
          .numbers("ci", &W::interval, "of the share, 95 %, adjusted for the number of regions")
          .number_or_null("time_share", &W::time_share,
                          "share of the time in the region; with an evenly distributed gap equal to share")
          .later();
  using N = NextDrive;
  static const auto next_drive_table =
      Table<N>()
          .value("manoeuvre", &N::manoeuvre, "manoeuvre to drive")
          .value("separates", &N::separates, "the causes that it distinguishes")
          .number_or_null("expected_log_evidence", &N::expected_log_evidence,
                          "expected increase of the log evidence");
  static const auto table =
      Table<D>("Diagnosis of the gap between a robot and its model, as printed by `joulecast gap --json`")
          .value("robot_id", &D::robot_id, "the robot's id, as in its telemetry and its file")
          .value(
              "model_version", [](const D&) { return std::optional<std::int64_t>(); },
              "null outside a server")
          .elsewhere("since_utime_us", described::of_type("integer", true),
                     "start of the missions that were read; null: no limit")
          .value("missions", &D::missions, "number of recordings")
          .value("samples", &D::samples, "number of samples")
          .texts("notes", &D::notes, "missions joined or left out, messages that could not be read")
          .later()
          .value("motor_channels", &D::motor_channels,
                 "false: the diagnosis uses battery power and motion only")
          .later()
          .word("power", &D::power, power_source_names,
                "source of the power; motors: of both motors, without the base load")
          .later()
          .list("checks", &D::checks, "faults of the recordings, most fundamental first", check_table)
          .later()
          .object("gap", std::identity(), "difference between measurements and model", size_table)
          .map("channels", &D::channels,
               "the gap of each kind of reading: battery_power, motor_power, battery_voltage, yaw_rate",
               &ChannelGap::channel, channel_table)
          .later()
          .word("verdict", &D::verdict, verdict_names,
                "none: no gap beyond noise; effects: the reported effects explain the gap; outside: a "
                "deviation that no effect of the catalogue describes; not_this_robot: the file belongs to "
                "another robot")
          .word("verdict_title", &D::verdict, verdict_titles, "the verdict in words")
          .later()
          .number_or_null(
              "verdict_probability", &D::verdict_probability,
              "probability of the verdicts none, effects and outside, averaged over resampled blocks; of "
              "the other verdicts no probability of the verdict")
          .later()
          .texts("reasons", &D::reasons, "evidence against a stronger verdict")
          .later()
          .list("effects", &D::effects, "largest share first", effect_table)
          .object("outside", &D::outside, "deviation that no effect of the catalogue describes",
                  outside_table)
          .object("shrinkage", shrinkage_of, "reduction of the gap by the findings, on held-out parts",
                  shrinkage_table)
          .object("baseline", &D::baseline,
                  "a linear regression of power on motion, for comparison; null: no parts could be held out",
                  baseline_table)
          .later()
          .list("sums", &D::sums,
                "differences of power that are certain although several effects have their form", sum_table)
          .later()
          .list("corrections", &D::corrections, "verdict not_this_robot: a calibration proposal",
                correction_table)
          .later()
          .list("where", &D::where, "regions in which power departs from the model, worst first", where_table)
          .list("next_drive", &D::next_drive,
                "manoeuvres that distinguish causes which these recordings leave open", next_drive_table)
          .object("adoption", offer_of, "the proposed adoption and the obstacles to it", offer_table())
          .later()
          .object("figures", &D::figures, "data of the charts; absent: no power was recorded",
                  figures_table())
          .only([](const D& d) { return d.figures.mean_power_w > 0; })
          .elsewhere("diagnosis_id", described::of_type("integer"), "printed by `joulecast gap --server`")
          .elsewhere("adopted", described::of_type("object"),
                     "printed by `joulecast gap --server --adopt`: the result of the adoption")
          .elsewhere("back_test", described::of_type("object"), "printed by `joulecast gap --test`");
  return table;
}

described::Schemas diagnosis_schemas() {
  return {{"gap", diagnosis_table().schema()}, {"gap.value", value_table().schema()}};
}

nlohmann::ordered_json diagnosis_to_json(const Diagnosis& diagnosis) {
  return diagnosis_table().document(diagnosis);
}

}  // namespace joulecast::gap

#include <fmt/format.h>

#include <cmath>

#include "base/xml_text.h"
#include "dynamics/catalogue.h"
#include "gap/traits.h"
#include "gap/verdict/text.h"
#include "gap/verdict/words.h"
#include "report/quantity.h"
#include "report/sections.h"

namespace joulecast::report {

using namespace gap;

namespace {

constexpr double least_told = 0.01;  // of a strength; smaller drifts along the recordings are not reported

std::string paragraph(std::string_view text) {
  return fmt::format("<p>{}</p>", xml_escaped(text));
}

std::string quiet(std::string_view text) {
  return fmt::format("<p class=\"quiet\">{}</p>", xml_escaped(text));
}

std::string names_of(const std::vector<std::string>& ids) {
  std::vector<std::string> names;
  names.reserve(ids.size());
  for (const std::string& id : ids) names.push_back(words_of(id));
  return enumerate(names);
}

std::string meaning_of(const dynamics::Effect* effect, const DiagnosedParameter& p) {
  if (effect != nullptr) {
    for (const auto& info : effect->info().parameters) {
      if (info.name == p.name) return std::string(info.meaning);
    }
  }
  return words_of(p.name);
}

std::string strengths_of(const DiagnosedEffect& e, const dynamics::Effect* known) {
  std::string html;
  for (const DiagnosedParameter& p : e.parameters) {
    const std::string meaning = xml_escaped(meaning_of(known, p));
    const std::string value = xml_escaped(quantity(p.value, p.deviation, p.unit));
    if (&p == &e.parameters.front() || std::isfinite(p.deviation)) {
      html += fmt::format("<p class=\"strength\">{} <span class=\"quiet\">{}</span></p>", value, meaning);
    } else {
      html += fmt::format("<p class=\"quiet\">{}, a shape that was not estimated: {}</p>", meaning, value);
    }
  }
  return html;
}

std::string card_of(const DiagnosedEffect& e, double mean_power_w) {
  const dynamics::Effect* known = dynamics::find_effect(e.id);
  std::string card =
      fmt::format("<h3>{} <code>{}</code></h3>", xml_escaped(capital(words_of(e.id))), xml_escaped(e.id));
  card += strengths_of(e, known);
  std::string sure = "Probability " + chance_text(e.probability);
  if (!e.alternatives.empty()) sure += fmt::format(" ({} of it or an alternative)", chance_text(e.group));
  if (std::isfinite(e.share)) sure += fmt::format("; it closes {} of the gap", share_text(e.share));
  if (e.power_w > 0) {
    sure += fmt::format("; it moves {} W on average", brief(e.power_w));
    if (mean_power_w > 0) sure += fmt::format(", where the mean power is {} W", brief(mean_power_w));
  }
  card += paragraph(sure + '.');
  if (e.varies >= least_told)
    card += paragraph(
        fmt::format("Its strength varies along the recordings by {} of itself.", share_text(e.varies)));
  if (!e.alternatives.empty())
    card += fmt::format("<p><b>These data do not distinguish it from</b> {}.</p>",
                        xml_escaped(names_of(e.alternatives)));
  if (known == nullptr) return card;
  card += fmt::format("<p><b>To check in the workshop:</b> {}.</p>", xml_escaped(traits_of(e.id).workshop));
  if (!e.calibrates.empty())
    card +=
        fmt::format("<p>It would correct <code>{}</code> in the robot file.</p>", xml_escaped(e.calibrates));
  const dynamics::EffectInfo& info = known->info();
  return card + quiet(fmt::format("Formula: {}. Valid for: {}. Source: {}.", info.formula, info.validity,
                                  info.source));
}

void corrections_table(Page& page, std::span<const FileCorrection> corrections) {
  if (corrections.empty()) return;
  page.paragraph(
      "The robot file is not this robot's, or not as it ran here. These values would fit; take them as a "
      "proposal for a calibration.");
  std::vector<std::vector<std::string>> rows;
  for (const FileCorrection& c : corrections) {
    const std::string_view unit = degrees_of(unit_of(c.parameter)).empty() ? "" : unit_of(c.parameter);
    rows.push_back({fmt::format("<code>{}</code>", xml_escaped(c.parameter)),
                    xml_escaped(quantity(c.file, unit)), xml_escaped(quantity(c.fits, c.deviation, unit))});
  }
  const std::vector<std::string> header{"Parameter", "robot file", "would fit"};
  page.table(header, rows, 1);
}

}  // namespace

void effects_section(Page& page, std::span<const DiagnosedEffect> effects, double mean_power_w) {
  page.section(
      "Effects missing from the model",
      effects.empty() ? "" : "Each effect with its strength, one standard deviation, and how sure it is.");
  for (const DiagnosedEffect& e : effects) page.card(card_of(e, mean_power_w));
  if (effects.empty()) page.paragraph("No effect is named.");
}

void outside_card(Page& page, const Outside& o) {
  if (o.channel.empty() && o.like.empty()) {
    if (std::isfinite(o.probability)) {
      page.paragraph(fmt::format("Probability that something outside the catalogue is at work: {}.",
                                 chance_text(o.probability)));
    }
    return;
  }
  std::string card = fmt::format(
      "<h3>Outside the catalogue</h3>{}",
      paragraph(fmt::format(
          "Something is at work that no effect of the catalogue describes, with a probability of {}. {}",
          chance_text(o.probability), outside_words(o))));
  page.card(card);
}

void adoption_section(Page& page, const Diagnosis& d) {
  if (d.corrections.empty() && d.effects.empty() && d.adoptable.empty()) return;
  page.section("Effects for the robot file");
  corrections_table(page, d.corrections);
  if (!d.refusal.empty())
    page.card("<p><b>Not to be adopted as it stands.</b> " + xml_escaped(sentence(d.refusal)) + "</p>", true);
  if (d.adoptable.empty()) return;
  page.paragraph(d.refusal.empty() ? "These effects may be adopted into the robot file:"
                                   : "As a robot file would hold it:");
  std::vector<std::vector<std::string>> rows;
  for (const robot::AdoptedEffect& e : d.adoptable) {
    for (const auto& [name, value] : e.parameters) {
      rows.push_back({fmt::format("<code>{}</code>", xml_escaped(e.id)),
                      fmt::format("<code>{}</code>", xml_escaped(name)),
                      xml_escaped(quantity(value, degrees_of(unit_of(name)).empty() ? "" : unit_of(name)))});
    }
  }
  const std::vector<std::string> header{"Effect", "parameter", "value"};
  page.table(header, rows, 2);
}

}  // namespace joulecast::report

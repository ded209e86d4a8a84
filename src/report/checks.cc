#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "base/xml_text.h"
#include "gap/verdict/words.h"
#include "report/chart.h"
#include "report/quantity.h"
#include "report/sections.h"

namespace joulecast::report {

using namespace gap;

namespace {

std::string small_print(const Check& c) {
  std::string text = fmt::format("<code>{}</code>", xml_escaped(c.id));
  if (!c.channel.empty()) text += fmt::format(" in <code>{}</code>", xml_escaped(c.channel));
  if (std::isfinite(c.value)) text += ", value " + brief(c.value);
  if (std::isfinite(c.interval[0] + c.interval[1]) && c.interval[1] > c.interval[0])
    text += fmt::format(" [{}, {}]", brief(c.interval[0]), brief(c.interval[1]));
  return text;
}

std::vector<BarRow> error_rows(const Diagnosis& d) {
  std::vector<BarRow> rows;
  const auto add = [&](const char* label, double error, const char* style) {
    rows.push_back({label, "", 100 * error, {}, style, 100 * d.noise_floor, share_text(error)});
  };
  if (d.baseline) {
    add("model as it is", d.baseline->unchanged_model_held_out, "before");
    add("plain regression on motion", d.baseline->held_out, "floor");
    add("with the effects found", d.baseline->explanation_held_out, "after");
  } else {
    add("model as it is", d.shrinkage->before, "before");
    add("with the effects found", d.shrinkage->after, "after");
  }
  return rows;
}

std::string shrinkage_text(const Shrinkage& s) {
  std::string text = fmt::format(
      "On parts not used to find the effects the gap falls from {} to {}: by {}, 95 % interval by "
      "a bootstrap over blocks.",
      share_text(s.before), share_text(s.after), share_text(s.fraction, s.interval));
  if (s.interval[1] < 0) {
    text += " It grows: these effects are no explanation.";
  } else if (s.interval[0] < 0) {
    text += " The interval holds zero: that the effects help is not sure.";
  }
  if (std::isfinite(s.remaining_over_noise_floor))
    text += fmt::format(" What remains is {} times the noise floor.", brief(s.remaining_over_noise_floor, 2));
  return text;
}

void baseline_terms(Page& page, const Baseline& b, std::span<const std::string> told) {
  const bool models =
      std::ranges::any_of(b.terms, [](const BaselineTerm& t) { return std::isfinite(t.model); });
  const bool explained =
      std::ranges::any_of(b.terms, [](const BaselineTerm& t) { return std::isfinite(t.explained); });
  std::vector<std::vector<std::string>> rows;
  for (const BaselineTerm& t : b.terms) {
    rows.push_back({xml_escaped(words_of(t.name)), xml_escaped(quantity(t.value, t.deviation, t.unit))});
    if (models) rows.back().push_back(xml_escaped(quantity(t.model, t.unit)));
    if (explained) rows.back().push_back(xml_escaped(quantity(t.explained, t.unit)));
  }
  std::vector<std::string> header{"Term of the regression", "in the data"};
  if (models) header.emplace_back("in the model");
  if (explained) header.emplace_back("with the effects found");
  if (!rows.empty()) page.table(header, rows, 1);
  std::vector<std::string> says;
  for (const std::string& text : b.says) {
    if (std::ranges::find(told, text) == told.end()) says.push_back(text);
  }
  if (says.empty()) return;
  page.paragraph("Where the data and the model differ in these terms:");
  page.list(says);
}

}  // namespace

void checks_section(Page& page, std::span<const Check> checks) {
  if (checks.empty()) return;
  page.section("Checks of the recordings",
               "Checked before any effect: signs, units, scales, channels, motors, clock and the "
               "robot file. A contradicted channel is excluded from the diagnosis.");
  for (const Check& c : checks) {
    page.card(fmt::format("<p>{}</p><p class=\"quiet\">{}{}</p>", xml_escaped(c.says), small_print(c),
                          !c.contradicted          ? ""
                          : c.few_missions.empty() ? "; <b>excluded from the diagnosis</b>"
                                                   : "; <b>excluded from the diagnosis there</b>"),
              c.contradicted);
  }
}

void held_out_section(Page& page, const Diagnosis& d) {
  if (!d.baseline && !d.shrinkage) return;
  page.section("Comparison with a plain regression",
               "Mean absolute error over mean absolute power, on parts that were left out: effects, their "
               "shapes and the regression are estimated again without each part.");
  page.chart(bars(error_rows(d), "", "errors on parts left out"),
             std::isfinite(d.noise_floor)
                 ? fmt::format("The upright mark is the noise floor, {}: the error that "
                               "an unstructured model of the data cannot remove.",
                               share_text(d.noise_floor))
                 : std::string());
  if (d.baseline && d.baseline->wins()) {
    page.card(
        "<p><b>The explanation predicts the parts left out worse</b> than the better of the regression and "
        "the unchanged model. It does not stand.</p>",
        true);
  }
  if (d.shrinkage) page.paragraph(xml_escaped(shrinkage_text(*d.shrinkage)));
  if (d.effects.size() > 1) {
    std::vector<BarRow> shares;
    for (const DiagnosedEffect& e : d.effects) {
      shares.push_back({words_of(e.id), "", 100 * e.share, {}, "after"});
      shares.back().text = share_text(e.share);
    }
    page.chart(
        bars(shares, "", "share of the gap that each effect closes"),
        "What each effect takes off the gap, averaged over the orders of adding them (Shapley shares).");
  }
  if (d.baseline) baseline_terms(page, *d.baseline, d.reasons);
}

void channels_section(Page& page, std::span<const ChannelGap> channels) {
  std::vector<BarRow> rows;
  for (const ChannelGap& c : channels) {
    if (!std::isfinite(c.absolute_relative)) continue;
    rows.push_back({capital(words_of(c.channel)),
                    "",
                    100 * c.absolute_relative,
                    {},
                    "before",
                    100 * c.noise_floor,
                    share_text(c.absolute_relative)});
    if (std::isfinite(c.noise_floor))
      rows.back().text += fmt::format(" (noise {})", share_text(c.noise_floor));
  }
  if (rows.empty()) return;
  page.section("The gap of each kind of reading",
               "Mean absolute difference between readings and the model as it is, over the mean size of the "
               "reading. The upright mark is the noise floor.");
  page.chart(bars(rows, "", "gap of each kind of reading"));
}

}  // namespace joulecast::report

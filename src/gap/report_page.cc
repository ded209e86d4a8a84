#include "gap/report_page.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <iterator>

#include "base/xml_text.h"
#include "dynamics/catalogue.h"
#include "gap/chart.h"

namespace joulecast::gap {
namespace {

constexpr std::string_view style = R"(
:root{--page:#fbfaf8;--card:#fff;--text:#1d2125;--quiet:#5d666f;--rule:#dcdfe2;--measured:#1d2125;
--before:#c65d1c;--after:#1f6fae;--floor:#8a949e;--less:#1d8a83;--shade:#f1efeb}
@media(prefers-color-scheme:dark){:root{--page:#14171a;--card:#1b1f23;--text:#e7e9eb;--quiet:#9aa4ad;
--rule:#343a40;--measured:#f2f3f4;--before:#f0954f;--after:#62b0ee;--floor:#79838d;--less:#4cc2b9;--shade:#22272c}}
*{box-sizing:border-box}
body{margin:0;background:var(--page);color:var(--text);font:16px/1.55 system-ui,"DejaVu Sans",Helvetica,Arial,sans-serif}
main{max-width:880px;margin:0 auto;padding:40px 24px 64px}
.kicker{color:var(--quiet);font-size:14px;margin:0 0 6px}
h1{font-size:27px;line-height:1.25;margin:0 0 14px;letter-spacing:-.01em}
.verdict{font-size:18px;margin:0 0 26px}
h2{font-size:20px;margin:44px 0 6px;padding-top:18px;border-top:1px solid var(--rule)}
h3{font-size:16px;margin:0 0 2px}
p{margin:8px 0}
.quiet,figcaption{color:var(--quiet);font-size:14px}
.figures{display:flex;flex-wrap:wrap;gap:12px;margin:0 0 8px}
.figures div{flex:1 1 150px;background:var(--card);border:1px solid var(--rule);border-radius:6px;padding:12px 14px}
.figures b{display:block;font-size:23px;font-weight:600;font-variant-numeric:tabular-nums}
.figures span{color:var(--quiet);font-size:13px;line-height:1.3;display:block}
.card{background:var(--card);border:1px solid var(--rule);border-radius:6px;padding:14px 16px;margin:12px 0}
.strength{font-size:18px;font-variant-numeric:tabular-nums;margin:4px 0}
figure{margin:14px 0}
.grid2{display:grid;grid-template-columns:repeat(auto-fit,minmax(360px,1fr));gap:8px 20px}
svg{width:100%;height:auto;display:block}
svg text{font:12px system-ui,"DejaVu Sans",Helvetica,Arial,sans-serif;fill:var(--text)}
svg text.tick{fill:var(--quiet);font-size:11px}
svg text.axis{fill:var(--quiet)}
svg text.row{font-size:13px}
svg text.mid{text-anchor:middle}
svg text.end{text-anchor:end}
svg .grid{stroke:var(--rule);stroke-width:1}
svg .zero{stroke:var(--quiet);stroke-width:1.2}
svg .whisker{stroke:var(--quiet);stroke-width:1.4}
svg polyline{fill:none;stroke-width:1.5;stroke-linejoin:round}
svg polyline.measured{stroke:var(--measured);stroke-width:1.7}
svg polyline.before{stroke:var(--before)}
svg polyline.after{stroke:var(--after)}
svg rect.before,svg circle.before{fill:var(--before)}
svg rect.after,svg circle.after{fill:var(--after)}
svg rect.floor{fill:var(--floor)}
svg rect.more{fill:var(--before)}
svg rect.less{fill:var(--less)}
.legend{display:flex;flex-wrap:wrap;gap:4px 18px;font-size:13px;color:var(--quiet);margin:10px 0 0}
.legend i{display:inline-block;width:14px;height:10px;border-radius:2px;margin-right:6px}
i.measured{background:var(--measured)}i.before,i.more{background:var(--before)}i.after{background:var(--after)}
i.floor{background:var(--floor)}i.less{background:var(--less)}
.scroll{overflow-x:auto}
table{border-collapse:collapse;width:100%;font-size:14px;margin:10px 0}
th,td{text-align:left;padding:5px 10px 5px 0;border-bottom:1px solid var(--rule);vertical-align:top}
th{color:var(--quiet);font-weight:500}
td.n,th.n{text-align:right;font-variant-numeric:tabular-nums;white-space:nowrap}
td:last-child,th:last-child{padding-right:0}
ul{padding-left:20px;margin:8px 0}li{margin:5px 0}
code{font:13px ui-monospace,"DejaVu Sans Mono",monospace;background:var(--shade);padding:1px 4px;border-radius:3px}
@media print{main{max-width:none}h2{break-after:avoid}figure,.card{break-inside:avoid}}
)";

}  // namespace

Page::Page(std::string title, std::string kicker, std::string verdict) : title_(std::move(title)) {
  body_ = fmt::format("<p class=\"kicker\">{}</p><h1>{}</h1><p class=\"verdict\">{}</p>", xml_escaped(kicker),
                      xml_escaped(title_), xml_escaped(verdict));
}

void Page::figures(std::span<const Figure> figures) {
  body_ += "<div class=\"figures\">";
  for (const Figure& f : figures)
    body_ += fmt::format("<div><b>{}</b><span>{}</span></div>", xml_escaped(f.value), xml_escaped(f.label));
  body_ += "</div>";
}

void Page::section(std::string_view heading, std::string_view introduction) {
  if (open_) body_ += "</section>";
  open_ = true;
  body_ += fmt::format("<section><h2>{}</h2>", xml_escaped(heading));
  if (!introduction.empty()) body_ += fmt::format("<p class=\"quiet\">{}</p>", xml_escaped(introduction));
}

void Page::paragraph(std::string_view html) {
  body_ += fmt::format("<p>{}</p>", html);
}

void Page::card(std::string_view html) {
  body_ += fmt::format("<div class=\"card\">{}</div>", html);
}

void Page::chart(std::string_view svg, std::string_view caption) {
  body_ += fmt::format("<figure>{}", svg);
  if (!caption.empty()) body_ += fmt::format("<figcaption>{}</figcaption>", xml_escaped(caption));
  body_ += "</figure>";
}

void Page::charts(std::span<const std::pair<std::string, std::string>> svg_and_caption) {
  body_ += "<div class=\"grid2\">";
  for (const auto& [svg, caption] : svg_and_caption) chart(svg, caption);
  body_ += "</div>";
}

void Page::list(std::span<const std::string> items) {
  body_ += "<ul>";
  for (const std::string& item : items) body_ += fmt::format("<li>{}</li>", xml_escaped(item));
  body_ += "</ul>";
}

void Page::table(std::span<const std::string> header, std::span<const std::vector<std::string>> rows,
                 std::size_t first_number) {
  const auto number = [&](std::size_t column) { return column >= first_number ? " class=\"n\"" : ""; };
  body_ += "<div class=\"scroll\"><table><thead><tr>";
  for (std::size_t c = 0; c < header.size(); ++c)
    body_ += fmt::format("<th{}>{}</th>", number(c), xml_escaped(header[c]));
  body_ += "</tr></thead><tbody>";
  for (const auto& row : rows) {
    body_ += "<tr>";
    for (std::size_t c = 0; c < row.size(); ++c) body_ += fmt::format("<td{}>{}</td>", number(c), row[c]);
    body_ += "</tr>";
  }
  body_ += "</tbody></table></div>";
}

void Page::legend(std::span<const std::pair<std::string, std::string>> style_and_text) {
  body_ += "<p class=\"legend\">";
  for (const auto& [name, text] : style_and_text)
    body_ += fmt::format("<span><i class=\"{}\"></i>{}</span>", name, xml_escaped(text));
  body_ += "</p>";
}

std::string Page::str() const {
  return fmt::format(
      "<!doctype html>\n<html lang=\"en\"><head><meta charset=\"utf-8\"><meta name=\"viewport\" "
      "content=\"width=device-width,initial-scale=1\"><meta name=\"color-scheme\" content=\"light dark\">"
      "<title>{}</title><style>{}</style></head><body><main>{}{}</main></body></html>\n",
      xml_escaped(title_), style, body_, open_ ? "</section>" : "");
}

void effects_section(Page& page, std::span<const DiagnosedEffect> effects,
                     std::span<const std::string> costs) {
  page.section(
      "What is missing from the model",
      "Each effect with its strength, one standard deviation, and how sure it is that it is at work.");
  for (std::size_t k = 0; k < effects.size(); ++k) {
    const DiagnosedEffect& e = effects[k];
    const dynamics::Effect* known = dynamics::find_effect(e.id);
    std::string name = words_of(e.id);
    name.front() = static_cast<char>(std::toupper(static_cast<unsigned char>(name.front())));
    std::string card = fmt::format("<h3>{} <code>{}</code></h3>", xml_escaped(name), xml_escaped(e.id));
    for (const DiagnosedParameter& p : e.parameters) {
      std::string_view meaning = p.name;
      if (known != nullptr) {
        for (const auto& info : known->info().parameters) {
          if (info.name == p.name) meaning = info.meaning;
        }
      }
      if (&p == &e.parameters.front() || std::isfinite(p.deviation)) {
        card += fmt::format("<p class=\"strength\">{} <span class=\"quiet\">{}</span></p>",
                            xml_escaped(with_deviation(p.value, p.deviation, p.unit)), xml_escaped(meaning));
      } else {
        card += fmt::format("<p class=\"quiet\">{} (a shape, taken from a grid): {}</p>",
                            xml_escaped(meaning), xml_escaped(with_deviation(p.value, p.deviation, p.unit)));
      }
    }
    card += fmt::format("<p>Probability {}; it closes {} of the gap{}.</p>", probability_text(e.probability),
                        percent(e.share), k < costs.size() && !costs[k].empty() ? "; " + costs[k] : "");
    if (known != nullptr) {
      card += fmt::format("<p class=\"quiet\">Formula: {}. Valid for: {}. Source: {}.</p>",
                          xml_escaped(known->info().formula), xml_escaped(known->info().validity),
                          xml_escaped(known->info().source));
    }
    if (!e.alternatives.empty()) {
      std::vector<std::string> others;
      for (const std::string& id : e.alternatives) others.push_back(words_of(id));
      card += fmt::format("<p><b>These data do not tell it from</b> {}.</p>", xml_escaped(enumerate(others)));
    }
    page.card(card);
  }
  if (effects.empty()) page.paragraph("No effect of the catalogue is named.");
}

void origin_section(Page& page, const ReportOrigin& origin, const robot::RobotModel& robot) {
  page.section("Origin of the data");
  std::vector<std::string> lines;
  if (!origin.sources.empty()) lines.push_back("Read from: " + enumerate(origin.sources) + ".");
  std::string model = "Model: robot " + robot.robot_id;
  if (!origin.model.empty()) model += ", " + origin.model;
  std::vector<std::string> adopted;
  for (const robot::AdoptedEffect& e : robot.effects) adopted.push_back(words_of(e.id));
  lines.push_back(model + (adopted.empty() ? "; no effect was adopted before."
                                           : "; effects adopted before: " + enumerate(adopted) + "."));
  lines.push_back(fmt::format(
      "Mass {} kg without payload, wheel radius {} m, half track {} m, friction torque {} and {} N m (right, "
      "left), idle power {} W.",
      brief(robot.total_mass_kg(0)), brief(robot.kinematics.wheel_radius_m),
      brief(robot.kinematics.half_track_m), brief(robot.motor.friction_torque_nm[0]),
      brief(robot.motor.friction_torque_nm[1]), brief(robot.idle_power_w)));
  if (!origin.made_at.empty() || !origin.software.empty()) {
    lines.push_back("Report made" + (origin.made_at.empty() ? "" : " " + origin.made_at + " UTC") +
                    (origin.software.empty() ? "" : " by " + origin.software) + ".");
  }
  page.list(lines);
}

}  // namespace joulecast::gap

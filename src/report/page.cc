#include "report/page.h"

#include <fmt/format.h>

#include "base/xml_text.h"

namespace joulecast::report {
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
.card p:first-child{margin-top:0}.card p:last-child{margin-bottom:0}
.strength{font-size:18px;font-variant-numeric:tabular-nums;margin:4px 0}
figure{margin:14px 0}
.grid2{display:grid;grid-template-columns:repeat(auto-fit,minmax(min(100%,360px),1fr));gap:8px 20px}
svg{width:100%;height:auto;display:block}
svg.bars{max-width:460px}
.wide svg{min-width:640px}
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
svg rect.measured{fill:var(--measured)}
svg .mark{stroke:var(--text);stroke-width:2}
svg rect.more{fill:var(--before)}
svg rect.less{fill:var(--less)}
.legend{display:flex;flex-wrap:wrap;gap:4px 18px;font-size:13px;color:var(--quiet);margin:10px 0 0}
.legend i{display:inline-block;width:14px;height:10px;border-radius:2px;margin-right:6px}
i.measured{background:var(--measured)}i.before,i.more{background:var(--before)}i.after{background:var(--after)}
i.floor{background:var(--floor)}i.mark{background:var(--text);width:2px;height:12px;vertical-align:-2px}i.less{background:var(--less)}
.scroll,.wide{overflow-x:auto}
table{border-collapse:collapse;width:100%;font-size:14px;margin:10px 0}
table.many{min-width:540px}
th,td{text-align:left;padding:5px 10px 5px 0;border-bottom:1px solid var(--rule);vertical-align:top}
th{color:var(--quiet);font-weight:500}
td.n,th.n{text-align:right;font-variant-numeric:tabular-nums;white-space:nowrap}
td:last-child,th:last-child{padding-right:0}
ul{padding-left:20px;margin:8px 0}li{margin:5px 0}
code{font:13px ui-monospace,"DejaVu Sans Mono",monospace;background:var(--shade);padding:1px 4px;border-radius:3px}
.warn{border-left:4px solid var(--before)}
@media(max-width:480px){main{padding:24px 16px 40px}h1{font-size:23px}.verdict{font-size:16px}}
@media print{main{max-width:none;padding:0}h2{break-after:avoid}figure,.card,tr,li{break-inside:avoid}
.scroll,.wide{overflow:visible}.wide svg,table.many{min-width:0}}
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

void Page::card(std::string_view html, bool warns) {
  body_ += fmt::format("<div class=\"card{}\">{}</div>", warns ? " warn" : "", html);
}

void Page::chart(std::string_view svg, std::string_view caption) {
  body_ += fmt::format("<figure>{}", svg);
  if (!caption.empty()) body_ += fmt::format("<figcaption>{}</figcaption>", xml_escaped(caption));
  body_ += "</figure>";
}

void Page::wide_chart(std::string_view svg) {
  body_ += fmt::format("<figure class=\"wide\" tabindex=\"0\">{}</figure>", svg);
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
  body_ +=
      fmt::format("<div class=\"scroll\"><table{}><thead><tr>", header.size() > 3 ? " class=\"many\"" : "");
  for (std::size_t c = 0; c < header.size(); ++c)
    body_ += fmt::format("<th scope=\"col\"{}>{}</th>", number(c), xml_escaped(header[c]));
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

}  // namespace joulecast::report

#include "tests/study/exploration/svg.h"

#include <fmt/format.h>

#include <iterator>

namespace joulecast::report {
namespace {

// Two decimals of a pixel, without trailing zeros.
std::string px(double value) {
  std::string text = fmt::format("{:.2f}", value);
  text.erase(text.find_last_not_of('0') + 1);
  if (text.back() == '.') text.pop_back();
  return text == "-0" ? "0" : text;
}

// As content or attribute value; control characters that are not XML are left out.
std::string xml_escaped(std::string_view text) {
  std::string out;
  for (const char c : text) {
    switch (c) {
      case '&':
        out += "&amp;";
        break;
      case '<':
        out += "&lt;";
        break;
      case '>':
        out += "&gt;";
        break;
      case '"':
        out += "&quot;";
        break;
      default:
        if (static_cast<unsigned char>(c) >= 0x20 || c == '\n' || c == '\t') out += c;
    }
  }
  return out;
}

}  // namespace

Svg Svg::document(double width, double height, std::string_view title) {
  std::string head = fmt::format(
      "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{0}\" height=\"{1}\" viewBox=\"0 0 {0} {1}\" "
      "font-family=\"DejaVu Sans, Helvetica, Arial, sans-serif\">\n<title>{2}</title>\n",
      px(width), px(height), xml_escaped(title));
  Svg svg(std::move(head));
  svg.rect(0, 0, width, height, {.fill = "#fff"});
  return svg;
}

void Svg::attribute(std::string_view name, double pixels) {
  fmt::format_to(std::back_inserter(body_), " {}=\"{}\"", name, px(pixels));
}

void Svg::finish(const SvgStyle& style) {
  auto out = std::back_inserter(body_);
  fmt::format_to(out, " fill=\"{}\"", xml_escaped(style.fill));
  if (style.stroke != "none")
    fmt::format_to(out, " stroke=\"{}\" stroke-width=\"{}\" stroke-linejoin=\"round\"",
                   xml_escaped(style.stroke), px(style.width));
  if (!style.dash.empty()) fmt::format_to(out, " stroke-dasharray=\"{}\"", xml_escaped(style.dash));
  if (style.opacity < 1) attribute("opacity", style.opacity);
  body_ += "/>\n";
}

void Svg::points(std::string_view element, std::span<const SvgPoint> points, const SvgStyle& style) {
  fmt::format_to(std::back_inserter(body_), "<{} points=\"", element);
  for (std::size_t k = 0; k < points.size(); ++k)
    fmt::format_to(std::back_inserter(body_), "{}{},{}", k == 0 ? "" : " ", px(points[k].x), px(points[k].y));
  body_ += '"';
  finish(style);
}

void Svg::rect(double x, double y, double width, double height, const SvgStyle& s, double corner) {
  body_ += "<rect";
  attribute("x", x), attribute("y", y), attribute("width", width), attribute("height", height);
  if (corner > 0) attribute("rx", corner);
  finish(s);
}

void Svg::circle(SvgPoint c, double radius, const SvgStyle& s) {
  body_ += "<circle";
  attribute("cx", c.x), attribute("cy", c.y), attribute("r", radius);
  finish(s);
}

void Svg::line(SvgPoint from, SvgPoint to, const SvgStyle& s) {
  body_ += "<line";
  attribute("x1", from.x), attribute("y1", from.y), attribute("x2", to.x), attribute("y2", to.y);
  finish(s);
}

void Svg::polygon(std::span<const SvgPoint> p, const SvgStyle& s) {
  points("polygon", p, s);
}

void Svg::text(SvgPoint at, std::string_view words, const SvgText& s) {
  static constexpr std::string_view anchors[] = {"start", "middle", "end"};
  auto out = std::back_inserter(body_);
  body_ += "<text";
  attribute("x", at.x), attribute("y", at.y);
  fmt::format_to(out, " font-size=\"{}\" fill=\"{}\"", px(s.size), xml_escaped(s.fill));
  if (s.anchor != SvgAnchor::start)
    fmt::format_to(out, " text-anchor=\"{}\"", anchors[static_cast<std::size_t>(s.anchor)]);
  if (s.bold) body_ += " font-weight=\"bold\"";
  fmt::format_to(out, ">{}</text>\n", xml_escaped(words));
}

void Svg::begin_clip(double x, double y, double width, double height) {
  fmt::format_to(
      std::back_inserter(body_),
      "<clipPath id=\"clip{0}\"><rect x=\"{1}\" y=\"{2}\" width=\"{3}\" height=\"{4}\"/></clipPath>\n"
      "<g clip-path=\"url(#clip{0})\">\n",
      clips_++, px(x), px(y), px(width), px(height));
}

void Svg::end_clip() {
  body_ += "</g>\n";
}

std::string Svg::str() const {
  return body_ + "</svg>\n";
}

}  // namespace joulecast::report

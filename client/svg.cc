#include "client/svg.h"

#include <fmt/format.h>

#include <iterator>

#include "base/xml_text.h"

namespace joulecast::client {
namespace {

// Two decimals of a pixel, without trailing zeros.
std::string px(double value) {
  std::string text = fmt::format("{:.2f}", value);
  text.erase(text.find_last_not_of('0') + 1);
  if (text.back() == '.') text.pop_back();
  return text == "-0" ? "0" : text;
}

}  // namespace

Svg::Svg(double width, double height, std::string_view title) {
  body_ = fmt::format(
      "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{0}\" height=\"{1}\" viewBox=\"0 0 {0} {1}\" "
      "font-family=\"DejaVu Sans, Helvetica, Arial, sans-serif\">\n<title>{2}</title>\n"
      "<rect width=\"{0}\" height=\"{1}\" fill=\"#fff\"/>\n",
      px(width), px(height), xml_escaped(title));
}

void Svg::style(const SvgStyle& style) {
  auto out = std::back_inserter(body_);
  fmt::format_to(out, " fill=\"{}\"", xml_escaped(style.fill));
  if (style.stroke != "none")
    fmt::format_to(out, " stroke=\"{}\" stroke-width=\"{}\" stroke-linejoin=\"round\"",
                   xml_escaped(style.stroke), px(style.width));
  if (!style.dash.empty()) fmt::format_to(out, " stroke-dasharray=\"{}\"", xml_escaped(style.dash));
  if (style.opacity < 1) fmt::format_to(out, " opacity=\"{}\"", px(style.opacity));
  body_ += "/>\n";
}

void Svg::points(std::span<const SvgPoint> points) {
  for (std::size_t k = 0; k < points.size(); ++k)
    fmt::format_to(std::back_inserter(body_), "{}{},{}", k == 0 ? "" : " ", px(points[k].x), px(points[k].y));
  body_ += '"';
}

void Svg::rect(double x, double y, double width, double height, const SvgStyle& s, double corner) {
  fmt::format_to(std::back_inserter(body_), "<rect x=\"{}\" y=\"{}\" width=\"{}\" height=\"{}\"", px(x),
                 px(y), px(width), px(height));
  if (corner > 0) fmt::format_to(std::back_inserter(body_), " rx=\"{}\"", px(corner));
  style(s);
}

void Svg::circle(SvgPoint c, double radius, const SvgStyle& s) {
  fmt::format_to(std::back_inserter(body_), "<circle cx=\"{}\" cy=\"{}\" r=\"{}\"", px(c.x), px(c.y),
                 px(radius));
  style(s);
}

void Svg::line(SvgPoint from, SvgPoint to, const SvgStyle& s) {
  fmt::format_to(std::back_inserter(body_), "<line x1=\"{}\" y1=\"{}\" x2=\"{}\" y2=\"{}\"", px(from.x),
                 px(from.y), px(to.x), px(to.y));
  style(s);
}

void Svg::polyline(std::span<const SvgPoint> p, const SvgStyle& s) {
  body_ += "<polyline points=\"";
  points(p);
  style(s);
}

void Svg::polygon(std::span<const SvgPoint> p, const SvgStyle& s) {
  body_ += "<polygon points=\"";
  points(p);
  style(s);
}

void Svg::text(SvgPoint at, std::string_view words, const SvgText& s) {
  static constexpr std::string_view anchors[] = {"start", "middle", "end"};
  auto out = std::back_inserter(body_);
  fmt::format_to(out, "<text x=\"{}\" y=\"{}\" font-size=\"{}\" fill=\"{}\"", px(at.x), px(at.y), px(s.size),
                 xml_escaped(s.fill));
  if (s.anchor != SvgAnchor::start)
    fmt::format_to(out, " text-anchor=\"{}\"", anchors[static_cast<std::size_t>(s.anchor)]);
  if (s.bold) body_ += " font-weight=\"bold\"";
  if (!s.halo.empty())
    fmt::format_to(out, " stroke=\"{}\" stroke-width=\"3\" paint-order=\"stroke\"", xml_escaped(s.halo));
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

}  // namespace joulecast::client

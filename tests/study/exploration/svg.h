#pragma once

#include <span>
#include <string>
#include <string_view>

namespace joulecast::report {

// Style of a shape.
struct SvgStyle {
  std::string_view fill = "none";
  std::string_view stroke = "none";
  double width = 1;
  std::string_view dash = "";
  double opacity = 1;
};

struct SvgPoint {
  double x = 0;
  double y = 0;
};

enum class SvgAnchor { start, middle, end };

struct SvgText {
  double size = 12;
  std::string_view fill = "#222";
  SvgAnchor anchor = SvgAnchor::start;
  bool bold = false;
};

// Builds one SVG 1.1 picture; coordinates are pixels, y down. Every text is escaped.
class Svg {
 public:
  // A document of its own on white.
  static Svg document(double width, double height, std::string_view title);

  void rect(double x, double y, double width, double height, const SvgStyle& style, double corner = 0);
  void circle(SvgPoint center, double radius, const SvgStyle& style);
  void line(SvgPoint from, SvgPoint to, const SvgStyle& style);
  void polygon(std::span<const SvgPoint> points, const SvgStyle& style);
  void text(SvgPoint at, std::string_view words, const SvgText& style = {});
  // Elements until end_clip() are painted only inside the rectangle.
  void begin_clip(double x, double y, double width, double height);
  void end_clip();

  std::string str() const;

 private:
  explicit Svg(std::string head) : body_(std::move(head)) {}
  void attribute(std::string_view name, double pixels);
  void points(std::string_view element, std::span<const SvgPoint> points, const SvgStyle& style);
  void finish(const SvgStyle& style);

  std::string body_;
  int clips_ = 0;
};

}  // namespace joulecast::report

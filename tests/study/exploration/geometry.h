#pragma once

#include <cmath>
#include <vector>

#include "base/error.h"

namespace joulecast::exploration {

// A position on the map [m].
struct Point {
  double x_m = 0;
  double y_m = 0;

  friend bool operator==(const Point&, const Point&) = default;
};

inline Point operator+(Point a, Point b) {
  return {a.x_m + b.x_m, a.y_m + b.y_m};
}
inline Point operator-(Point a, Point b) {
  return {a.x_m - b.x_m, a.y_m - b.y_m};
}
inline Point operator*(double s, Point a) {
  return {s * a.x_m, s * a.y_m};
}
inline double dot(Point a, Point b) {
  return a.x_m * b.x_m + a.y_m * b.y_m;
}
inline double cross(Point a, Point b) {
  return a.x_m * b.y_m - a.y_m * b.x_m;
}
inline double length(Point a) {
  return std::hypot(a.x_m, a.y_m);
}
inline double distance_m(Point a, Point b) {
  return length(b - a);
}
inline double heading_rad(Point from, Point to) {
  return std::atan2(to.y_m - from.y_m, to.x_m - from.x_m);
}

// Touching is not entering: depth below which a point counts as on an outline [m]. Rounding of coordinates
// within a kilometre stays four orders below it.
inline constexpr double contact_m = 1e-9;

// A convex polygon, corners counter-clockwise.
class ConvexPolygon {
 public:
  // Takes the corners in either order. At least 3, all finite, every corner turning the same way and once
  // round; the error names the first corner that does not.
  static Result<ConvexPolygon> from_corners(std::vector<Point> corners);

  static ConvexPolygon square(Point center, double side_m);

  const std::vector<Point>& corners() const { return corners_; }

  // Deeper inside than contact_m.
  bool contains(Point p) const;

  // Whether the segment runs through the inside, not merely along or against the outline.
  bool blocks(Point from, Point to) const;

  // Every edge moved outwards by `radius_m`. A corner sharper than a right angle is cut off square at
  // `radius_m` from its tip, so that no new corner is farther than 1.42 radius from an old one. Holds every
  // point within `radius_m` of the polygon.
  ConvexPolygon grown(double radius_m) const;

 private:
  struct HalfPlane {
    Point outwards;   // unit
    double offset_m;  // inside: outwards . p <= offset
  };

  explicit ConvexPolygon(std::vector<Point> corners);

  std::vector<Point> corners_;
  std::vector<HalfPlane> edges_;  // edge k runs from corner k to k + 1
};

// Brings an angle into (-pi, pi].
double wrapped(double angle_rad);

}  // namespace joulecast::exploration

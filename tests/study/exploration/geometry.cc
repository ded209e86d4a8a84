#include "tests/study/exploration/geometry.h"

#include <algorithm>
#include <numbers>
#include <string>
#include <utility>

namespace joulecast::exploration {
namespace {

// Where two lines outwards . p = offset meet.
Point meeting(Point n1, double c1, Point n2, double c2) {
  const double d = cross(n1, n2);
  return {(c1 * n2.y_m - c2 * n1.y_m) / d, (n1.x_m * c2 - n2.x_m * c1) / d};
}

}  // namespace

ConvexPolygon::ConvexPolygon(std::vector<Point> corners) : corners_(std::move(corners)) {
  edges_.reserve(corners_.size());
  for (std::size_t k = 0; k < corners_.size(); ++k) {
    const Point along = corners_[(k + 1) % corners_.size()] - corners_[k];
    const double size = length(along);
    const Point outwards{along.y_m / size, -along.x_m / size};
    edges_.push_back({outwards, dot(outwards, corners_[k])});
  }
}

Result<ConvexPolygon> ConvexPolygon::from_corners(std::vector<Point> corners) {
  const std::size_t n = corners.size();
  if (n < 3) return invalid("", "has " + std::to_string(n) + " corners, must have at least 3");
  for (std::size_t k = 0; k < n; ++k) {
    if (!std::isfinite(corners[k].x_m) || !std::isfinite(corners[k].y_m))
      return invalid("", "corner " + std::to_string(k) + " is not finite");
    if (distance_m(corners[k], corners[(k + 1) % n]) <= contact_m)
      return invalid("", "corner " + std::to_string(k) + " and the next are the same point");
  }
  double area = 0;
  for (std::size_t k = 0; k < n; ++k) area += cross(corners[k], corners[(k + 1) % n]);
  if (area < 0) std::reverse(corners.begin(), corners.end());
  double turned = 0;
  for (std::size_t k = 0; k < n; ++k) {
    const Point before = corners[(k + 1) % n] - corners[k];
    const Point after = corners[(k + 2) % n] - corners[(k + 1) % n];
    const double turn = std::atan2(cross(before, after), dot(before, after));
    if (!(turn > 1e-6 && turn < std::numbers::pi - 1e-6)) {
      const Point at = corners[(k + 1) % n];
      return invalid("", "must be convex: it does not turn outwards at (" + std::to_string(at.x_m) + ", " +
                             std::to_string(at.y_m) + "); give convex parts as separate obstacles");
    }
    turned += turn;
  }
  if (turned > 3 * std::numbers::pi) return invalid("", "must be convex: its outline crosses itself");
  return ConvexPolygon(std::move(corners));
}

ConvexPolygon ConvexPolygon::square(Point c, double side_m) {
  const double h = side_m / 2;
  return ConvexPolygon({c + Point{-h, -h}, c + Point{h, -h}, c + Point{h, h}, c + Point{-h, h}});
}

bool ConvexPolygon::contains(Point p) const {
  return std::all_of(edges_.begin(), edges_.end(),
                     [&](const HalfPlane& e) { return dot(e.outwards, p) < e.offset_m - contact_m; });
}

bool ConvexPolygon::blocks(Point from, Point to) const {
  // Clips the segment against each edge, pulled in by contact_m (Cyrus-Beck).
  const Point along = to - from;
  double enter = 0, leave = 1;
  for (const HalfPlane& e : edges_) {
    const double room = e.offset_m - contact_m - dot(e.outwards, from);
    const double approach = dot(e.outwards, along);
    if (approach == 0) {
      if (room <= 0) return false;
    } else if (approach > 0) {
      leave = std::min(leave, room / approach);
    } else {
      enter = std::max(enter, room / approach);
    }
    if (enter >= leave) return false;
  }
  return true;
}

ConvexPolygon ConvexPolygon::grown(double radius_m) const {
  std::vector<HalfPlane> planes;
  for (std::size_t k = 0; k < edges_.size(); ++k) {
    const HalfPlane& edge = edges_[k];
    const HalfPlane& next = edges_[(k + 1) % edges_.size()];
    planes.push_back({edge.outwards, edge.offset_m + radius_m});
    if (dot(edge.outwards, next.outwards) < -contact_m) {
      const Point sum = edge.outwards + next.outwards;
      // The sum vanishes as the corner becomes a needle; its tip then points along the edge.
      const double size = length(sum);
      const Point tip = size > 1e-6 ? (1 / size) * sum : Point{-edge.outwards.y_m, edge.outwards.x_m};
      planes.push_back({tip, dot(tip, corners_[(k + 1) % corners_.size()]) + radius_m});
    }
  }
  std::vector<Point> corners;
  for (std::size_t k = 0; k < planes.size(); ++k) {
    const HalfPlane& a = planes[k];
    const HalfPlane& b = planes[(k + 1) % planes.size()];
    corners.push_back(meeting(a.outwards, a.offset_m, b.outwards, b.offset_m));
  }
  return ConvexPolygon(std::move(corners));
}

double wrapped(double angle_rad) {
  const double w = std::remainder(angle_rad, 2 * std::numbers::pi);
  return w <= -std::numbers::pi ? w + 2 * std::numbers::pi : w;
}

}  // namespace joulecast::exploration

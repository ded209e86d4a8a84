#include "planning/path.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <string>

#include "base/try.h"
#include "planning/numerics.h"

namespace joulecast::planning {
namespace {

constexpr double aligned_rad = 1e-3;           // tangents closer than this need no turn
constexpr double largest_curvature_1_m = 1e4;  // sharper is a cusp
constexpr std::size_t most_knots = 2'000'000;

double wrapped(double angle) {
  return std::remainder(angle, 2 * std::numbers::pi);
}

// A plane curve by its parameter in [0, 1]: position, first and second derivative.
struct Jet {
  Point at, first, second;
};

Jet bezier_jet(Point p0, const Bezier& b, double u) {
  const double w = 1 - u;
  const auto mix = [&](double a0, double a1, double a2, double a3, double& at, double& first,
                       double& second) {
    at = w * w * w * a0 + 3 * w * w * u * a1 + 3 * w * u * u * a2 + u * u * u * a3;
    first = 3 * (w * w * (a1 - a0) + 2 * w * u * (a2 - a1) + u * u * (a3 - a2));
    second = 6 * (w * (a2 - 2 * a1 + a0) + u * (a3 - 2 * a2 + a1));
  };
  Jet j;
  mix(p0.x_m, b.control_1.x_m, b.control_2.x_m, b.end.x_m, j.at.x_m, j.first.x_m, j.second.x_m);
  mix(p0.y_m, b.control_1.y_m, b.control_2.y_m, b.end.y_m, j.at.y_m, j.first.y_m, j.second.y_m);
  return j;
}

Jet gaussian_jet(const Pose& from, const GaussianDetour& g, double u) {
  const double x = u * g.length_m, d = (x - g.centre_m) / g.width_m, y = g.amplitude_m * std::exp(-d * d / 2);
  const double slope = -y * d / g.width_m, bend = y * (d * d - 1) / (g.width_m * g.width_m);
  const double y0 = g.amplitude_m * std::exp(-g.centre_m * g.centre_m / (2 * g.width_m * g.width_m));
  const double c = std::cos(from.heading_rad), s = std::sin(from.heading_rad), l = g.length_m;
  return {{from.x_m + c * x - s * (y - y0), from.y_m + s * x + c * (y - y0)},
          {l * (c - s * slope), l * (s + c * slope)},
          {l * l * -s * bend, l * l * c * bend}};
}

// Builds runs segment by segment.
class Builder {
 public:
  explicit Builder(const PathOptions& options)
      : options_(options), pose_(options.start), payload_(options.payload_kg) {}

  Result<void> add(const Segment& segment) {
    return std::visit([this](const auto& s) { return add(s); }, segment);
  }

  Path finish() {
    close();
    path_.dwell_after_s = dwell_;
    path_.final_payload_kg = payload_;
    return std::move(path_);
  }

  std::size_t knots() const { return knots_; }

 private:
  static Result<void> positive(const char* field, double value) {
    if (std::isfinite(value) && value > 0) return {};
    return invalid(field, "is " + std::to_string(value) + ", must be positive and finite");
  }
  static Result<void> finite(const char* field, double value) {
    if (std::isfinite(value)) return {};
    return invalid(field, "must be finite");
  }

  Result<void> add(const Straight& s) {
    TRY(positive("length_m", s.length_m));
    return add(Clothoid{s.length_m, 0, 0});
  }

  Result<void> add(const Arc& a) {
    TRY(positive("radius_m", a.radius_m));
    if (!(std::isfinite(a.angle_rad) && a.angle_rad != 0))
      return invalid("angle_rad", "must be finite and not zero");
    const double curvature = std::copysign(1 / a.radius_m, a.angle_rad);
    return add(Clothoid{a.radius_m * std::fabs(a.angle_rad), curvature, curvature});
  }

  Result<void> add(const Clothoid& c) {
    TRY(positive("length_m", c.length_m));
    return add(SampledCurvature{{0, c.length_m}, {c.start_curvature_1_m, c.end_curvature_1_m}});
  }

  Result<void> add(const SampledCurvature& c) {
    if (c.way_m.size() < 2 || c.way_m.size() != c.curvature_1_m.size()) {
      return invalid("way_m", "needs at least 2 samples, as many as curvature_1_m");
    }
    if (c.way_m.front() != 0) return invalid("way_m", "must begin at 0");
    for (std::size_t k = 0; k < c.way_m.size(); ++k) {
      if (!(std::fabs(c.curvature_1_m[k]) <= largest_curvature_1_m)) {
        return invalid("curvature_1_m", "must be finite and at most 10000");
      }
      if (k > 0 && !(std::isfinite(c.way_m[k]) && c.way_m[k] > c.way_m[k - 1])) {
        return invalid("way_m", "must be finite and ascend");
      }
    }
    std::vector<Knot> piece;
    piece.push_back({0, c.curvature_1_m[0], pose_});
    for (std::size_t k = 1; k < c.way_m.size(); ++k) {
      const double from = c.way_m[k - 1], length = c.way_m[k] - from;
      const double k0 = c.curvature_1_m[k - 1], k1 = c.curvature_1_m[k];
      // The pose is linear between knots: curved pieces are cut, straight ones are not. Where the curvature
      // stays, only the pose needs knots, and fewer do (a chord of 5 cm at 1 m radius leaves the arc by 0.3
      // mm).
      const bool straight = k0 == 0 && k1 == 0;
      const double spacing = k0 == k1 ? 5 * options_.resolution_m : options_.resolution_m;
      const double cuts = straight ? 1 : std::max(1.0, std::ceil(length / spacing - 1e-9));
      TRY(room(cuts));
      const auto count = static_cast<std::size_t>(cuts);
      for (std::size_t i = 1; i <= count; ++i) {
        const double a = length * static_cast<double>(i - 1) / cuts,
                     b = length * static_cast<double>(i) / cuts;
        advance(k0 + (k1 - k0) * a / length, k0 + (k1 - k0) * b / length, b - a);
        piece.push_back({from + b, k0 + (k1 - k0) * b / length, pose_});
      }
    }
    append(std::move(piece));
    return {};
  }

  Result<void> add(const TurnInPlace& t) {
    if (!std::isfinite(t.angle_rad)) return invalid("angle_rad", "must be finite");
    turn(t.angle_rad);
    return {};
  }

  Result<void> add(const Polyline& p) {
    if (p.points.empty()) return invalid("points", "needs at least 1 point");
    for (const Point& to : p.points) {
      const double dx = to.x_m - pose_.x_m, dy = to.y_m - pose_.y_m, length = std::hypot(dx, dy);
      if (!std::isfinite(length)) return invalid("points", "must be finite");
      if (length < same_place_m) continue;
      align(std::atan2(dy, dx));
      TRY(add(Straight{length}));
      pose_.x_m = to.x_m, pose_.y_m = to.y_m;
    }
    if (p.heading_rad) {
      TRY(finite("heading_rad", *p.heading_rad));
      align(*p.heading_rad);
    }
    return {};
  }

  Result<void> add(const Bezier& b) {
    const Point from{pose_.x_m, pose_.y_m};
    for (double v :
         {b.control_1.x_m, b.control_1.y_m, b.control_2.x_m, b.control_2.y_m, b.end.x_m, b.end.y_m}) {
      TRY(finite("control points", v));
    }
    return curve("control_1", [&](double u) { return bezier_jet(from, b, u); });
  }

  Result<void> add(const GaussianDetour& g) {
    TRY(positive("length_m", g.length_m));
    TRY(positive("width_m", g.width_m));
    TRY(finite("amplitude_m", g.amplitude_m));
    TRY(finite("centre_m", g.centre_m));
    const Pose from = pose_;
    return curve("width_m", [&](double u) { return gaussian_jet(from, g, u); });
  }

  Result<void> add(const Dwell& d) {
    if (!(std::isfinite(d.duration_s) && d.duration_s >= 0))
      return invalid("duration_s", "must not be negative");
    close();
    dwell_ += d.duration_s;
    return {};
  }

  Result<void> add(const PayloadChange& l) {
    if (!(std::isfinite(l.payload_kg) && l.payload_kg >= 0))
      return invalid("payload_kg", "must not be negative");
    close();
    payload_ = l.payload_kg;
    return {};
  }

  // Knots at the resolution along a curve that is given by its parameter.
  template <class F>
  Result<void> curve(const char* field, F&& jet) {
    const auto speed = [&](double u) {
      const Jet j = jet(u);
      return std::hypot(j.first.x_m, j.first.y_m);
    };
    double length = 0;
    for (int k = 0; k < 256; ++k) length += speed((k + 0.5) / 256) / 256;
    if (!(length > 1e-9)) return invalid(field, "the curve has no length");
    const double cuts = std::max(8.0, std::ceil(length / options_.resolution_m));
    TRY(room(cuts));
    const auto count = static_cast<std::size_t>(cuts);

    std::vector<Knot> piece;
    piece.reserve(count + 1);
    double way = 0, heading = 0;
    for (std::size_t k = 0; k <= count; ++k) {
      const double u = static_cast<double>(k) / cuts;
      const Jet j = jet(u);
      const double pace = std::hypot(j.first.x_m, j.first.y_m);
      const double curvature =
          (j.first.x_m * j.second.y_m - j.first.y_m * j.second.x_m) / (pace * pace * pace);
      if (!(pace > 1e-9 * length) || !(std::fabs(curvature) <= largest_curvature_1_m)) {
        return invalid(field, "the curve has a cusp");
      }
      const double tangent = std::atan2(j.first.y_m, j.first.x_m);
      if (k == 0) {
        align(tangent);
        heading = pose_.heading_rad;
      } else {
        const double h = 1 / cuts;
        for (const auto& [at, weight] : gauss3) way += h * weight * speed(u - h + at * h);
        heading += wrapped(tangent - heading);
      }
      piece.push_back({way, curvature, {j.at.x_m, j.at.y_m, heading}});
    }
    pose_ = piece.back().pose;
    append(std::move(piece));
    return {};
  }

  Result<void> room(double knots) {
    if (static_cast<double>(knots_) + knots > static_cast<double>(most_knots)) {
      return fail(Fault::too_large, "", "the path needs more than 2000000 knots; divide it");
    }
    knots_ += static_cast<std::size_t>(knots);
    return {};
  }

  // Moves the pose along a piece of linear curvature: heading exactly, position by 3-point Gauss-Legendre.
  void advance(double k0, double k1, double length) {
    const auto heading = [&](double s) {
      return pose_.heading_rad + s * (k0 + (k1 - k0) * s / (2 * length));
    };
    double x = 0, y = 0;
    for (const auto& [at, weight] : gauss3) {
      const double h = heading(length * at);
      x += weight * std::cos(h), y += weight * std::sin(h);
    }
    const double end = heading(length);
    pose_ = {pose_.x_m + length * x, pose_.y_m + length * y, end};
  }

  void align(double tangent) {
    const double off = wrapped(tangent - pose_.heading_rad);
    if (std::fabs(off) > aligned_rad) turn(off);
  }

  void turn(double angle) {
    if (std::fabs(angle) < same_place_m) return;  // of a point one metre away
    close();
    Run run;
    run.turn = angle > 0 ? 1 : -1;
    run.payload_kg = payload_;
    run.dwell_before_s = std::exchange(dwell_, 0);
    Pose end = pose_;
    end.heading_rad += angle;
    run.knots = {{0, 0, pose_}, {std::fabs(angle), 0, end}};
    pose_ = end;
    path_.runs.push_back(std::move(run));
  }

  // Adds a piece to the run that is being driven: to its last side, or as a new side after a jump of
  // curvature.
  void append(std::vector<Knot> piece) {
    if (sides_.empty() ||
        std::fabs(piece.front().curvature_1_m - sides_.back().back().curvature_1_m) > 1e-9) {
      sides_.push_back(std::move(piece));
      return;
    }
    extend(sides_.back(), {piece.begin() + 1, piece.end()}, sides_.back().back().way);
  }

  static void extend(std::vector<Knot>& knots, std::vector<Knot> piece, double way) {
    for (Knot& k : piece) k.way += way;
    knots.insert(knots.end(), piece.begin(), piece.end());
  }

  // The run of all sides, with two clothoids over each jump of curvature, which turn as far as the removed
  // parts.
  std::vector<Knot> joined_sides() {
    std::vector<Knot> knots;
    double start = 0;
    for (std::size_t k = 0; k < sides_.size(); ++k) {
      std::vector<Knot>& side = sides_[k];
      const double length = side.back().way;
      if (k + 1 < sides_.size()) {
        std::vector<Knot>& next = sides_[k + 1];
        const double half = 0.5 * std::min({options_.transition_m, 0.5 * length, 0.5 * next.back().way});
        Knot middle = next.front();
        cut(side, length - half, true);
        cut(next, half, false);
        const Knot &a = side.back(), &b = next.front();
        middle.way = length;
        middle.curvature_1_m =
            (b.pose.heading_rad - a.pose.heading_rad) / half - 0.5 * (a.curvature_1_m + b.curvature_1_m);
        middle.pose.heading_rad = a.pose.heading_rad + 0.5 * half * (a.curvature_1_m + middle.curvature_1_m);
        side.push_back(middle);
      }
      extend(knots, std::move(side), start);
      start += length;
    }
    sides_.clear();
    return knots;
  }

  // Ends (`keep_front`) or begins the knots at `way`.
  static void cut(std::vector<Knot>& knots, double way, bool keep_front) {
    Run whole;
    whole.knots = knots;
    const Knot edge = whole.at(way);
    if (keep_front) {
      while (!knots.empty() && knots.back().way >= way - 1e-12) knots.pop_back();
      knots.push_back(edge);
    } else {
      const auto beyond =
          std::find_if(knots.begin(), knots.end(), [&](const Knot& k) { return k.way > way + 1e-12; });
      knots.erase(knots.begin(), beyond);
      knots.insert(knots.begin(), edge);
    }
  }

  void close() {
    if (sides_.empty()) return;
    Run run;
    run.knots = joined_sides();
    run.payload_kg = payload_;
    run.dwell_before_s = std::exchange(dwell_, 0);
    path_.runs.push_back(std::move(run));
  }

  const PathOptions& options_;
  Path path_;
  Pose pose_;
  double payload_;
  double dwell_ = 0;
  std::vector<std::vector<Knot>> sides_;  // of the run that is being driven, each without a jump of curvature
  std::size_t knots_ = 0;
};

}  // namespace

bool Run::constant_curvature() const {
  return std::all_of(knots.begin(), knots.end(), [&](const Knot& k) {
    return std::fabs(k.curvature_1_m - knots[0].curvature_1_m) < 1e-9;
  });
}

Place Run::at(double way) const {
  auto above = std::upper_bound(knots.begin() + 1, knots.end() - 1, way,
                                [](double w, const Knot& k) { return w < k.way; });
  auto near = static_cast<std::size_t>(above - knots.begin());
  return at(way, near);
}

Place Run::at(double way, std::size_t& near) const {
  while (near + 1 < knots.size() && knots[near].way <= way) ++near;
  while (near > 1 && knots[near - 1].way > way) --near;
  const Knot &b = knots[near], &a = knots[near - 1];
  const double f = std::clamp((way - a.way) / (b.way - a.way), 0.0, 1.0);
  const auto mix = [f](double p, double q) { return p + f * (q - p); };
  const double change = b.curvature_1_m - a.curvature_1_m;
  // The integral of the curvature bends the heading between its knots.
  const double bend = 0.5 * f * (f - 1) * change * (b.way - a.way);
  return {{way,
           mix(a.curvature_1_m, b.curvature_1_m),
           {mix(a.pose.x_m, b.pose.x_m), mix(a.pose.y_m, b.pose.y_m),
            mix(a.pose.heading_rad, b.pose.heading_rad) + bend}},
          change / (b.way - a.way)};
}

double Path::distance_m() const {
  double sum = 0;
  for (const Run& run : runs) sum += run.turn == 0 ? run.length() : 0;
  return sum;
}

double Path::turned_rad() const {
  double sum = 0;
  for (const Run& run : runs) {
    for (std::size_t k = 1; k < run.knots.size(); ++k) {
      sum += std::fabs(run.knots[k].pose.heading_rad - run.knots[k - 1].pose.heading_rad);
    }
  }
  return sum;
}

double Path::dwell_s() const {
  double sum = dwell_after_s;
  for (const Run& run : runs) sum += run.dwell_before_s;
  return sum;
}

Result<Path> make_path(std::span<const Segment> segments, const PathOptions& options) {
  if (!(options.resolution_m > 0)) return invalid("resolution_m", "must be positive");
  if (!(options.transition_m > 0)) return invalid("transition_m", "must be positive");
  if (!(std::isfinite(options.payload_kg) && options.payload_kg >= 0))
    return invalid("payload_kg", "must not be negative");
  if (segments.empty()) return invalid("/segments", "needs at least 1 segment");
  Builder builder(options);
  for (std::size_t k = 0; k < segments.size(); ++k) {
    if (auto added = builder.add(segments[k]); !added) {
      Error error = std::move(added.error());
      error.field = "/segments/" + std::to_string(k) + (error.field.empty() ? "" : "/" + error.field);
      return tl::unexpected(std::move(error));
    }
  }
  return builder.finish();
}

PlannedLeg planned_leg(std::shared_ptr<const Run> run) {
  PlannedLeg leg{run->turn != 0 ? Motion::turn : Motion::drive, run->length(), 0, run->payload_kg, 0, run};
  if (run->turn != 0) return leg;
  double turned = 0;
  for (std::size_t k = 1; k < run->knots.size(); ++k) {
    turned += 0.5 * (run->knots[k - 1].curvature_1_m + run->knots[k].curvature_1_m) *
              (run->knots[k].way - run->knots[k - 1].way);
  }
  leg.curvature_1_m = std::fabs(turned) / leg.way;
  return leg;
}

std::vector<PlannedLeg> planned_legs(const Path& path) {
  std::vector<PlannedLeg> legs;
  legs.reserve(2 * path.runs.size());
  for (const Run& run : path.runs) {
    if (run.dwell_before_s > 0) legs.push_back({Motion::stand, 0, 0, run.payload_kg, run.dwell_before_s});
    legs.push_back(planned_leg(std::make_shared<const Run>(run)));
  }
  if (path.dwell_after_s > 0)
    legs.push_back({Motion::stand, 0, 0, path.final_payload_kg, path.dwell_after_s});
  return legs;
}

}  // namespace joulecast::planning

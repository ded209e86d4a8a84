#pragma once

#include <cstddef>
#include <memory>
#include <optional>
#include <span>
#include <variant>
#include <vector>

#include "base/error.h"

namespace joulecast::planning {

struct Point {
  double x_m = 0, y_m = 0;
};

struct Pose {
  double x_m = 0, y_m = 0, heading_rad = 0;
};

// The elements of a path. Curves given by points of the map begin where the robot is; where their first
// tangent departs from its heading, it stops and turns in place. Angles and curvatures are positive to the
// left.
struct Straight {
  double length_m = 0;
};
struct TurnInPlace {
  double angle_rad = 0;
};
struct Arc {
  double radius_m = 0;  // > 0
  double angle_rad = 0;
};
struct Polyline {  // straight legs with turns in place between them
  std::vector<Point> points;
  std::optional<double> heading_rad = {};  // to which the robot turns at the end
};
// A point closer than this to where the robot is needs no motion.
inline constexpr double same_place_m = 1e-6;
struct Bezier {  // cubic; the first control point is where the robot is
  Point control_1, control_2, end;
};
// y = a exp(-(x - f)^2/(2 h^2)), thesis (2-48), x along the robot's heading from 0 to `length_m`.
struct GaussianDetour {
  double length_m = 0;
  double amplitude_m = 0;
  double centre_m = 0;
  double width_m = 0;
};
struct Clothoid {  // curvature linear in the way travelled
  double length_m = 0;
  double start_curvature_1_m = 0, end_curvature_1_m = 0;
};
struct SampledCurvature {  // linear between samples; `way_m` ascends from 0
  std::vector<double> way_m;
  std::vector<double> curvature_1_m;
};
struct Dwell {  // standing still
  double duration_s = 0;
};
struct PayloadChange {  // the payload from here on; the robot stands while it changes
  double payload_kg = 0;
};

using Segment = std::variant<Straight, TurnInPlace, Arc, Polyline, Bezier, GaussianDetour, Clothoid,
                             SampledCurvature, Dwell, PayloadChange>;

struct Knot {
  double way = 0;  // along the run
  double curvature_1_m = 0;
  Pose pose;
};

// Anywhere on a run: what its knots give there, and how the curvature changes along the way.
struct Place : Knot {
  double curvature_slope = 0;  // 1/m^2
};

// A segment driven without a stop: from rest to rest except at the ends of the whole path. Its coordinate is
// the way of the axle's middle [m], or the angle turned [rad, > 0] when the robot turns in place.
struct Run {
  int turn = 0;  // +1 or -1: turning in place to the left or right; 0: driving
  // At least 2, ascending; curvature and position are linear in between, the heading turns with the
  // curvature.
  std::vector<Knot> knots;
  double payload_kg = 0;
  double dwell_before_s = 0;

  double length() const { return knots.back().way; }
  bool constant_curvature() const;
  bool straight() const { return constant_curvature() && knots[0].curvature_1_m == 0; }
  Place at(double way) const;
  // The same, searched for from the knot `near`, which is then the one after it.
  Place at(double way, std::size_t& near) const;
};

struct Path {
  std::vector<Run> runs;
  double dwell_after_s = 0;
  double final_payload_kg = 0;

  double distance_m() const;  // driven
  double turned_rad() const;  // heading travelled, in place and on curves
  double dwell_s() const;
};

struct PathOptions {
  Pose start;
  double payload_kg = 0;
  double resolution_m = 0.01;  // spacing of knots on curves of varying curvature
  // A jump of curvature cannot be driven at speed. It is replaced by two clothoids with this length together,
  // or with half the length of the shorter side of the jump, which turn as far as the replaced pieces; the
  // way deviates by at most jump * length^2 / 24.
  double transition_m = 0.2;
};

// Kinds of motion that cost differently: standing, driving (straight or on curves), turning in place.
enum class Motion { stand, drive, turn };
inline constexpr std::size_t motion_count = 3;

// A segment of a planned task, from stop to stop.
struct PlannedLeg {
  Motion motion = Motion::stand;
  double way = 0;            // m, rad; >= 0, turns unsigned; 0 when standing
  double curvature_1_m = 0;  // >= 0
  double payload_kg = 0;
  double duration_s = 0;                     // when standing
  std::shared_ptr<const Run> run = nullptr;  // of a path: its curvature, and where it is
};

// A run of varying curvature counts with the mean.
PlannedLeg planned_leg(std::shared_ptr<const Run> run);
// The segments of a planned path: dwells and runs.
std::vector<PlannedLeg> planned_legs(const Path& path);

// Errors name "/segments/<index>/<field>".
Result<Path> make_path(std::span<const Segment> segments, const PathOptions& options = {});

}  // namespace joulecast::planning

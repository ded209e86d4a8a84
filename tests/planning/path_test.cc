#include "planning/path.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <random>

namespace joulecast::planning {
namespace {

constexpr double pi = std::numbers::pi;

Path made_path(const std::vector<Segment>& segments, const PathOptions& options = {}) {
  auto path = make_path(segments, options);
  EXPECT_TRUE(path) << describe(path.error());
  return *path;
}

TEST(Path, ArcEndIsExact) {
  const Path path = made_path({Arc{2, pi / 2}});
  ASSERT_EQ(path.runs.size(), 1u);
  EXPECT_NEAR(path.distance_m(), pi, 1e-12);
  EXPECT_NEAR(path.turned_rad(), pi / 2, 1e-12);
  const Pose& end = path.runs[0].knots.back().pose;
  EXPECT_NEAR(end.x_m, 2, 1e-9);
  EXPECT_NEAR(end.y_m, 2, 1e-9);
  EXPECT_NEAR(end.heading_rad, pi / 2, 1e-12);
  EXPECT_TRUE(path.runs[0].constant_curvature());
}

TEST(Path, PolylineTurnsAtItsCorners) {
  const Path path = made_path({Polyline{{{3, 0}, {3, 4}, {0, 4}}}});
  ASSERT_EQ(path.runs.size(), 5u);  // drive, turn, drive, turn, drive
  EXPECT_EQ(path.runs[1].turn, 1);
  EXPECT_NEAR(path.runs[1].length(), pi / 2, 1e-12);
  EXPECT_NEAR(path.distance_m(), 10, 1e-12);
  EXPECT_NEAR(path.turned_rad(), pi, 1e-12);
}

// A turn across +-pi takes the short way round.
TEST(Path, TurnsShortWayAcrossPi) {
  PathOptions options;
  options.start.heading_rad = 3.0;
  const Path path = made_path({Polyline{{{std::cos(-3.0), std::sin(-3.0)}}}}, options);
  ASSERT_EQ(path.runs.size(), 2u);
  EXPECT_EQ(path.runs[0].turn, 1);
  EXPECT_NEAR(path.runs[0].length(), 2 * pi - 6, 1e-12);
}

TEST(Path, BezierKeepsLengthAndTurn) {
  const Bezier bezier{{4, 0}, {4, 6}, {8, 6}};
  const Path path = made_path({bezier});
  ASSERT_EQ(path.runs.size(), 1u);
  // An independent quadrature: chords of 2 million points.
  double length = 0, x0 = 0, y0 = 0;
  for (int k = 1; k <= 200000; ++k) {
    const double u = k / 200000.0, w = 1 - u;
    const double x = 3 * w * w * u * 4 + 3 * w * u * u * 4 + u * u * u * 8,
                 y = 3 * w * u * u * 6 + u * u * u * 6;
    length += std::hypot(x - x0, y - y0);
    x0 = x, y0 = y;
  }
  EXPECT_NEAR(path.distance_m(), length, 1e-6);
  const planning::Run& run = path.runs[0];
  // The curvature integrates to the change of heading: the trapezoid rule at 1 cm.
  double turned = 0;
  for (std::size_t k = 1; k < run.knots.size(); ++k) {
    turned += 0.5 * (run.knots[k].way - run.knots[k - 1].way) *
              (run.knots[k].curvature_1_m + run.knots[k - 1].curvature_1_m);
    EXPECT_NEAR(turned, run.knots[k].pose.heading_rad, 1e-4);
  }
}

TEST(Path, GaussianDetourPassesItsPeak) {
  const Path path = made_path({GaussianDetour{8, 0.7, 4, 0.9}});
  const planning::Run& run = path.runs.back();
  double peak = 0;
  for (const Knot& k : run.knots) peak = std::max(peak, k.pose.y_m);
  EXPECT_NEAR(peak, 0.7 * (1 - std::exp(-16 / (2 * 0.81))), 1e-4);
  EXPECT_NEAR(run.knots.back().pose.x_m, 8, 1e-9);
}

TEST(Path, CurvatureJumpsBecomeClothoids) {
  PathOptions options;
  options.transition_m = 0.2;
  const Path path = made_path({Straight{3}, Arc{1, 1}, Straight{2}}, options);
  ASSERT_EQ(path.runs.size(), 1u);
  const planning::Run& run = path.runs[0];
  EXPECT_NEAR(run.length(), 6, 1e-12);
  EXPECT_NEAR(run.at(2.9).curvature_1_m, 0, 1e-9);
  EXPECT_NEAR(run.at(3.0).curvature_1_m, 0.5, 1e-9);
  EXPECT_NEAR(run.at(3.1).curvature_1_m, 1, 1e-9);
  EXPECT_NEAR(run.at(4.0).curvature_1_m, 0.5, 1e-9);
  // The whole turn stays.
  double turned = 0;
  for (std::size_t k = 1; k < run.knots.size(); ++k) {
    turned += 0.5 * (run.knots[k].way - run.knots[k - 1].way) *
              (run.knots[k].curvature_1_m + run.knots[k - 1].curvature_1_m);
  }
  EXPECT_NEAR(turned, 1, 1e-9);
}

// Of straights, arcs and clothoids of any curvature one after the other, also where these are shorter than
// their transitions.
TEST(Path, HeadingsIntegrateCurvature) {
  std::mt19937_64 random(3);
  const auto between = [&](double a, double b) { return std::uniform_real_distribution(a, b)(random); };
  for (int k = 0; k < 40; ++k) {
    std::vector<Segment> segments;
    for (int i = 0; i < 14; ++i) {
      if ((i + k) % 3 == 0) segments.push_back(Straight{between(0.05, 2)});
      if ((i + k) % 3 == 1) segments.push_back(Arc{between(0.2, 3), between(-2, 2)});
      if ((i + k) % 3 == 2) segments.push_back(Clothoid{between(0.1, 2), between(-4, 4), between(-4, 4)});
    }
    const auto path = make_path(segments);
    ASSERT_TRUE(path) << describe(path.error());
    for (const planning::Run& run : path->runs) {
      double heading = run.knots.front().pose.heading_rad;
      for (std::size_t i = 1; i < run.knots.size(); ++i) {
        const Knot &a = run.knots[i - 1], &b = run.knots[i];
        const double half = 0.5 * (b.way - a.way), middle = run.at(a.way + half).curvature_1_m;
        EXPECT_NEAR(run.at(a.way + half).pose.heading_rad, heading + 0.5 * half * (a.curvature_1_m + middle),
                    1e-6);
        heading += half * (a.curvature_1_m + b.curvature_1_m);
        EXPECT_NEAR(b.pose.heading_rad, heading, 1e-6);
      }
    }
  }
}

// An arc and a straight, each stated in one piece or in three: the same curvature at every place.
TEST(Path, SplitPiecesKeepTransitions) {
  const auto whole = made_path({Arc{3, 0.5}, Straight{5}}).runs.at(0);
  const auto parts =
      made_path({Arc{3, 0.4}, Arc{3, 0.08}, Arc{3, 0.02}, Straight{0.03}, Straight{0.07}, Straight{4.9}})
          .runs.at(0);
  for (double way = 0; way < whole.length(); way += 0.003) {
    EXPECT_NEAR(parts.at(way).curvature_1_m, whole.at(way).curvature_1_m, 1e-9) << "at " << way;
  }
  EXPECT_NEAR(parts.length(), whole.length(), 1e-12);
}

TEST(Path, DwellsAndPayloadsStop) {
  const Path path = made_path({Dwell{2}, Straight{1}, PayloadChange{15}, Dwell{5}, Straight{2}, Dwell{1}},
                              PathOptions{.start = {}, .payload_kg = 3});
  ASSERT_EQ(path.runs.size(), 2u);
  EXPECT_EQ(path.runs[0].payload_kg, 3);
  EXPECT_EQ(path.runs[0].dwell_before_s, 2);
  EXPECT_EQ(path.runs[1].payload_kg, 15);
  EXPECT_EQ(path.runs[1].dwell_before_s, 5);
  EXPECT_EQ(path.dwell_after_s, 1);
  EXPECT_EQ(path.dwell_s(), 8);
}

TEST(Path, NamesTheInvalidField) {
  const auto error = [](std::vector<Segment> segments) { return make_path(segments).error(); };
  EXPECT_EQ(error({}).field, "/segments");
  EXPECT_EQ(error({Straight{1}, Straight{-1}}).field, "/segments/1/length_m");
  EXPECT_EQ(error({Arc{0, 1}}).field, "/segments/0/radius_m");
  EXPECT_EQ(error({Arc{1, 0}}).field, "/segments/0/angle_rad");
  EXPECT_EQ(error({Polyline{}}).field, "/segments/0/points");
  EXPECT_EQ(error({SampledCurvature{{0, 1, 1}, {0, 0, 0}}}).field, "/segments/0/way_m");
  EXPECT_EQ(error({SampledCurvature{{0, 1}, {0, std::nan("")}}}).field, "/segments/0/curvature_1_m");
  EXPECT_EQ(error({Dwell{-1}}).field, "/segments/0/duration_s");
  EXPECT_EQ(error({PayloadChange{-1}}).field, "/segments/0/payload_kg");
  EXPECT_EQ(error({Straight{std::nan("")}}).field, "/segments/0/length_m");
  EXPECT_EQ(error({Bezier{{0, 0}, {0, 0}, {0, 0}}}).fault, Fault::invalid);
  EXPECT_EQ(error({Clothoid{1e7, 0, 1}}).fault, Fault::too_large);
}

}  // namespace
}  // namespace joulecast::planning

#include "tests/study/exploration/geometry.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <limits>
#include <numbers>

#include "random_map.h"

namespace joulecast::exploration {
namespace {

// Signed distance from the line of each edge, computed from the corners alone; positive inside.
double depth(const ConvexPolygon& polygon, Point p) {
  double least = std::numeric_limits<double>::infinity();
  const auto& c = polygon.corners();
  for (std::size_t k = 0; k < c.size(); ++k) {
    const Point along = c[(k + 1) % c.size()] - c[k];
    least = std::min(least, cross(along, p - c[k]) / length(along));
  }
  return least;
}

double distance_to_outline(const ConvexPolygon& polygon, Point p) {
  double least = std::numeric_limits<double>::infinity();
  const auto& c = polygon.corners();
  for (std::size_t k = 0; k < c.size(); ++k) {
    const Point along = c[(k + 1) % c.size()] - c[k];
    const double t = std::clamp(dot(p - c[k], along) / dot(along, along), 0.0, 1.0);
    least = std::min(least, distance_m(p, c[k] + t * along));
  }
  return least;
}

TEST(ConvexPolygon, BlockingAgreesWithSampling) {
  std::mt19937_64 random(1);
  std::uniform_real_distribution<double> along(-4, 4);
  int blocked = 0, open = 0;
  for (int trial = 0; trial < 3000; ++trial) {
    const ConvexPolygon polygon = random_polygon(random, {0, 0}, 2);
    const Point from{along(random), along(random)}, to{along(random), along(random)};
    double deepest = -std::numeric_limits<double>::infinity();
    constexpr int samples = 2000;
    for (int k = 0; k <= samples; ++k)
      deepest = std::max(deepest, depth(polygon, from + (static_cast<double>(k) / samples) * (to - from)));
    // Depth changes by at most the distance: between samples it may rise by half a step.
    const double half_step = distance_m(from, to) / samples / 2;
    if (deepest > contact_m) {
      EXPECT_TRUE(polygon.blocks(from, to)) << trial;
      EXPECT_TRUE(polygon.blocks(to, from)) << trial;
      ++blocked;
    } else if (deepest < -half_step) {
      EXPECT_FALSE(polygon.blocks(from, to)) << trial;
      ++open;
    }
  }
  EXPECT_GT(blocked, 500);
  EXPECT_GT(open, 500);
}

TEST(ConvexPolygon, TouchingIsNotBlocking) {
  const ConvexPolygon square = ConvexPolygon::square({0, 0}, 2);
  EXPECT_FALSE(square.blocks({-3, 1}, {3, 1}));
  EXPECT_FALSE(square.blocks({-2, 0}, {0, 2}));
  EXPECT_FALSE(square.blocks({1, 1}, {1, -1}));
  EXPECT_TRUE(square.blocks({1, 1}, {-1, -1}));
  EXPECT_TRUE(square.blocks({0, 0}, {5, 0}));
  EXPECT_FALSE(square.contains({1, 0}));
  EXPECT_TRUE(square.contains({0.999, 0}));
}

TEST(ConvexPolygon, GrownCoversTheRadius) {
  std::mt19937_64 random(2);
  std::uniform_real_distribution<double> along(-5, 5);
  for (int trial = 0; trial < 200; ++trial) {
    const ConvexPolygon polygon = random_polygon(random, {0, 0}, 2);
    constexpr double radius = 0.7;
    const ConvexPolygon grown = polygon.grown(radius);
    for (int k = 0; k < 200; ++k) {
      const Point p{along(random), along(random)};
      const bool inside = depth(polygon, p) > 0;
      const double distance = inside ? 0 : distance_to_outline(polygon, p);
      if (distance < radius - 1e-6) {
        EXPECT_TRUE(grown.contains(p));
      }
      if (distance > radius * std::numbers::sqrt2 + 1e-6) {
        EXPECT_FALSE(grown.contains(p));
      }
    }
  }
}

TEST(ConvexPolygon, GrownSquareIsLargerSquare) {
  const auto corners = ConvexPolygon::square({15, 5}, 4).grown(1).corners();
  ASSERT_EQ(corners.size(), 4u);
  for (const Point& c : corners) {
    EXPECT_NEAR(std::fabs(c.x_m - 15), 3, 1e-12);
    EXPECT_NEAR(std::fabs(c.y_m - 5), 3, 1e-12);
  }
}

TEST(ConvexPolygon, RejectsNonConvexCorners) {
  EXPECT_FALSE(ConvexPolygon::from_corners({{0, 0}, {1, 0}}));
  EXPECT_FALSE(ConvexPolygon::from_corners({{0, 0}, {1, 0}, {2, 0}}));
  EXPECT_FALSE(ConvexPolygon::from_corners({{0, 0}, {2, 0}, {0.5, 0.5}, {0, 2}}));
  EXPECT_FALSE(ConvexPolygon::from_corners({{0, 0}, {0, 0}, {1, 0}, {0, 1}}));
  EXPECT_FALSE(ConvexPolygon::from_corners({{0, 0}, {1, 0}, {0, std::nan("")}}));
  std::vector<Point> star;
  for (int k = 0; k < 5; ++k)
    star.push_back({std::cos(0.8 * k * std::numbers::pi), std::sin(0.8 * k * std::numbers::pi)});
  EXPECT_FALSE(ConvexPolygon::from_corners(star));
  const auto clockwise = ConvexPolygon::from_corners({{0, 0}, {0, 1}, {1, 1}, {1, 0}});
  ASSERT_TRUE(clockwise);
  EXPECT_TRUE(clockwise->contains({0.5, 0.5}));
}

TEST(Wrapped, KeepsDirectionAndRange) {
  using std::numbers::pi;
  EXPECT_DOUBLE_EQ(wrapped(-pi), pi);
  EXPECT_DOUBLE_EQ(wrapped(3 * pi), pi);
  for (double a = -20; a < 20; a += 0.37) {
    EXPECT_GT(wrapped(a), -pi);
    EXPECT_LE(wrapped(a), pi);
    EXPECT_NEAR(std::cos(wrapped(a)), std::cos(a), 1e-12);
    EXPECT_NEAR(std::sin(wrapped(a)), std::sin(a), 1e-12);
  }
}

}  // namespace
}  // namespace joulecast::exploration

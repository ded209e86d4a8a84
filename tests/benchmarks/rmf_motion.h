#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <vector>

// The peer: energy of a motion according to a scheduler without a drive model. Implements its equation,
//   dE = sum over samples 0.5 s apart of (m |a| |v| + J |alpha| |omega| + f m g |v|) * 0.5 s,
// over a trajectory of way points with velocities, joined by cubics.
namespace joulecast::benchmarks {

struct WayPoint {
  double time_s = 0;
  double position[3] = {};  // x m, y m, yaw rad as a map reports it, within (-pi, pi]
  double velocity[3] = {};
};

struct PeerRobot {
  double mass_kg = 0, inertia_kg_m2 = 0, friction = 0;
};

class PeerTrajectory {
 public:
  explicit PeerTrajectory(std::vector<WayPoint> points) {
    for (std::size_t k = 0; k + 1 < points.size(); ++k) {
      const WayPoint &a = points[k], &b = points[k + 1];
      Piece piece{a.time_s, b.time_s, {}};
      const double h = b.time_s - a.time_s;
      for (int i = 0; i < 3; ++i) {
        const double d = b.position[i] - a.position[i];
        piece.c[i][0] = a.position[i];
        piece.c[i][1] = a.velocity[i];
        piece.c[i][2] = (3 * d / h - 2 * a.velocity[i] - b.velocity[i]) / h;
        piece.c[i][3] = (a.velocity[i] + b.velocity[i] - 2 * d / h) / (h * h);
      }
      pieces_.push_back(piece);
    }
  }

  double energy_j(const PeerRobot& robot) const {
    constexpr double step_s = 0.5, gravity = 9.80665;
    double sum = 0;
    std::size_t k = 0;
    for (double t = pieces_.front().from; t <= pieces_.back().to; t += step_s) {
      while (k + 1 < pieces_.size() && t > pieces_[k].to) ++k;
      const double u = t - pieces_[k].from;
      double v[3], a[3];
      for (int i = 0; i < 3; ++i) {
        const double* c = pieces_[k].c[i];
        v[i] = c[1] + u * (2 * c[2] + 3 * c[3] * u);
        a[i] = 2 * c[2] + 6 * c[3] * u;
      }
      const double speed = std::hypot(v[0], v[1]), acceleration = std::hypot(a[0], a[1]);
      sum += (robot.mass_kg * acceleration * speed + robot.inertia_kg_m2 * std::fabs(a[2]) * std::fabs(v[2]) +
              robot.friction * robot.mass_kg * gravity * speed) *
             step_s;
    }
    return sum;
  }

 private:
  struct Piece {
    double from, to;
    double c[3][4];
  };
  std::vector<Piece> pieces_;
};

}  // namespace joulecast::benchmarks

#include "planning/baseline.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <vector>

#include "energy/motion_estimate.h"

namespace joulecast::planning {
namespace {

constexpr int points_per_span = 24;

// The ramp of one run as a motion; empty when it would have to run backwards.
std::vector<energy::MotionPoint> ramp(const Run& run, double duration_s, double start, double end,
                                      double ramp_fraction) {
  const double ramp_s = ramp_fraction * duration_s, hold_s = duration_s - 2 * ramp_s;
  const double peak = (run.length() - 0.5 * (start + end) * ramp_s) / (duration_s - ramp_s);
  if (!(peak > 0)) return {};
  struct Span {
    double duration_s, from, to;
  };
  std::vector<energy::MotionPoint> points;
  double time = 0, way = 0;
  for (const Span& span : {Span{ramp_s, start, peak}, Span{hold_s, peak, peak}, Span{ramp_s, peak, end}}) {
    if (!(span.duration_s > 0)) continue;
    for (int k = points.empty() ? 0 : 1; k <= points_per_span; ++k) {
      const double t = span.duration_s * k / points_per_span;
      const double speed = span.from + (span.to - span.from) * k / points_per_span;
      const double at = way + 0.5 * (span.from + speed) * t;
      if (run.turn != 0) {
        points.push_back({time + t, 0, run.turn * speed});
      } else {
        points.push_back({time + t, speed, speed * run.at(std::min(at, run.length())).curvature_1_m});
      }
    }
    time += span.duration_s;
    way += 0.5 * (span.from + span.to) * span.duration_s;
  }
  return points;
}

}  // namespace

Result<Baseline> ramp_baseline(const dynamics::DriveModel& model, const Path& path,
                               std::span<const double> run_duration_s, double start_speed_m_s,
                               double end_speed_m_s, double ramp_fraction) {
  Baseline baseline;
  const double standing_w = model.battery_power_for({0, 0});
  for (std::size_t k = 0; k < path.runs.size(); ++k) {
    const Run& run = path.runs[k];
    const double start = k == 0 ? start_speed_m_s : 0, end = k + 1 == path.runs.size() ? end_speed_m_s : 0;
    const auto points = ramp(run, run_duration_s[k], start, end, ramp_fraction);
    if (points.empty())
      return fail(Fault::infeasible, "/path", "is too short for such a ramp between its end speeds");
    const Pose& pose = run.knots.front().pose;
    const auto spent = energy::estimate_motion(model, points, run.payload_kg,
                                               energy::StartPose{pose.x_m, pose.y_m, pose.heading_rad});
    if (!spent) return tl::unexpected(spent.error());
    baseline.energy_j += spent->battery_j + standing_w * run.dwell_before_s;
    baseline.duration_s += run_duration_s[k] + run.dwell_before_s;
    for (const energy::MotionPoint& point : points)
      baseline.peak_speed_m_s = std::max(baseline.peak_speed_m_s, point.speed_m_s);
  }
  baseline.energy_j += standing_w * path.dwell_after_s;
  baseline.duration_s += path.dwell_after_s;
  return baseline;
}

}  // namespace joulecast::planning

#include "planning/baseline.h"

#include <algorithm>
#include <cmath>

#include "planning/numerics.h"

namespace joulecast::planning {
namespace {

// A run driven as a ramp, span by span of constant acceleration.
class Ramp {
 public:
  // Appends to the columns of `into` unless that is null; its time and energy are where the run begins.
  Ramp(const DriveLoads& loads, const Run& run, Baseline* into)
      : loads_(loads), model_(loads.model()), run_(run), uniform_(loads.uniform(run)), into_(into) {}

  void drive(double duration_s, double from, double to) {
    if (!(duration_s > 0)) return;
    if (loads_.scrubs()) {
      // In parts where scrub builds up.
      const WheelLoad here = loads_.at(run_, run_.at(std::min(way_, run_.length())))[0];
      if (here.parts(from, to) > 1) {
        const double risen = 5 * here.scrub_speed,
                     cut = std::max(from, to) > 2 * risen ? risen : 0.5 * (from + to),
                     share = (cut - from) / (to - from);
        drive(share * duration_s, from, cut);
        drive((1 - share) * duration_s, cut, to);
        return;
      }
    }
    const double acceleration = (to - from) / duration_s;
    integrate({duration_s, from, acceleration});
    driven_s_ += duration_s;
    way_ += 0.5 * (from + to) * duration_s;
    if (run_.turn == 0) peaks.peak_speed_m_s = std::max({peaks.peak_speed_m_s, from, to});
    const double rim = run_.turn == 0 ? 1 : model_.parameters().half_track_m;
    peaks.peak_acceleration_m_s2 = std::max(peaks.peak_acceleration_m_s2, rim * std::fabs(acceleration));
  }

  double energy_j = 0;
  Peaks peaks;  // of this run

 private:
  struct Span {
    double duration_s = 0, from = 0, acceleration = 0;
  };

  void write(const Span& span, double t) {
    const double speed = span.from + span.acceleration * t, watts = power_w(t, span.from, span.acceleration);
    if (into_ == nullptr) return;
    into_->time_s.push_back(into_->duration_s + driven_s_ + t);
    into_->speed_m_s.push_back(run_.turn == 0 ? speed : 0);
    into_->yaw_rate_rad_s.push_back(turn_ * speed);
    into_->power_w.push_back(watts);
    into_->energy_column_j.push_back(into_->energy_j + energy_j);
  }

  // Gauss's three points are exact where power is a polynomial in time, that is where it is constant along
  // the way and no motor becomes a generator. If halving the span changes the result, many small steps are
  // used.
  void integrate(const Span& span) {
    const double half = span.duration_s / 2;
    if (uniform_ && into_ == nullptr) {
      const double whole = gauss_j(span, 0, span.duration_s);
      const double halves = gauss_j(span, 0, half) + gauss_j(span, half, half);
      if (std::fabs(whole - halves) <= 1e-5 * std::fabs(halves)) {
        for (const double end : {0.0, span.duration_s})
          power_w(end, span.from, span.acceleration);  // for the peaks
        energy_j += halves;
        return;
      }
    }
    constexpr int steps = 24;
    const double step = span.duration_s / steps;
    write(span, 0);
    for (int k = 0; k < steps; ++k) {
      energy_j += gauss_j(span, k * step, step);
      write(span, (k + 1) * step);
    }
  }

  double gauss_j(const Span& span, double begin_s, double length_s) {
    double sum = 0;
    for (const auto& [at, weight] : gauss3)
      sum += weight * power_w(begin_s + at * length_s, span.from, span.acceleration);
    return length_s * sum;
  }

  double power_w(double t, double from, double acceleration) {
    const double speed = from + acceleration * t;
    const Place place = run_.at(std::clamp(way_ + (from + 0.5 * acceleration * t) * t, 0.0, run_.length()));
    turn_ = run_.turn != 0 ? run_.turn : place.curvature_1_m;
    const dynamics::Instant at = loads_.instant(run_, place, speed, acceleration);
    const auto flow = model_.flow(at);
    peaks.peak_yaw_rate_rad_s = std::max(peaks.peak_yaw_rate_rad_s, std::fabs(turn_) * speed);
    peaks.reach(at.wheel_speed_rad_s, flow);
    return flow.battery_power_w;
  }

  const DriveLoads& loads_;
  const dynamics::DriveModel& model_;
  const Run& run_;
  bool uniform_;
  Baseline* into_;
  double way_ = 0, driven_s_ = 0;
  double turn_ = 0;  // heading per unit of the run's coordinate, at the last evaluation of power
};

}  // namespace

Result<Baseline> ramp_baseline(const DriveLoads& loads, const Path& path,
                               std::span<const double> run_duration_s, double start_speed_m_s,
                               double end_speed_m_s, double ramp_fraction, bool columns) {
  Baseline baseline;
  const double standing_w = loads.model().battery_power_for({0, 0});
  const auto stand = [&](double duration_s) {
    if (!(duration_s > 0)) return;
    for (const bool end : {false, true}) {
      if (end) baseline.energy_j += standing_w * duration_s, baseline.duration_s += duration_s;
      if (!columns) continue;
      baseline.time_s.push_back(baseline.duration_s);
      baseline.speed_m_s.push_back(0), baseline.yaw_rate_rad_s.push_back(0);
      baseline.power_w.push_back(standing_w);
      baseline.energy_column_j.push_back(baseline.energy_j);
    }
  };
  for (std::size_t k = 0; k < path.runs.size(); ++k) {
    const Run& run = path.runs[k];
    const double start = k == 0 ? start_speed_m_s : 0, end = k + 1 == path.runs.size() ? end_speed_m_s : 0;
    const double ramp_s = ramp_fraction * run_duration_s[k], hold_s = run_duration_s[k] - 2 * ramp_s;
    const double top = (run.length() - 0.5 * (start + end) * ramp_s) / (run_duration_s[k] - ramp_s);
    if (!(top > 0))
      return fail(Fault::infeasible, "/path", "is too short for such a ramp between its end speeds");
    stand(run.dwell_before_s);
    Ramp ramp(loads, run, columns ? &baseline : nullptr);
    ramp.drive(ramp_s, start, top);
    ramp.drive(hold_s, top, top);
    ramp.drive(ramp_s, top, end);
    baseline.energy_j += ramp.energy_j;
    baseline.duration_s += run_duration_s[k];
    baseline.reach(ramp.peaks);
  }
  stand(path.dwell_after_s);
  return baseline;
}

}  // namespace joulecast::planning

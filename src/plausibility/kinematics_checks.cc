#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "plausibility/evaluation.h"

namespace joulecast::plausibility {
namespace {

// Reported only where the whole interval is beyond these bounds; the diagnosis estimates smaller deviations.
constexpr double track_ratio_off = 0.15, radius_off = 0.10, gain_off = 0.10, sides_off = 0.05,
                 slip_off = 0.10;
constexpr double drift_off_rad_s = 0.01;

bool beyond(const Estimate& e, double centre, double off) {
  if (!e.known()) return false;
  const auto interval = e.interval();
  return interval[0] > centre + off || interval[1] < centre - off;
}

// 1/e, by its linearisation.
Estimate inverse(const Estimate& e) {
  return {1 / e.value, e.sd / (e.value * e.value), e.freedom};
}

// The half track that the turning of the wheels implies, over the file's, by the gyro or else the map; and
// the relative difference of the sides' radii.
struct Turning {
  Estimate track, sides;
  const char* against = "the gyro";
  const char* channel = "yaw_rate";
};

Turning turning_of(const CheckContext& c) {
  Turning turning;
  if (!c.heard({0, 1})) return turning;
  BlockFit fit;
  if (c.heard({reading::yaw_rate})) fit = fit_blocks(c.blocks(Relation::gyro), 0, {1, 2, 3});
  Eigen::VectorXd difference{{1, -1, 0}}, sum{{1, 1, 0}};
  if (!fit.known() && c.heard({reading::heading})) {
    fit = fit_blocks(c.blocks(Relation::heading_wheels), 0, {2, 3});
    difference = Eigen::Vector2d(1, -1), sum = Eigen::Vector2d(1, 1);
    turning.against = "the map's heading";
    turning.channel = "pose.heading";
  }
  const Estimate turn = estimate(fit, difference);
  if (!turn.sure() || turn.value < 0) return turning;
  const double radius = c.robot.kinematics.wheel_radius_m;
  turning.track = inverse(turn * (c.robot.kinematics.half_track_m / radius));
  turning.sides = estimate(fit, sum) * (2 / turn.value);  // (r right - r left) / r
  return turning;
}

void check_track(const CheckContext& c, Checks& checks) {
  const Turning turning = turning_of(c);
  const double half_track = c.robot.kinematics.half_track_m;
  if (beyond(turning.track, 1, track_ratio_off)) {
    const double k = turning.track.value;
    checks.push_back(make_check(
        "track_against_gyro", turning.channel, turning.track,
        fmt::format(
            "Where {} turns by 1 rad the wheels turn by {:.3g} rad according to the file: half_track_m "
            "of {:.3g} m would have to "
            "be {} m, {:.3g} times as much{}.",
            turning.against, k, half_track,
            with_interval(k * half_track, {half_track * turning.track.interval()[0],
                                           half_track * turning.track.interval()[1]}),
            k, k > 1 ? "; skid-steered robots turn so" : "")));
  }
  if (beyond(turning.sides, 0, sides_off)) {
    checks.push_back(make_check(
        "sides_against_gyro", turning.channel, turning.sides,
        fmt::format("By {} the robot turns while both wheels turn alike: the right wheel moves it "
                    "{} of the radius more than the left one.",
                    turning.against, with_interval(turning.sides.value, turning.sides.interval()))));
  }
}

void check_travel(const CheckContext& c, Checks& checks) {
  if (!c.heard({0, 1, reading::x, reading::y})) return;
  const bool heading = c.heard({reading::heading});
  // The last term represents a late map.
  const BlockFit slip = heading ? fit_blocks(c.blocks(Relation::slip), 0, {1, 2, 3, 4}) : BlockFit{};
  const Estimate radius =
      slip.known() ? estimate(slip, 0) : estimate(fit_blocks(c.blocks(Relation::distance), 0, {1}), 0);
  const double file = c.robot.kinematics.wheel_radius_m;
  if (radius.sure() && beyond(radius, 1, radius_off)) {
    checks.push_back(make_check(
        "radius_against_pose", "pose", radius,
        fmt::format("The map moves {} times as far as the wheels report: wheel_radius_m of {:.3g} m "
                    "would have to be {:.3g} m, or the wheels slip.",
                    with_interval(radius.value, radius.interval()), file, radius.value * file)));
  }
  if (!slip.known() || !radius.sure()) return;
  constexpr std::array names{"turns", "braking"};
  for (const Eigen::Index k : {1, 2}) {
    const Estimate part = estimate(slip, k) * (1 / radius.value);
    if (!beyond(part, 0, slip_off)) continue;
    checks.push_back(make_check(
        k == 1 ? "slip_in_turns" : "slip_in_braking", "pose", part,
        fmt::format("In {} the map moves {} of the wheels' way {} than otherwise: the wheels slip.",
                    names[static_cast<std::size_t>(k - 1)], with_interval(std::fabs(part.value), {NAN, NAN}),
                    part.value < 0 ? "less" : "more")));
  }
}

void check_heading(const CheckContext& c, Checks& checks) {
  if (!c.heard({reading::yaw_rate, reading::heading})) return;
  const BlockFit fit = fit_blocks(c.blocks(Relation::heading_gyro), 0, {2, 3});
  const Estimate gain = estimate(fit, 0), drift = estimate(fit, 1);
  if (!gain.sure()) return;
  if (beyond(gain, 1, gain_off)) {
    checks.push_back(make_check("heading_against_gyro", "yaw_rate", gain,
                                fmt::format("The map's heading turns {} times as far as the gyro reports.",
                                            with_interval(gain.value, gain.interval()))));
  }
  if (beyond(drift, 0, drift_off_rad_s)) {
    checks.push_back(make_check("gyro_drift", "yaw_rate", drift * -1,
                                fmt::format("The gyro reads {} rad/s where the map's heading is constant.",
                                            with_interval(-drift.value, (drift * -1).interval()))));
  }
}

}  // namespace

void check_kinematics(const CheckContext& c, Checks& checks) {
  check_track(c, checks);
  check_travel(c, checks);
  check_heading(c, checks);
}

}  // namespace joulecast::plausibility

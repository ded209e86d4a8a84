#pragma once

#include <array>
#include <optional>
#include <span>

#include "base/error.h"
#include "dynamics/drive_model.h"
#include "signals/ledger.h"

namespace joulecast::energy {

// A motion to be priced: speeds and climb at times, linear in between, so that acceleration is constant over
// each span.
struct MotionPoint {
  double time_s = 0;
  double speed_m_s = 0;
  double yaw_rate_rad_s = 0;
  double climb_rad = dynamics::unknown;  // unknown at either end of a span: unknown over it
  // Above any fixed datum. Where both ends of a span have it, it counts before their climb: the floor rises
  // evenly over the way between them.
  double height_m = dynamics::unknown;
};

// The climb at both ends of the span between two points. Fault::invalid where the height changes by more than
// climb_over() allows for the way driven.
Result<std::array<double, 2>> climb_of_span(const MotionPoint& a, const MotionPoint& b);

// Where the motion begins; needed only for effects tied to the floor.
struct StartPose {
  double x_m = 0, y_m = 0, heading_rad = 0;
};

// Energy accounts of a motion through the drive model, by CVODE over each span (relative tolerance 1e-8): the
// energy that the meter would report for a robot that drove it. Nothing is measured: battery_j equals
// modelled_j and nothing is unexplained. Times must increase by 1e-9 s at least, except where a point repeats
// the speeds of the one before, as at a step of acceleration. There must be at least two points; a jump in
// speed is rejected, since it costs infinite power. Errors name "time_s", "time_s/<index>" or
// "height_m/<index>".
Result<signals::Accounts> estimate_motion(const dynamics::DriveModel& model,
                                          std::span<const MotionPoint> points, double payload_kg,
                                          const std::optional<StartPose>& start = std::nullopt);

}  // namespace joulecast::energy

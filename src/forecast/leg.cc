#include "forecast/leg.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace joulecast::forecast {
namespace {

// A trapezoid of cruise v, duration T and way d has integral of speed^2 Q = (4 d v - T v^2) / 3: a rectangle
// at v = d/T, a triangle at v = 2 d/T.
double cruise_of(double way, double square, double duration_s) {
  const double root = std::sqrt(std::max(0.0, 4 * way * way - 3 * duration_s * square));
  return (2 * way - root) / duration_s;
}

}  // namespace

double still_speed_m_s(const robot::RobotModel& robot) {
  return 0.01 * robot.limits.speed_m_s;
}

void LegTracker::Commanded::join(const Commanded& other) {
  way += other.way;
  duration_s += other.duration_s;
  peak = std::max(peak, other.peak);
}

void LegTracker::Piece::join(const Piece& other) {
  for (std::size_t k = 0; k < commanded.size(); ++k) commanded[k].join(other.commanded[k]);
  duration_s += other.duration_s;
  way_m += other.way_m;
  way_rad += other.way_rad;
  heading_rad += other.heading_rad;
  square_m2_s += other.square_m2_s;
  square_rad2_s += other.square_rad2_s;
  battery_j += other.battery_j;
}

void LegTracker::begin() {
  last_.reset();
  current_.reset();
  pending_.reset();
  slowed_.reset();
  peak_ = 0;
  legs_.clear();
}

LegTracker::Piece LegTracker::end_current() {
  if (slowed_) current_->join(*std::exchange(slowed_, std::nullopt));
  if (pending_) current_->join(*std::exchange(pending_, std::nullopt));
  close(*current_);
  peak_ = 0;
  return *std::exchange(current_, std::nullopt);
}

void LegTracker::go_on(const Piece& piece, double rim_m_s) {
  constexpr double stopped = 0.1, going = 0.2;  // of the leg's greatest speed
  if (slowed_ && rim_m_s > going * peak_) {
    close(*current_);
    current_ = std::exchange(slowed_, std::nullopt);
    peak_ = rim_m_s;
  }
  peak_ = std::max(peak_, rim_m_s);
  if (piece.motion != Motion::stand && rim_m_s < stopped * peak_ && (!slowed_ || rim_m_s < slowest_)) {
    if (slowed_) current_->join(*slowed_);
    current_->join(piece);
    slowed_ = Piece{piece.motion, 0, 0, 0, 0, 0, 0, piece.payload_kg, 0, {}};
    slowest_ = rim_m_s;
  } else {
    (slowed_ ? *slowed_ : *current_).join(piece);
  }
}

Motion LegTracker::motion_of(double speed_m_s, double yaw_rate_rad_s) const {
  const double rim_m_s = std::fabs(yaw_rate_rad_s) * half_track_m_;
  if (std::max(std::fabs(speed_m_s), rim_m_s) < still_m_s_) return Motion::stand;
  return std::fabs(speed_m_s) < 0.5 * rim_m_s ? Motion::turn : Motion::drive;
}

void LegTracker::add(const LegSample& sample) {
  const std::optional<LegSample> before = std::exchange(last_, sample);
  if (!before || !(sample.interval_s > 0)) return;
  const double h = sample.interval_s;
  const double speed = 0.5 * (before->speed_m_s + sample.speed_m_s);
  const double yaw = 0.5 * (before->yaw_rate_rad_s + sample.yaw_rate_rad_s);
  Piece piece;
  std::array<double, 2> command = before->command;  // in force until now
  piece.motion = motion_of(speed, yaw);
  // A leg begins with its command.
  if (piece.motion == Motion::stand && std::isfinite(command[0] + command[1]))
    piece.motion = motion_of(command[0], command[1]);
  piece.duration_s = h;
  piece.way_m = std::fabs(speed) * h;
  piece.way_rad = std::fabs(yaw) * h;
  piece.heading_rad = yaw * h;
  piece.square_m2_s = speed * speed * h;
  piece.square_rad2_s = yaw * yaw * h;
  piece.payload_kg = std::isfinite(sample.payload_kg) ? sample.payload_kg : 0;
  piece.battery_j = 0.5 * (before->power_w + sample.power_w) * h;
  // It is to turn or to drive, on a curve too; unknown ones remain so.
  command[std::fabs(command[0]) < 0.5 * half_track_m_ * std::fabs(command[1]) ? 0 : 1] *= 0;
  for (std::size_t k = 0; k < piece.commanded.size(); ++k) {
    const double size = std::fabs(command[k]);
    piece.commanded[k] = {size * h, size > 0 ? h : 0, size};
  }

  if (current_ && piece.payload_kg != current_->payload_kg) end_current();
  const double rim_m_s = std::fabs(speed) + half_track_m_ * std::fabs(yaw);
  if (!current_) {
    current_ = piece;
    peak_ = rim_m_s;
  } else if (piece.motion == current_->motion) {
    if (pending_) (slowed_ ? *slowed_ : *current_).join(*std::exchange(pending_, std::nullopt));
    go_on(piece, rim_m_s);
  } else {
    if (pending_ && pending_->motion == piece.motion) {
      pending_->join(piece);
    } else {
      if (pending_) (slowed_ ? *slowed_ : *current_).join(*pending_);
      pending_ = piece;
    }
    if (pending_->duration_s >= settle_s) {
      std::optional<Piece> next = std::exchange(pending_, std::nullopt);
      const Piece ended = end_current();
      // The command of the next leg precedes the end of this one.
      const std::size_t kind = next->motion == Motion::turn ? 1 : 0;
      if (ended.motion != Motion::stand) next->commanded[kind].join(ended.commanded[kind]);
      current_ = next;
      peak_ = rim_m_s;
    }
  }
}

void LegTracker::close(const Piece& piece) {
  if (legs_.size() >= most_legs) return;
  Leg leg;
  // A command that did not move the robot is a halt.
  const double way_m = piece.way_m + half_track_m_ * piece.way_rad;
  leg.motion = way_m > still_m_s_ * piece.duration_s ? piece.motion : Motion::stand;
  leg.duration_s = piece.duration_s;
  leg.payload_kg = piece.payload_kg;
  leg.battery_j = piece.battery_j;
  const Commanded& planned = piece.commanded[leg.motion == Motion::turn ? 1 : 0];
  if (leg.motion != Motion::stand && planned.way > 0) {
    leg.planned_way = planned.way;
    leg.planned_speed = planned.peak;
    leg.planned_s = std::max(planned.way / planned.peak, planned.duration_s);
  }
  if (leg.motion == Motion::drive) {
    leg.way = piece.way_m;
    leg.speed = cruise_of(piece.way_m, piece.square_m2_s, piece.duration_s);
    leg.curvature_1_m = std::fabs(piece.heading_rad) / piece.way_m;
  } else if (leg.motion == Motion::turn) {
    leg.way = piece.way_rad;
    leg.speed = cruise_of(piece.way_rad, piece.square_rad2_s, piece.duration_s);
  }
  legs_.push_back(leg);
}

std::vector<Leg> LegTracker::take() {
  if (current_) end_current();
  std::vector<Leg> legs = std::exchange(legs_, {});
  begin();
  return legs;
}

}  // namespace joulecast::forecast

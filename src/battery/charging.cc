#include "battery/charging.h"

#include <algorithm>
#include <cmath>

#include "base/units.h"

namespace joulecast::battery {
namespace {

constexpr double least_rate_per_h = 0.02;  // of the capacity: less current into it is no charging
constexpr double confirm_s = 1.5;          // of charging current at rest, before it counts
constexpr double gone_s = 3;               // without it, before charging has ended
constexpr double smoothing_s = 5;
constexpr double settle_s = 15;        // after which the smoothed current shows the plateau
constexpr double fallen_share = 0.93;  // of the plateau: below it the taper has begun ...
constexpr double fallen_confirm_s = 20;
constexpr double complete_share = 0.25;  // of the plateau: a charger that leaves below it has ended
constexpr double longest_gap_s = 15;
constexpr double least_taper = 0.4;  // of an e-fold, before its time constant is used
constexpr double memory_count = 12;

constexpr double usual_taper_charge = 0.85, usual_taper_charge_sd = 0.08;
constexpr double usual_end_share = 0.05, usual_end_share_sd = 0.03;

struct Guess {
  double value, sd;
};

// The expected next value of a quantity; its relative deviation starts at a tenth until less variation was
// observed.
Guess next_of(const Seen& seen, double doubt = 0.1) {
  const double prior = doubt * doubt * seen.mean * seen.mean;
  const double variance = (prior + seen.count * seen.variance) / (1 + seen.count);
  return {seen.mean, std::sqrt(variance * (1 + 1 / seen.count))};
}

struct Course {
  Guess current_a, taper_charge, taper_s, end_a;
};

Course course_of(const ChargingHabit& habit, double capacity_ah) {
  Course c{};
  c.current_a = next_of(habit.current_a);
  c.taper_charge = habit.taper_charge.count > 0 ? next_of(habit.taper_charge, 0.03)
                                                : Guess{usual_taper_charge, usual_taper_charge_sd};
  c.end_a = habit.end_current_a.count > 0
                ? next_of(habit.end_current_a, 0.2)
                : Guess{usual_end_share * c.current_a.value, usual_end_share_sd * c.current_a.value};
  if (habit.taper_time_s.count > 0) {
    c.taper_s = next_of(habit.taper_time_s);
  } else {
    // The taper supplies the charge that is missing at its beginning.
    const double missing_as = (1 - c.taper_charge.value) * capacity_ah * seconds_per_hour;
    const double tau = missing_as / std::max(0.1 * c.current_a.value, c.current_a.value - c.end_a.value);
    c.taper_s = {tau, 0.5 * tau};
  }
  return c;
}

ChargingTime sum(double constant_s, double constant_sd, double taper_s, double taper_sd) {
  return {constant_s + taper_s, std::hypot(constant_sd, taper_sd)};
}

}  // namespace

void Seen::add(double value) {
  count = std::min(count + 1, memory_count);
  const double off = value - mean;
  mean += off / count;
  variance += (off * (value - mean) - variance) / count;
}

ChargingTime time_to_full(const ChargingHabit& habit, double capacity_ah, double charge, double charge_sd) {
  if (habit.current_a.count == 0 || !std::isfinite(charge)) return {};
  const Course c = course_of(habit, capacity_ah);
  const double capacity_as = capacity_ah * seconds_per_hour;
  const double short_of = c.taper_charge.value - charge;
  const double ratio = std::max(1.1, c.current_a.value / c.end_a.value);
  // Beyond the beginning of the taper, part of it has gone: the current there falls as the missing charge
  // does.
  const double begun = std::max(0.0, -short_of) * capacity_as / (c.taper_s.value * c.current_a.value);
  const double left = std::max(0.0, std::log(ratio) + std::log(std::max(1 / ratio, 1 - begun)));
  const double constant_s = std::max(0.0, short_of) * capacity_as / c.current_a.value;
  const double constant_sd =
      std::hypot(std::hypot(charge_sd, c.taper_charge.sd) * capacity_as / c.current_a.value,
                 constant_s * c.current_a.sd / c.current_a.value);
  const double taper_sd = std::hypot(left * c.taper_s.sd, c.taper_s.value * c.end_a.sd / c.end_a.value);
  return sum(constant_s, constant_sd, c.taper_s.value * left, taper_sd);
}

std::string_view name(ChargingPhase phase) {
  constexpr std::string_view names[] = {"none", "suspected", "constant_current", "taper", "full"};
  return names[static_cast<std::size_t>(phase)];
}

double ChargingObserver::least_current_a() const {
  return least_rate_per_h * capacity_ah_;
}

ChargingPhase ChargingObserver::add(const Reading& reading) {
  const double interval_s =
      last_ ? static_cast<double>(reading.utime_us - last_->utime_us) * seconds_per_microsecond : 0;
  const bool silent = interval_s > longest_gap_s || interval_s < 0;
  const bool into = !reading.moving && reading.current_a < -least_current_a();
  if (silent && charging()) end(false);
  if (silent && phase_ == ChargingPhase::suspected) phase_ = ChargingPhase::none;
  switch (phase_) {
    case ChargingPhase::none:
    case ChargingPhase::full:
      if (into) {
        begin(reading);
      } else if (reading.moving || reading.current_a > least_current_a()) {
        phase_ = ChargingPhase::none;
      }
      break;
    case ChargingPhase::suspected:
      if (!into) {
        phase_ = ChargingPhase::none;
        break;
      }
      follow(reading, interval_s);
      if (phase_s_ >= confirm_s) phase_ = ChargingPhase::constant_current;
      break;
    case ChargingPhase::constant_current:
    case ChargingPhase::taper:
      absent_s_ = into ? 0 : absent_s_ + interval_s;
      if (reading.moving || absent_s_ >= gone_s) {
        end(!reading.moving && smooth_a_ < complete_share * plateau_a_);
        if (reading.moving) phase_ = ChargingPhase::none;
      } else if (into) {
        follow(reading, interval_s);
      }
      break;
  }
  last_ = reading;
  return phase_;
}

void ChargingObserver::begin(const Reading& reading) {
  phase_ = ChargingPhase::suspected;
  stay_ = {};
  stay_.start_utime_us = stay_.end_utime_us = reading.utime_us;
  stay_.start_charge = reading.charge;
  phase_s_ = absent_s_ = fallen_s_ = plateau_a_ = 0;
  taper_s_ = n_ = t_ = tt_ = y_ = ty_ = 0;
  smooth_a_ = -reading.current_a;
}

void ChargingObserver::follow(const Reading& reading, double interval_s) {
  const double into_a = -0.5 * (reading.current_a + last_->current_a);
  phase_s_ += interval_s;
  stay_.end_utime_us = reading.utime_us;
  stay_.charged_ah += into_a * interval_s / seconds_per_hour;
  const double volts = 0.5 * (reading.voltage_v + last_->voltage_v);
  if (std::isfinite(volts)) stay_.charged_j += into_a * volts * interval_s;
  smooth_a_ += -std::expm1(-interval_s / smoothing_s) * (-reading.current_a - smooth_a_);
  if (phase_s_ < settle_s) return;
  plateau_a_ = std::max(plateau_a_, smooth_a_);

  if (phase_ == ChargingPhase::constant_current) {
    if (smooth_a_ < fallen_share * plateau_a_) {
      if (fallen_s_ == 0) fallen_charge_ = reading.charge;
      fallen_s_ += interval_s;
      if (fallen_s_ >= fallen_confirm_s) phase_ = ChargingPhase::taper;
    } else {
      fallen_s_ = 0;
    }
  }
  if (phase_ == ChargingPhase::taper && smooth_a_ > 0) {
    taper_s_ += interval_s;
    const double log_a = std::log(smooth_a_);
    if (n_ == 0) first_log_ = log_a;
    n_ += interval_s;
    t_ += interval_s * taper_s_;
    tt_ += interval_s * taper_s_ * taper_s_;
    y_ += interval_s * log_a;
    ty_ += interval_s * taper_s_ * log_a;
  }
}

std::optional<double> ChargingObserver::observed_taper_s() const {
  if (phase_ != ChargingPhase::taper || !(smooth_a_ > 0) || first_log_ - std::log(smooth_a_) < least_taper)
    return std::nullopt;
  const double slope = (n_ * ty_ - t_ * y_) / (n_ * tt_ - t_ * t_);
  if (!(slope < 0)) return std::nullopt;
  return -1 / slope;
}

void ChargingObserver::end(bool complete) {
  stay_.complete = complete;
  if (plateau_a_ > 0) {
    habit_.current_a.add(plateau_a_);
    if (phase_ == ChargingPhase::taper) {
      if (std::isfinite(fallen_charge_)) habit_.taper_charge.add(fallen_charge_);
      if (const auto taper_s = observed_taper_s()) habit_.taper_time_s.add(*taper_s);
      if (complete) habit_.end_current_a.add(smooth_a_);
    }
  }
  ended_ = stay_;
  phase_ = complete ? ChargingPhase::full : ChargingPhase::none;
}

std::optional<ChargingStay> ChargingObserver::take_ended() {
  std::optional<ChargingStay> out;
  out.swap(ended_);
  return out;
}

ChargingTime ChargingObserver::remaining(double charge, double charge_sd) const {
  if (!charging()) return {};
  // This stay counts as one observation, at least of its current.
  ChargingHabit now = habit_;
  const double plateau_a = std::max(plateau_a_, smooth_a_);
  now.current_a = {1, plateau_a, 0};
  if (phase_ == ChargingPhase::constant_current) return time_to_full(now, capacity_ah_, charge, charge_sd);
  if (const auto taper_s = observed_taper_s()) now.taper_time_s.add(*taper_s);
  const Course c = course_of(now, capacity_ah_);
  const double left = std::max(0.0, std::log(smooth_a_ / c.end_a.value));
  return {c.taper_s.value * left,
          std::hypot(left * c.taper_s.sd, c.taper_s.value * c.end_a.sd / c.end_a.value)};
}

}  // namespace joulecast::battery

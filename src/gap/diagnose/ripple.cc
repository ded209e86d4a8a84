#include "gap/diagnose/ripple.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <complex>
#include <limits>
#include <numbers>
#include <random>
#include <vector>

#include "base/median.h"
#include "dynamics/drive_model.h"
#include "telemetry/recording.h"

namespace joulecast::gap {
namespace {

using signals::Sample;

// A pattern that repeats within a turn of the wheel is searched for in long segments; one that repeats with
// the motor behind its gear, in short segments of slow motion.
struct Band {
  double segment_turns;  // resolves two cycles in so many
  double slowest_per_turn, fastest_per_turn;
  double longest_step_rad;  // between samples

  double step_per_turn() const { return 1 / segment_turns; }
  std::size_t frequencies() const {
    return static_cast<std::size_t>((fastest_per_turn - slowest_per_turn) * segment_turns) + 1;
  }
};
constexpr auto bands = std::to_array<Band>({{4, 0.75, 12, 0.6}, {0.5, 10, 60, 0.08}});
constexpr double moving_rad_s = 0.2;
constexpr std::size_t fewest_samples = 40, fewest_segments = 8;
constexpr std::size_t most_samples = 60'000;
constexpr double least_contrast = 2.7;  // 150 recordings without a ripple stayed below 2
constexpr double chance = 5.0;          // standard deviations of a mean periodogram

// The model's residual between two samples.
struct Step {
  double angle_rad = 0, duration_s = 0, value = 0;
};

class Spectrum {
 public:
  explicit Spectrum(const Band& band)
      : band_(band), relative_(band.frequencies(), 0.0), power_(band.frequencies(), 0.0) {}

  // Adds one segment: its periodogram in units of its own noise.
  void add(std::span<const Step> steps) {
    const double from = steps.front().angle_rad, length = steps.back().angle_rad - from;
    double total = 0, mean = 0, centre = 0;
    std::vector<double> weight(steps.size());
    for (std::size_t k = 0; k < steps.size(); ++k) {
      const double u = 2 * std::numbers::pi * (steps[k].angle_rad - from) / length;
      weight[k] = steps[k].duration_s * (1 - std::cos(u));
      total += weight[k];
      mean += weight[k] * steps[k].value;
      centre += weight[k] * steps[k].angle_rad;
    }
    mean /= total;
    centre /= total;
    double slope = 0, square = 0;
    for (std::size_t k = 0; k < steps.size(); ++k) {
      const double u = steps[k].angle_rad - centre;
      slope += weight[k] * u * (steps[k].value - mean);
      square += weight[k] * u * u;
    }
    slope /= square;
    std::vector<std::complex<double>> sum(power_.size());
    for (std::size_t k = 0; k < steps.size(); ++k) {
      const double angle = steps[k].angle_rad - from;
      const double left = weight[k] * (steps[k].value - mean - slope * (steps[k].angle_rad - centre));
      std::complex<double> wave = left * std::polar(1.0, -band_.slowest_per_turn * angle);
      const std::complex<double> next = std::polar(1.0, -band_.step_per_turn() * angle);
      for (auto& total_at : sum) {
        total_at += wave;
        wave *= next;
      }
    }
    std::vector<double> power(sum.size());
    std::ranges::transform(sum, power.begin(), [&](const auto& s) { return std::norm(2.0 * s / total); });
    const double noise =
        upper_median(power) / std::numbers::ln2;  // the median of an exponential distribution
    if (!(noise > 0)) return;
    for (std::size_t n = 0; n < power.size(); ++n) {
      relative_[n] += power[n] / noise;
      power_[n] += power[n];
    }
    ++segments_;
  }

  // `watts_per_value`: mean over all time, of the mean battery power.
  std::optional<Ripple> line(double watts_per_value) const {
    if (segments_ < fewest_segments) return std::nullopt;
    const auto count = static_cast<double>(segments_);
    std::optional<Ripple> best;
    for (std::size_t n = 1; n + 1 < relative_.size(); ++n) {
      if (relative_[n] < relative_[n - 1] || relative_[n] < relative_[n + 1]) continue;
      // The level of neighbours beyond the line's own width; lines at the ends have neighbours on one side.
      std::vector<double> near, near_power;
      for (std::size_t k = 0; k < relative_.size(); ++k) {
        const auto apart = k > n ? k - n : n - k;
        if (apart < 3 || apart > 8) continue;
        near.push_back(relative_[k]);
        near_power.push_back(power_[k]);
      }
      const double floor = upper_median(near) / count, here = relative_[n] / count;
      const double contrast = here / floor;
      // The threshold rises with the neighbours' level above the noise.
      if (contrast < least_contrast * std::max(1.0, std::sqrt(floor)) ||
          here < floor * (1 + chance / std::sqrt(count)))
        continue;
      const double square = (power_[n] - upper_median(near_power)) / count;
      const double amplitude = std::sqrt(std::max(0.0, square));
      const double share = 2 * std::numbers::inv_pi * amplitude * watts_per_value;
      if (best && best->power_share >= share) continue;
      best = Ripple{band_.slowest_per_turn + band_.step_per_turn() * static_cast<double>(n), share, contrast};
    }
    return best;
  }

 private:
  Band band_;
  std::vector<double> relative_, power_;
  std::size_t segments_ = 0;
};

// One mission. Step k ends at sample k; its values are means over the step.
struct Track {
  struct Side {
    // left: residual of the motor's current, or of the battery power; NaN where a reading is missing.
    std::vector<double> speed_rad_s, current_a, left;
  };
  std::vector<double> step_s, power_w;
  std::array<Side, 2> side;
  std::size_t size() const { return step_s.size(); }
};

Track track_of(const telemetry::Recording& mission, const dynamics::DriveModel& model, bool motors) {
  constexpr double unknown = std::numeric_limits<double>::quiet_NaN();
  const std::size_t n = mission.samples.size();
  Track track{std::vector(n, unknown), std::vector(n, unknown), {}};
  for (Track::Side& side : track.side)
    side.speed_rad_s = side.current_a = side.left = std::vector(n, unknown);
  telemetry::MissionPayload payload(mission.payload_kg);
  if (n > 0) payload.take(mission.samples[0].payload_kg);
  for (std::size_t k = 1; k < n; ++k) {
    const Sample &a = mission.samples[k - 1], &b = mission.samples[k];
    const double payload_kg = payload.take(b.payload_kg);
    const double step_s = 1e-6 * static_cast<double>(b.utime_us - a.utime_us);
    track.step_s[k] = step_s;
    track.power_w[k] =
        0.5 * (a.battery_voltage_v * a.battery_current_a + b.battery_voltage_v * b.battery_current_a);
    dynamics::Instant at;
    at.payload_kg = std::isfinite(payload_kg) ? payload_kg : 0;
    for (const std::size_t s : {0u, 1u}) {
      track.side[s].speed_rad_s[k] = at.wheel_speed_rad_s[s] =
          0.5 * (a.wheel_velocity_rad_s[s] + b.wheel_velocity_rad_s[s]);
      track.side[s].current_a[k] = 0.5 * (a.motor_current_a[s] + b.motor_current_a[s]);
      at.wheel_acceleration_rad_s2[s] = (b.wheel_velocity_rad_s[s] - a.wheel_velocity_rad_s[s]) / step_s;
    }
    if (!(step_s > 0)) continue;
    at.x_m = 0.5 * (a.pose[0] + b.pose[0]);
    at.y_m = 0.5 * (a.pose[1] + b.pose[1]);
    at.heading_rad = b.pose[2];
    if (!motors) {
      track.side[0].left[k] = track.side[1].left[k] = track.power_w[k] - model.flow(at).battery_power_w;
      continue;
    }
    const auto torque_nm = model.balance(at).total_nm;
    for (const std::size_t s : {0u, 1u})
      track.side[s].left[k] = track.side[s].current_a[k] - model.current_for(torque_nm[s]);
  }
  return track;
}

// Steps [first, last) of a mission in which a wheel turns far enough in one direction.
struct Segment {
  std::size_t track, first, last;
};

std::vector<Segment> segments_of(std::span<const Track> tracks, std::size_t s, const Band& band) {
  const double length_rad = 2 * std::numbers::pi * band.segment_turns;
  std::vector<Segment> found;
  std::size_t samples = 0;
  for (std::size_t t = 0; t < tracks.size(); ++t) {
    const Track& track = tracks[t];
    std::size_t first = 1;
    double turned_rad = 0;
    for (std::size_t k = 1; k < track.size(); ++k) {
      const double speed = track.side[s].speed_rad_s[k], turned = speed * track.step_s[k];
      const bool broken = !(track.step_s[k] > 0) || !(std::fabs(speed) >= moving_rad_s) ||
                          !(std::fabs(turned) <= band.longest_step_rad) || turned_rad * turned < 0;
      if (!broken) {
        turned_rad += turned;
        if (std::fabs(turned_rad) < length_rad) continue;
        if (k + 1 - first >= fewest_samples) {
          found.push_back({t, first, k + 1});
          samples += k + 1 - first;
        }
      }
      first = k + 1;
      turned_rad = 0;
    }
  }
  std::vector<Segment> kept;
  for (std::size_t k = 0; k < found.size(); k += samples / most_samples + 1) kept.push_back(found[k]);
  return kept;
}

// The residuals of a segment over the wheel's angle, read `shift` steps later; empty where one is missing.
std::vector<Step> steps_of(const Track& track, const Segment& segment, std::size_t s, std::size_t shift) {
  const Track::Side& side = track.side[s];
  std::vector<Step> steps;
  double angle = 0;
  for (std::size_t k = segment.first; k < segment.last; ++k) {
    angle += std::fabs(side.speed_rad_s[k]) * track.step_s[k];
    const double value = side.left[1 + (k - 1 + shift) % (side.left.size() - 1)];
    if (!std::isfinite(value)) return {};
    steps.push_back({angle, track.step_s[k], value});
  }
  return steps;
}

// A search in one band, for any shift of the residuals of each mission.
struct Search {
  Band band;
  std::span<const Track> tracks;
  std::array<std::vector<Segment>, 2> segments;  // of each wheel
  std::array<double, 2> watts_per_value;
  bool motors;

  // The stronger line of both wheels. Their shares are added, unless one reading contains their sum.
  std::optional<Ripple> line(std::span<const std::size_t> shifts) const {
    std::optional<Ripple> strongest;
    double share = 0;
    for (const std::size_t s : {0u, 1u}) {
      Spectrum spectrum(band);
      for (const Segment& segment : segments[s]) {
        const auto steps = steps_of(tracks[segment.track], segment, s, shifts[segment.track]);
        if (!steps.empty()) spectrum.add(steps);
      }
      const auto line = spectrum.line(watts_per_value[s]);
      if (!line) continue;
      share = motors ? share + line->power_share : std::max(share, line->power_share);
      if (!strongest || line->power_share > strongest->power_share) strongest = line;
    }
    if (strongest) strongest->power_share = share;
    return strongest;
  }
};

}  // namespace

std::optional<Ripple> find_ripple(const telemetry::RecordingSet& set, const robot::RobotModel& robot,
                                  std::span<const dynamics::ActiveEffect> effects, bool motors,
                                  std::size_t surrogates) {
  const dynamics::DriveModel model(robot, effects);
  std::vector<Track> tracks;
  for (const telemetry::Recording& mission : set.missions) tracks.push_back(track_of(mission, model, motors));
  double energy_j = 0;
  std::array<double, 2> joules_per_value{};  // of battery energy, for a constant residual of one
  for (const Track& track : tracks) {
    for (std::size_t k = 1; k < track.size(); ++k) {
      const double step_s = track.step_s[k];
      if (!(step_s > 0)) continue;
      if (std::isfinite(track.power_w[k])) energy_j += std::fabs(track.power_w[k]) * step_s;
      for (std::size_t s : {0u, 1u}) {
        const double speed = std::fabs(track.side[s].speed_rad_s[k]);
        const double watts = motors
                                 ? model.parameters().torque_constant_nm_a * speed +
                                       2 * robot.motor.resistance_ohm * std::fabs(track.side[s].current_a[k])
                                 : 1.0;
        if (speed >= moving_rad_s && std::isfinite(watts)) joules_per_value[s] += watts * step_s;
      }
    }
  }
  if (!(energy_j > 0)) return std::nullopt;
  std::optional<Ripple> best;
  std::optional<Search> where;
  for (const Band& band : bands) {
    Search search{band,
                  tracks,
                  {segments_of(tracks, 0, band), segments_of(tracks, 1, band)},
                  {joules_per_value[0] / energy_j, joules_per_value[1] / energy_j},
                  motors};
    const auto line = search.line(std::vector<std::size_t>(tracks.size(), 0));
    if (!line || (best && line->power_share <= best->power_share)) continue;
    best = line;
    where = std::move(search);
  }
  if (!best) return best;
  // Shifts exceed the duration of a few turns, and differ in every mission and surrogate.
  std::mt19937_64 random(20240229);
  for (std::size_t n = 0; n < surrogates; ++n) {
    std::vector<std::size_t> shifts;
    for (const Track& track : tracks) {
      const std::size_t part = std::max<std::size_t>(1, track.size() / 10);
      shifts.push_back(
          std::uniform_int_distribution<std::size_t>(part, std::max(part, track.size() - part))(random));
    }
    const auto line = where->line(shifts);
    if (line && line->power_share > 0.5 * best->power_share) ++best->found_in;
  }
  return best;
}

}  // namespace joulecast::gap

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

namespace joulecast::gap {
namespace {

using signals::Sample;

// A pattern that repeats within a turn of the wheel is searched for in long segments; one that repeats with
// the motor behind its gear, in short segments of slow motion.
struct Band {
  double stretch_turns;  // resolves two cycles in so many
  double slowest_per_turn, fastest_per_turn;
  double longest_step_rad;  // between samples

  double step_per_turn() const { return 1 / stretch_turns; }
  std::size_t frequencies() const {
    return static_cast<std::size_t>((fastest_per_turn - slowest_per_turn) * stretch_turns) + 1;
  }
};
constexpr auto bands = std::to_array<Band>({{4, 0.75, 12, 0.6}, {0.5, 10, 60, 0.08}});
constexpr double moving_rad_s = 0.2;
constexpr std::size_t fewest_samples = 40, fewest_stretches = 8;
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
    ++stretches_;
  }

  // `watts_per_value`: mean over all time, of the mean battery power.
  std::optional<Ripple> line(double watts_per_value) const {
    if (stretches_ < fewest_stretches) return std::nullopt;
    const auto count = static_cast<double>(stretches_);
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
      std::ranges::sort(near);
      std::ranges::sort(near_power);
      const double floor = near[near.size() / 2] / count, here = relative_[n] / count;
      const double contrast = here / floor;
      // The threshold rises with the neighbours' level above the noise.
      if (contrast < least_contrast * std::max(1.0, std::sqrt(floor)) ||
          here < floor * (1 + chance / std::sqrt(count)))
        continue;
      const double square = (power_[n] - near_power[near_power.size() / 2]) / count;
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
  std::size_t stretches_ = 0;
};

// The data of one mission for the search. Electrical readings of the instant of sample k are at k + late.
struct Track {
  const telemetry::Recording* mission;
  std::size_t late;
  std::vector<double> payload_kg;

  Track(const telemetry::Recording& recording, double delay_s) : mission(&recording) {
    const auto& samples = recording.samples;
    const double mean_step_s = 1e-6 *
                               static_cast<double>(samples.back().utime_us - samples.front().utime_us) /
                               static_cast<double>(samples.size() - 1);
    late = static_cast<std::size_t>(std::lround(std::max(0.0, delay_s) / mean_step_s));
    double payload = std::isfinite(recording.payload_kg) ? recording.payload_kg : 0.0;
    for (const Sample& sample : samples) {
      if (std::isfinite(sample.payload_kg)) payload = sample.payload_kg;
      payload_kg.push_back(payload);
    }
  }

  std::size_t size() const { return mission->samples.size(); }
  const Sample& at(std::size_t k) const { return mission->samples[k]; }
  double step_s(std::size_t k) const {
    return 1e-6 * static_cast<double>(at(k).utime_us - at(k - 1).utime_us);
  }
  // Means over the step that ends at sample k.
  double speed_rad_s(std::size_t k, std::size_t s) const {
    return 0.5 * (at(k - 1).wheel_velocity_rad_s[s] + at(k).wheel_velocity_rad_s[s]);
  }
  double current_a(std::size_t k, std::size_t s) const {
    return 0.5 * (at(k - 1 + late).motor_current_a[s] + at(k + late).motor_current_a[s]);
  }
  double power_w(std::size_t k) const {
    const Sample &a = at(k - 1), &b = at(k);
    return 0.5 * (a.battery_voltage_v * a.battery_current_a + b.battery_voltage_v * b.battery_current_a);
  }
};

// Steps [first, last) of a mission in which a wheel turns far enough in one direction.
struct Stretch {
  std::size_t track, first, last;
};

std::vector<Stretch> stretches_of(std::span<const Track> tracks, std::size_t s, const Band& band) {
  const double length_rad = 2 * std::numbers::pi * band.stretch_turns;
  std::vector<Stretch> found;
  for (std::size_t t = 0; t < tracks.size(); ++t) {
    const Track& track = tracks[t];
    std::size_t first = 1;
    double turned_rad = 0;
    for (std::size_t k = 1; k + track.late < track.size(); ++k) {
      const double speed = track.speed_rad_s(k, s), turned = speed * track.step_s(k);
      if (!(track.step_s(k) > 0) || !(std::fabs(speed) >= moving_rad_s) ||
          !(std::fabs(turned) <= band.longest_step_rad) || turned_rad * turned < 0) {
        first = k + 1;
        turned_rad = 0;
        continue;
      }
      turned_rad += turned;
      if (std::fabs(turned_rad) < length_rad) continue;
      if (k + 1 - first >= fewest_samples) found.push_back({t, first, k + 1});
      first = k + 1;
      turned_rad = 0;
    }
  }
  return found;
}

// Residuals of the current of a wheel's motor, or of the battery power, in every step of a mission; NaN where
// a reading is missing. Step k ends at sample k.
std::vector<double> leftover(const Track& track, std::size_t s, const dynamics::DriveModel& model,
                             bool motors) {
  std::vector<double> values(track.size(), std::numeric_limits<double>::quiet_NaN());
  for (std::size_t k = 1; k + track.late < track.size(); ++k) {
    const Sample &a = track.at(k - 1), &b = track.at(k);
    const double step_s = track.step_s(k);
    if (!(step_s > 0)) continue;
    dynamics::Instant at;
    at.payload_kg = track.payload_kg[k];
    for (const std::size_t q : {0u, 1u}) {
      at.wheel_speed_rad_s[q] = track.speed_rad_s(k, q);
      at.wheel_acceleration_rad_s2[q] = (b.wheel_velocity_rad_s[q] - a.wheel_velocity_rad_s[q]) / step_s;
    }
    at.x_m = 0.5 * (a.pose[0] + b.pose[0]);
    at.y_m = 0.5 * (a.pose[1] + b.pose[1]);
    at.heading_rad = b.pose[2];
    values[k] = motors ? track.current_a(k, s) - model.current_for(model.balance(at).total_nm[s])
                       : track.power_w(k) - model.flow(at).battery_power_w;
  }
  return values;
}

// The residuals of a segment over the wheel's angle, read `shift` steps later; empty where one is missing.
std::vector<Step> steps_of(const Track& track, const Stretch& stretch, std::size_t s,
                           std::span<const double> left, std::size_t shift) {
  std::vector<Step> steps;
  double angle = 0;
  for (std::size_t k = stretch.first; k < stretch.last; ++k) {
    angle += std::fabs(track.speed_rad_s(k, s)) * track.step_s(k);
    const double value = left[1 + (k - 1 + shift) % (left.size() - 1)];
    if (!std::isfinite(value)) return {};
    steps.push_back({angle, track.step_s(k), value});
  }
  return steps;
}

// One band of one wheel: the inputs of a search, for any shift of the residuals.
struct Search {
  const Band& band;
  std::span<const Track> tracks;
  std::vector<Stretch> stretches;
  std::span<const std::vector<double>> left;  // of each track
  std::size_t side;
  double watts_per_value;

  std::optional<Ripple> line(std::span<const std::size_t> shifts) const {
    Spectrum spectrum(band);
    for (const Stretch& stretch : stretches) {
      const std::size_t t = stretch.track;
      if (const auto steps = steps_of(tracks[t], stretch, side, left[t], shifts[t]); !steps.empty())
        spectrum.add(steps);
    }
    return spectrum.line(watts_per_value);
  }
};

}  // namespace

std::optional<Ripple> find_ripple(const telemetry::RecordingSet& set, const robot::RobotModel& robot,
                                  std::span<const dynamics::ActiveEffect> effects, bool motors,
                                  double delay_s, std::size_t surrogates) {
  const dynamics::DriveModel model(robot, effects);
  std::vector<Track> tracks;
  for (const telemetry::Recording& mission : set.missions) tracks.emplace_back(mission, delay_s);

  double energy_j = 0;
  std::array<double, 2> joules_per_value{};  // of battery energy, for a constant residual of one
  for (const Track& track : tracks) {
    for (std::size_t k = 1; k + track.late < track.size(); ++k) {
      const double step_s = track.step_s(k), power = track.power_w(k);
      if (!(step_s > 0)) continue;
      if (std::isfinite(power)) energy_j += std::fabs(power) * step_s;
      for (std::size_t s : {0u, 1u}) {
        const double speed = std::fabs(track.speed_rad_s(k, s)), current = std::fabs(track.current_a(k, s));
        if (!(speed >= moving_rad_s)) continue;
        const double watts = motors ? model.parameters().torque_constant_nm_a * speed +
                                          2 * robot.motor.resistance_ohm * current
                                    : 1.0;
        if (std::isfinite(watts)) joules_per_value[s] += watts * step_s;
      }
    }
  }
  if (!(energy_j > 0)) return std::nullopt;

  std::array<std::vector<std::vector<double>>, 2> left;
  for (const std::size_t s : {0u, 1u}) {
    for (const Track& track : tracks) left[s].push_back(leftover(track, s, model, motors));
  }
  const std::vector<std::size_t> in_place(tracks.size(), 0);
  std::optional<Ripple> best;
  std::vector<Search> where;  // of the best, both sides
  for (const Band& band : bands) {
    std::optional<Ripple> strongest;
    std::vector<Search> searches;
    double share = 0;
    for (const std::size_t s : {0u, 1u}) {
      std::vector<Stretch> stretches = stretches_of(tracks, s, band);
      std::size_t samples = 0;
      for (const Stretch& stretch : stretches) samples += stretch.last - stretch.first;
      const std::size_t keep_every = samples / most_samples + 1;
      std::vector<Stretch> kept;
      for (std::size_t k = 0; k < stretches.size(); k += keep_every) kept.push_back(stretches[k]);
      searches.push_back({band, tracks, std::move(kept), left[s], s, joules_per_value[s] / energy_j});
      const auto line = searches.back().line(in_place);
      if (!line) continue;
      // Shares of both wheels are added, unless one reading contains their sum.
      share = motors ? share + line->power_share : std::max(share, line->power_share);
      if (!strongest || line->power_share > strongest->power_share) strongest = line;
    }
    if (!strongest) continue;
    strongest->power_share = share;
    if (best && share <= best->power_share) continue;
    best = strongest;
    where = std::move(searches);
  }
  if (!best) return best;
  // Shifts exceed the duration of a few turns, and differ in every mission and surrogate.
  std::mt19937_64 random(20240229);
  best->surrogates = surrogates;
  for (std::size_t n = 0; n < surrogates; ++n) {
    std::vector<std::size_t> shifts;
    for (const Track& track : tracks) {
      const std::size_t part = std::max<std::size_t>(1, track.size() / 10);
      shifts.push_back(
          std::uniform_int_distribution<std::size_t>(part, std::max(part, track.size() - part))(random));
    }
    double share = 0;
    for (const Search& search : where) {
      const auto line = search.line(shifts);
      if (line) share = motors ? share + line->power_share : std::max(share, line->power_share);
    }
    if (share > 0.5 * best->power_share) ++best->found_in;
  }
  return best;
}

}  // namespace joulecast::gap

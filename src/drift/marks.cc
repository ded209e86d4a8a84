#include "gap/drift.h"

#include <algorithm>
#include <cmath>
#include <map>

#include "statistics/distributions.h"
#include "statistics/robust.h"

namespace joulecast::gap {
namespace {

constexpr double gaussian_mad = 1.4826;
constexpr double least_scatter = 0.002;  // of a mission's ratio: rounding and unlogged conditions
constexpr double level = 0.01;           // chance of a false mark a stretch

// What |t| exceeds with `probability`; a stretch too short to judge by counts as one of 2 degrees of freedom.
double threshold(double probability, double freedom) {
  return statistics::student_t_quantile(1 - probability / 2, std::max(freedom, 2.0));
}

// Scatter of single missions, from differences of neighbours.
double scatter_of(std::span<const double> ratios) {
  std::vector<double> steps;
  for (std::size_t k = 1; k < ratios.size(); ++k) steps.push_back(std::fabs(ratios[k] - ratios[k - 1]));
  if (steps.empty()) return least_scatter;
  return std::max(least_scatter, gaussian_mad * statistics::median(std::move(steps)) / std::sqrt(2.0));
}

class Stretch {
 public:
  Stretch(std::span<const double> ratios, const DriftSettings& settings)
      : ratios_(ratios), settings_(settings), scatter_(scatter_of(ratios)), sums_{0} {
    for (const double r : ratios) sums_.push_back(sums_.back() + r);
  }

  std::vector<std::size_t> cuts() {
    split(0, ratios_.size());
    std::ranges::sort(cuts_);
    return cuts_;
  }
  double mean(std::size_t from, std::size_t to) const {
    return (sums_[to] - sums_[from]) / static_cast<double>(to - from);
  }
  double error(std::size_t a, std::size_t b) const {
    return scatter_ * std::sqrt(1 / static_cast<double>(a) + 1 / static_cast<double>(b));
  }
  double freedom() const { return std::max(1.0, static_cast<double>(ratios_.size()) - 2); }

 private:
  void split(std::size_t from, std::size_t to) {
    const std::size_t least = settings_.least_missions;
    if (to - from < 2 * least) return;
    std::size_t best = 0;
    double strongest = 0;
    for (std::size_t cut = from + least; cut + least <= to; ++cut) {
      const double shift = mean(cut, to) - mean(from, cut);
      const double z = std::fabs(shift) / error(cut - from, to - cut);
      if (z > strongest) strongest = z, best = cut;
    }
    const double places = static_cast<double>(to - from - 2 * least + 1);
    const double shift = mean(best, to) - mean(from, best);
    if (strongest < threshold(level / places, freedom()) || std::fabs(shift) < settings_.least_change) return;
    cuts_.push_back(best);
    split(from, best);
    split(best, to);
  }

  std::span<const double> ratios_;
  const DriftSettings& settings_;
  double scatter_;
  std::vector<double> sums_;
  std::vector<std::size_t> cuts_;
};

bool usable(const MissionRatio& m) {
  return m.measured_j > 0 && m.modelled_j > 0 && std::isfinite(m.ratio());
}

}  // namespace

std::vector<DriftMark> drift_marks(std::span<const MissionRatio> missions, const DriftSettings& settings) {
  std::map<std::int64_t, std::vector<MissionRatio>> by_version;
  for (const MissionRatio& m : missions)
    if (usable(m)) by_version[m.model_version].push_back(m);
  std::vector<DriftMark> marks;
  for (auto& [version, group] : by_version) {
    std::ranges::stable_sort(group, {}, &MissionRatio::utime_us);
    std::vector<double> ratios(group.size());
    std::ranges::transform(group, ratios.begin(), &MissionRatio::ratio);
    Stretch stretch(ratios, settings);
    std::vector<std::size_t> cuts = stretch.cuts();
    for (std::size_t k = 0; k < cuts.size(); ++k) {
      const std::size_t from = k == 0 ? 0 : cuts[k - 1], cut = cuts[k],
                        to = k + 1 < cuts.size() ? cuts[k + 1] : group.size();
      DriftMark mark;
      mark.mission_key = group[cut].mission_key;
      mark.utime_us = group[cut].utime_us;
      mark.model_version = version;
      mark.before = stretch.mean(from, cut);
      mark.after = stretch.mean(cut, to);
      mark.missions = to - cut;
      const double half = threshold(0.05, stretch.freedom()) * stretch.error(cut - from, to - cut);
      mark.interval = {mark.after - mark.before - half, mark.after - mark.before + half};
      // Splitting further can bring two neighbours together again.
      if (std::fabs(mark.after - mark.before) >= settings.least_change) marks.push_back(mark);
    }
  }
  std::ranges::stable_sort(marks, {}, &DriftMark::utime_us);
  return marks;
}

std::vector<SiblingRatio> compare_siblings(std::span<const RobotRatios> robots,
                                           const DriftSettings& settings) {
  std::vector<SiblingRatio> siblings;
  std::vector<double> errors;
  for (const RobotRatios& robot : robots) {
    std::vector<double> ratios;
    for (const MissionRatio& m : robot.missions)
      if (usable(m)) ratios.push_back(m.ratio());
    if (ratios.size() < settings.least_missions) continue;
    SiblingRatio s;
    s.robot_id = robot.robot_id;
    s.missions = ratios.size();
    s.ratio = statistics::median(ratios);
    std::vector<double> off;
    for (const double r : ratios) off.push_back(std::fabs(r - s.ratio));
    const double n = static_cast<double>(ratios.size());
    // The median's error is sqrt(pi/2) times the mean's.
    const double error =
        1.2533 * std::max(least_scatter, gaussian_mad * statistics::median(std::move(off))) / std::sqrt(n);
    const double half = threshold(0.05, n - 1) * error;
    s.interval = {s.ratio - half, s.ratio + half};
    errors.push_back(error);
    siblings.push_back(std::move(s));
  }
  if (siblings.size() >= 3) {
    std::vector<double> middle;
    for (const SiblingRatio& s : siblings) middle.push_back(s.ratio);
    const double centre = statistics::median(middle);
    for (double& r : middle) r = std::fabs(r - centre);
    const double spread = gaussian_mad * statistics::median(std::move(middle));
    const double many = static_cast<double>(siblings.size());
    for (std::size_t k = 0; k < siblings.size(); ++k) {
      SiblingRatio& s = siblings[k];
      const double off = s.ratio - centre;
      s.deviation = off / std::hypot(spread, errors[k]);
      s.stands_out = std::fabs(s.deviation) > threshold(level / many, many - 1) &&
                     std::fabs(off) >= settings.least_change;
    }
  }
  std::ranges::sort(siblings, {}, &SiblingRatio::robot_id);
  return siblings;
}

std::string_view cause_of(std::string_view id) {
  static const std::map<std::string_view, std::string_view> causes = {{"coulomb_friction", "wear"},
                                                                      {"viscous_friction", "wear"},
                                                                      {"stribeck_friction", "wear"},
                                                                      {"friction_asymmetry", "wear"},
                                                                      {"gear_efficiency", "wear"},
                                                                      {"resistance_error", "wear"},
                                                                      {"winding_temperature", "wear"},
                                                                      {"brush_drop", "wear"},
                                                                      {"torque_constant_loss", "wear"},
                                                                      {"wheel_radius_error", "wear"},
                                                                      {"wheel_radius_asymmetry", "wear"},
                                                                      {"driver_loss", "wear"},
                                                                      {"load_rolling_resistance", "floor"},
                                                                      {"floor_resistance_zone", "floor"},
                                                                      {"slope", "floor"},
                                                                      {"turning_scrub", "floor"},
                                                                      {"wheel_slip", "floor"},
                                                                      {"battery_resistance", "battery"},
                                                                      {"no_regeneration", "battery"},
                                                                      {"accessory_load", "load"},
                                                                      {"chassis_mass_error", "load"},
                                                                      {"payload_mass_error", "load"},
                                                                      {"yaw_inertia_error", "load"},
                                                                      {"linear_inertia_error", "load"},
                                                                      {"com_offset", "load"},
                                                                      {"aerodynamic_drag", "load"},
                                                                      {"current_sensor_gain", "sensors"},
                                                                      {"current_sensor_bias", "sensors"},
                                                                      {"voltage_sensor_gain", "sensors"},
                                                                      {"sensor_delay", "sensors"}};
  const auto found = causes.find(id);
  return found == causes.end() ? "model" : found->second;
}

}  // namespace joulecast::gap

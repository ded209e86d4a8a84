#include "tests/study/trial/trial_case.h"

#include <algorithm>
#include <array>
#include <cassert>
#include <cmath>
#include <cstdlib>
#include <numeric>
#include <utility>

#include "client/virtual_robot/fleet.h"
#include "tests/study/trial/plant_variants.h"
#include "tests/study/trial/robot_draw.h"
#include "tests/support/simulated_missions.h"

namespace joulecast::trial {
namespace {

namespace vr = virtual_robot;
using vr::Rng;

constexpr std::array kind_names{"none", "single", "pair", "outside"};
constexpr std::array strength_names{"slight", "weak", "medium", "strong"};
constexpr std::array<double, 3> strength_bounds{0.02, 0.04, 0.08};
constexpr double strongest_gap = 0.16;

// Of every twenty cases in turn: 9 single, 4 pairs, 4 none, 3 outside.
constexpr std::array kind_cycle{Kind::single, Kind::none,    Kind::pair,   Kind::single, Kind::outside,
                                Kind::single, Kind::single,  Kind::none,   Kind::pair,   Kind::single,
                                Kind::none,   Kind::outside, Kind::single, Kind::pair,   Kind::single,
                                Kind::single, Kind::none,    Kind::pair,   Kind::single, Kind::outside};

// Effects with little influence on battery power, or limited by a physical bound: the range of strengths
// drawn if the requested gap is out of reach.
struct OwnRange {
  std::string_view id;
  double least, most;
};
constexpr auto own_ranges = std::to_array<OwnRange>({{"wheel_radius_error", 0.015, 0.06},
                                                     {"wheel_radius_asymmetry", 0.008, 0.03},
                                                     {"track_error", 0.02, 0.10},
                                                     {"wheel_slip", 0.02, 0.10},
                                                     {"battery_resistance", 0.6, 2.0},
                                                     {"sensor_delay", 0.04, 0.15},
                                                     {"inductance", 0.02, 0.08},
                                                     {"com_offset", 0.02, 0.10},
                                                     {"yaw_inertia_error", 0.5, 2.0},
                                                     {"linear_inertia_error", 0.2, 0.8},
                                                     {"payload_mass_error", 0.3, 1.0},
                                                     {"winding_temperature", 20, 60},
                                                     {"no_regeneration", 0.6, 1.0}});

// Implausible strengths, although the plant supports them: such effects are drawn no stronger than this.
struct Upward {
  std::string_view id;
  double most;
};
constexpr auto upward = std::to_array<Upward>({{"resistance_error", 2.5},
                                               {"stribeck_friction", 5},
                                               {"coulomb_friction", 4},
                                               {"friction_asymmetry", 5},
                                               {"current_sensor_gain", 0.2},
                                               {"voltage_sensor_gain", 0.2},
                                               {"sensor_delay", 0.2},
                                               {"wheel_radius_error", 0.15},
                                               {"track_error", 0.25},
                                               {"wheel_slip", 0.1},
                                               {"yaw_inertia_error", 6},
                                               {"chassis_mass_error", 1},
                                               {"payload_mass_error", 1.5},
                                               {"linear_inertia_error", 1},
                                               {"winding_temperature", 90}});

// Effects that may go either way, and how far down.
struct Downward {
  std::string_view id;
  double most;
};
constexpr auto downward = std::to_array<Downward>({{"coulomb_friction", 0.6},
                                                   {"friction_asymmetry", 0.6},
                                                   {"chassis_mass_error", 0.4},
                                                   {"payload_mass_error", 0.8},
                                                   {"resistance_error", 0.4},
                                                   {"torque_constant_loss", 0.2},
                                                   {"wheel_radius_error", 0.1},
                                                   {"wheel_radius_asymmetry", 0.05},
                                                   {"track_error", 0.15},
                                                   {"com_offset", 0.1},
                                                   {"current_sensor_gain", 0.3},
                                                   {"current_sensor_bias", 3},
                                                   {"voltage_sensor_gain", 0.3}});
constexpr double downward_share = 0.2;

template <std::size_t N>
std::string_view name_in(const std::array<const char*, N>& names, std::size_t k) {
  return names[k];
}

// Ids of the catalogue, or outside it, in an order that belongs to the seed and the round, so that every id
// comes equally often.
std::string_view id_in_turn(std::uint64_t seed, std::size_t turn, bool outside) {
  std::vector<std::string_view> ids;
  for (const auto& entry : vr::effect_table()) {
    if (entry.outside == outside) ids.push_back(entry.id);
  }
  Rng rng = Rng::stream(seed, 1000 + 2 * (turn / ids.size()) + (outside ? 1 : 0));
  for (std::size_t k = ids.size(); k > 1; --k) std::swap(ids[k - 1], ids[rng.index(k)]);
  return ids[turn % ids.size()];
}

Kind kind_at(const TrialSettings& settings, std::size_t index) {
  if (!settings.only_effect.empty()) {
    return settings.only_effect.starts_with("x_") ? Kind::outside : Kind::single;
  }
  return settings.only.value_or(kind_in_turn(index));
}

double gap_in(Rng& rng, Strength strength) {
  const auto k = static_cast<std::size_t>(strength);
  const double low = strength_bounds[k - 1];
  const double high = k < strength_bounds.size() ? strength_bounds[k] : strongest_gap;
  return rng.uniform(low * 1.02, high * 0.98);
}

double sign_of(Rng& rng, std::string_view id) {
  const bool may = std::ranges::find(downward, id, &Downward::id) != downward.end();
  return rng.chance(downward_share) && may ? -1 : 1;
}

// The strongest that is drawn in that direction.
double limit_of(std::string_view id, double sign) {
  if (sign < 0) return std::ranges::find(downward, id, &Downward::id)->most;
  if (const auto bound = std::ranges::find(upward, id, &Upward::id); bound != upward.end())
    return bound->most;
  return std::ranges::find(vr::effect_table(), id, &vr::EffectEntry::id)->search_limit;
}

// Effects added to one plant, each near a wanted gap, and the gap that they make on a few short missions: it
// is nearly the same on all.
class Workshop {
 public:
  Workshop(const vr::SimulationSpec& spec, std::uint64_t seed) : spec_(spec), seed_(seed) {
    spec_.missions = searched_missions;
    spec_.script.duration_s = searched_duration_s;
    base_ = gap_ = vr::absolute_power_gap(spec_, seed_);
  }

  const vr::Imperfections& imperfections() const { return spec_.imperfections; }
  double added_gap() const { return gap_ - base_; }

  // The gap that one more effect has added, or empty if this plant does not support it; `part` selects a
  // strength from the range of effects that cannot make the gap. On failure the plant is unchanged.
  std::optional<double> put_in(std::string_view id, double wanted, double sign, double part) {
    const vr::Imperfections before = spec_.imperfections;
    const auto entry = std::ranges::find(vr::effect_table(), id, &vr::EffectEntry::id);
    const auto own = std::ranges::find(own_ranges, id, &OwnRange::id);
    const double limit = limit_of(id, sign);
    // The gap grows nearly in proportion to the strength.
    double strength = limit / 64;
    double gap = 0;
    for (int k = 0; k < search_steps; ++k) {
      spec_.imperfections.*(entry->strength) = sign * strength;
      gap = vr::absolute_power_gap(spec_, seed_);
      const double reached = gap - gap_;
      if (std::abs(reached - wanted) <= search_tolerance * wanted) return accept(gap);
      if (reached < wanted && strength >= limit) break;
      const double growth = reached > 0 ? std::clamp(wanted / reached, 0.1, 12.0) : 6.0;
      strength = std::min(strength * growth, limit);
    }
    if (own != own_ranges.end()) {
      const double most = std::min(own->most, limit);
      spec_.imperfections.*(entry->strength) = sign * (own->least + part * (most - own->least));
      return accept(vr::absolute_power_gap(spec_, seed_));
    }
    spec_.imperfections = before;
    return std::nullopt;
  }

 private:
  static constexpr int searched_missions = 3;
  static constexpr double searched_duration_s = 45;
  static constexpr int search_steps = 6;
  static constexpr double search_tolerance = 0.15;

  double accept(double gap) {
    const double gained = gap - gap_;
    gap_ = gap;
    return gained;
  }

  vr::SimulationSpec spec_;
  std::uint64_t seed_;
  double base_, gap_;
};

bool meets_needs(std::string_view id, const vr::SimulationSpec& spec) {
  // Without localisation, a place cannot be distinguished from a time.
  const bool place = id == "floor_resistance_zone" || id == "slope" || id == "x_radio_zone" ||
                     id == "x_heading_load" || id == "x_floor_patches" || id == "wheel_slip" ||
                     id == "wheel_radius_error";
  return spec.sensors.pose || !place;
}

void draw_effects(const TrialSettings& settings, std::size_t index, Rng& rng, TrialCase& c) {
  if (c.kind == Kind::none) return;
  constexpr std::size_t tries = 24;
  const std::size_t wanted = c.kind == Kind::pair ? 2 : 1;
  const bool outside = c.kind == Kind::outside;
  const auto strength = static_cast<Strength>(c.kind == Kind::pair ? 2 + rng.index(2) : 1 + rng.index(3));
  const std::size_t turn = settings.only ? index : turn_in_kind(index);
  std::vector<std::string_view> used;
  Workshop workshop(c.spec, c.seed);
  double least = 1;
  for (std::size_t k = 0; k < tries && used.size() < wanted; ++k) {
    // Effects that this plant cannot have make way for others far off in the order.
    const std::size_t number = turn * wanted + used.size() + 7 * (k - used.size());
    const std::string_view id = settings.only_effect.empty() ? id_in_turn(settings.seed, number, outside)
                                                             : std::string_view(settings.only_effect);
    const double sign = sign_of(rng, id);
    const double gap = gap_in(rng, strength);
    const double part = rng.uniform();
    if (std::ranges::find(used, id) != used.end() || !meets_needs(id, c.spec)) continue;
    const Workshop before = workshop;
    const auto gained = workshop.put_in(id, gap, sign, part);
    // Both effects of a pair must be visible: a barely visible one is drawn again.
    if (!gained || (c.kind == Kind::pair && *gained < strength_bounds[0])) {
      workshop = before;
      continue;
    }
    used.push_back(id);
    least = std::min(least, *gained);
  }
  c.spec.imperfections = workshop.imperfections();
  c.added_gap = workshop.added_gap();
  c.strength = strength_of(least);
  if (used.empty()) c.kind = Kind::none;
  if (used.size() == 1 && c.kind == Kind::pair) c.kind = Kind::single;
}

}  // namespace

Kind kind_in_turn(std::size_t index) {
  return kind_cycle[index % kind_cycle.size()];
}

std::size_t turn_in_kind(std::size_t index) {
  const auto before = [&](std::size_t count) {
    const auto end = kind_cycle.begin() + static_cast<std::ptrdiff_t>(count);
    return static_cast<std::size_t>(std::count(kind_cycle.begin(), end, kind_in_turn(index)));
  };
  return index / kind_cycle.size() * before(kind_cycle.size()) + before(index % kind_cycle.size());
}

std::size_t in_turn(std::uint64_t seed, std::uint64_t purpose, std::size_t size, std::size_t turn) {
  std::vector<std::size_t> deck(size);
  std::iota(deck.begin(), deck.end(), std::size_t{0});
  Rng rng = Rng::stream(seed, purpose * 1'000'000 + turn / size);
  for (std::size_t k = size; k > 1; --k) std::swap(deck[k - 1], deck[rng.index(k)]);
  return deck[turn % size];
}

std::string_view name_of(Kind kind) {
  return name_in(kind_names, static_cast<std::size_t>(kind));
}

std::optional<Kind> kind_of(std::string_view name) {
  const auto found = std::ranges::find(kind_names, name);
  if (found == kind_names.end()) return std::nullopt;
  return static_cast<Kind>(found - kind_names.begin());
}

std::string_view name_of(Strength strength) {
  return name_in(strength_names, static_cast<std::size_t>(strength));
}

Strength strength_of(double added_gap) {
  return static_cast<Strength>(
      std::ranges::count_if(strength_bounds, [&](double b) { return added_gap >= b; }));
}

TrialCase draw_case(const TrialSettings& settings, std::size_t index) {
  Rng rng = Rng::stream(settings.seed, 100'000 + index);
  TrialCase c;
  c.index = index;
  c.kind = kind_at(settings, index);
  c.seed = rng.next();
  const DrawnRobot drawn = draw_robot(rng);
  c.robot_kind = drawn.kind;
  c.robot_json = drawn.json_text;
  const auto parsed = vr::parse_robot(drawn.json_text);
  assert(parsed.has_value());  // the shipped files are valid and stay so when varied
  c.spec.robot = as_built(*parsed, rng);
  c.spec.world = vr::draw_world(rng, c.spec.script.map_half_width_m);
  c.spec.missions = 5 + static_cast<int>(rng.index(rng.chance(0.5) ? 1 : 8));
  const bool battery_only = rng.chance(0.2);
  c.spec.sensors.motor_channels = settings.channels == ChannelChoice::full ||
                                  (settings.channels == ChannelChoice::mixed && !battery_only);
  Rng variants = Rng::stream(settings.seed, 200'000'000 + index);
  if (settings.vary_plant && variants.chance(0.5)) c.variants = vary_plant(variants, c.spec);
  Rng effects = Rng::stream(settings.seed, 300'000'000 + index);
  draw_effects(settings, index, effects, c);
  return c;
}

}  // namespace joulecast::trial

#include <algorithm>
#include <cmath>
#include <numeric>

#include "tests/study/trial/motion/plant.h"

namespace joulecast::trial::motion {
namespace {

using virtual_robot::Rng;
using Load = std::vector<double>;

double whole_s(std::span<const Instant> instants) {
  return instants.back().driven_s - instants.front().driven_s;
}

Load falling_heater(std::span<const Instant> instants, Rng& rng) {
  const double time_s = rng.uniform(0.15, 0.4) * whole_s(instants);
  Load load;
  for (const Instant& at : instants) {
    load.push_back(1 + 3 * std::exp(-(at.driven_s - instants.front().driven_s) / time_s));
  }
  return load;
}

Load bursts(std::span<const Instant> instants, Rng& rng) {
  const double spell_s = std::min(rng.uniform(10, 40), whole_s(instants) / 10);
  Load load;
  bool on = rng.chance(0.5);
  double until_s = 0;
  for (const Instant& at : instants) {
    while (at.driven_s > until_s) {
      on = !on;
      until_s = std::max(until_s, instants.front().driven_s) - spell_s * std::log(1 - rng.uniform());
    }
    load.push_back(on ? 1 : 0);
  }
  return load;
}

// For robots that turn, discs of the floor; for others, segments of the way.
Load places(std::span<const Instant> instants, Rng& rng) {
  constexpr std::size_t count = 4;
  const auto [low, high] = std::ranges::minmax(instants, {}, &Instant::x_m);
  const auto [under, over] = std::ranges::minmax(instants, {}, &Instant::y_m);
  const double width_m = high.x_m - low.x_m, height_m = over.y_m - under.y_m;
  const double way_m = instants.back().travelled_m - instants.front().travelled_m;
  const bool floor = std::min(width_m, height_m) > 0.05 * std::max(width_m, height_m);
  const double radius_m = floor ? 0.15 * std::max(width_m, height_m) : 0.05 * way_m;
  std::vector<Instant> centres;
  for (std::size_t k = 0; k < count; ++k) centres.push_back(instants[rng.index(instants.size())]);
  Load load;
  for (const Instant& at : instants) {
    load.push_back(std::ranges::any_of(centres, [&](const Instant& c) {
      const double apart_m =
          floor ? std::hypot(at.x_m - c.x_m, at.y_m - c.y_m) : std::fabs(at.travelled_m - c.travelled_m);
      return apart_m < radius_m;
    }));
  }
  return load;
}

// A random walk that is drawn back to 1 within some part of the recording, and never negative.
Load random_walk(std::span<const Instant> instants, Rng& rng) {
  const double time_s = rng.uniform(0.1, 0.3) * whole_s(instants);
  double state = rng.normal(), before_s = instants.front().driven_s;
  Load load;
  for (const Instant& at : instants) {
    const double kept = std::exp(-(at.driven_s - before_s) / time_s);
    before_s = at.driven_s;
    state = kept * state + std::sqrt(1 - kept * kept) * rng.normal();
    load.push_back(std::max(0.0, 1 + state));
  }
  return load;
}

Load standstill(std::span<const Instant> instants) {
  constexpr double still_m_s = 0.02;
  Load load;
  for (const Instant& at : instants) {
    load.push_back(std::fabs(at.rim_m_s[0]) < still_m_s && std::fabs(at.rim_m_s[1]) < still_m_s ? 1 : 0);
  }
  return load;
}

}  // namespace

std::string_view name_of(OutsideLoad load) {
  constexpr std::array<std::string_view, outside_load_count> names{"x_falling_heater", "x_bursts", "x_places",
                                                                   "x_random_walk", "x_standstill_load"};
  return names[static_cast<std::size_t>(load)];
}

std::vector<double> outside_load_w(OutsideLoad kind, std::span<const Instant> instants, Rng& rng) {
  constexpr double least_share = 0.1;  // of the time that a load is on, and that it is off
  Load load;
  switch (kind) {
    case OutsideLoad::falling_heater:
      load = falling_heater(instants, rng);
      break;
    case OutsideLoad::bursts:
      load = bursts(instants, rng);
      break;
    case OutsideLoad::places:
      load = places(instants, rng);
      break;
    case OutsideLoad::random_walk:
      load = random_walk(instants, rng);
      break;
    case OutsideLoad::standstill:
      load = standstill(instants);
      break;
  }
  const double n = static_cast<double>(load.size());
  const double mean = std::accumulate(load.begin(), load.end(), 0.0) / n;
  const auto low = std::ranges::count_if(load, [&](double w) { return w < 0.75 * mean; });
  const auto high = std::ranges::count_if(load, [&](double w) { return w > 1.25 * mean; });
  if (static_cast<double>(std::min(low, high)) < least_share * n) return {};
  for (double& w : load) w /= mean;
  return load;
}

}  // namespace joulecast::trial::motion

#include "client/virtual_robot/fleet.h"

#include <numbers>
#include <utility>

namespace joulecast::virtual_robot {

extern const std::string_view amr_json, nomad_json, tug_json, p3dx_json;  // deploy/robots, embedded at build

std::span<const ShippedRobot> shipped_robots() {
  static const ShippedRobot robots[] = {
      {"amr", amr_json}, {"nomad", nomad_json}, {"tug", tug_json}, {"p3dx", p3dx_json}};
  return robots;
}

World draw_world(Rng& rng, double map_half_width_m) {
  World world;
  world.zone_x_m = rng.uniform(-0.5, 0.5) * map_half_width_m;
  world.zone_y_m = rng.uniform(-0.5, 0.5) * map_half_width_m;
  world.zone_radius_m = rng.uniform(0.35, 0.55) * map_half_width_m;
  world.slope_direction_rad = rng.uniform(0, 2 * std::numbers::pi);
  world.weak_side = rng.chance(0.5) ? 1 : 0;
  world.stribeck_speed_m_s = rng.uniform(0.08, 0.2);
  world.thermal_time_constant_s = rng.uniform(150, 400);
  world.period_s = rng.uniform(12, 40);
  world.burst_time_s = rng.uniform(10, 30);
  world.patch_m = rng.uniform(0.7, 2.2);
  return world;
}

Fleet::Fleet(const std::vector<SimulationSpec>& specs, std::uint64_t seed) {
  robots_.reserve(specs.size());
  for (std::size_t k = 0; k < specs.size(); ++k)
    robots_.emplace_back(specs[k], Rng::stream(seed, 1000 + k).next());
  open_.resize(robots_.size());
  for (auto& robot : robots_) waiting_.push_back(robot.next());
}

std::optional<Fleet::Message> Fleet::next() {
  std::optional<std::size_t> earliest;
  for (std::size_t k = 0; k < waiting_.size(); ++k)
    if (waiting_[k] && (!earliest || waiting_[k]->utime_us < waiting_[*earliest]->utime_us)) earliest = k;
  if (!earliest) return std::nullopt;
  Message message{*earliest, std::move(*waiting_[*earliest])};
  auto& open = open_[*earliest];
  if (const auto* event = std::get_if<signals::MissionEvent>(&message.emission.message)) {
    open = event->phase == signals::MissionPhase::started ? std::optional(*event) : std::nullopt;
  } else if (open) {
    open->utime_us = message.emission.utime_us;
  }
  waiting_[*earliest] = robots_[*earliest].next();
  return message;
}

std::vector<Fleet::Message> Fleet::abort() {
  std::vector<Message> events;
  for (std::size_t k = 0; k < robots_.size(); ++k) {
    waiting_[k].reset();
    if (!open_[k]) continue;
    open_[k]->phase = signals::MissionPhase::aborted;
    events.push_back({k, {open_[k]->utime_us, std::move(*open_[k])}});
    open_[k].reset();
  }
  return events;
}

}  // namespace joulecast::virtual_robot

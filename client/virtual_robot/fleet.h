#pragma once

#include <cstdint>
#include <optional>
#include <span>
#include <string_view>
#include <vector>

#include "client/virtual_robot/virtual_robot.h"
#include "signals/sample.h"

namespace joulecast::virtual_robot {

// Robot files that come with the program (deploy/robots), by kind: "amr", "nomad", "p3dx", "tug".
struct ShippedRobot {
  std::string_view kind;
  std::string_view json_text;
};
[[nodiscard]] std::span<const ShippedRobot> shipped_robots();

// A floor drawn at random: where its bad patch is, which way it tilts, which side of the robot is weak.
[[nodiscard]] World draw_world(Rng& rng, double map_half_width_m);

// Several robots on one map and one clock; messages come in order of time, ties in order of the robots.
class Fleet {
 public:
  Fleet(const std::vector<SimulationSpec>& specs, std::uint64_t seed);

  struct Message {
    std::size_t robot = 0;
    Emission emission;
  };
  // Empty when every robot has done its missions.
  [[nodiscard]] std::optional<Message> next();

  // The events that end every running mission, at its robot's last message. The fleet is done then.
  [[nodiscard]] std::vector<Message> abort();

  std::size_t size() const { return robots_.size(); }
  const VirtualRobot& robot(std::size_t index) const { return robots_[index]; }

 private:
  std::vector<VirtualRobot> robots_;
  std::vector<std::optional<Emission>> waiting_;
  std::vector<std::optional<signals::MissionEvent>> open_;  // the start given out last, until its end is
};

}  // namespace joulecast::virtual_robot

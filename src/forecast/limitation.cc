#include "forecast/limitation.h"

#include <fmt/format.h>

namespace joulecast::forecast {

std::optional<Limitation> limitation(const LegPricer& pricer, const robot::RobotModel& robot,
                                     const Pace& wanted, double payload_kg) {
  const Reachable drive =
      pricer.reachable(Motion::drive, 0, payload_kg, {wanted.speed_m_s, wanted.acceleration_m_s2});
  const Reachable turn =
      pricer.reachable(Motion::turn, 0, payload_kg, {wanted.yaw_rate_rad_s, wanted.yaw_acceleration_rad_s2});
  std::string allowed = fmt::format("{:.4g} V", robot.battery.nominal_voltage_v);
  if (robot.limits.current_a > 0) allowed += fmt::format(" and {:.4g} A", robot.limits.current_a);
  for (const auto& [within, motion] : {std::pair{&drive, "drive"}, std::pair{&turn, "turn"}}) {
    if (within->moves) continue;
    return Limitation{
        false,
        {},
        fmt::format("With {:.4g} kg the robot cannot {}: that takes {:.4g} V and {:.4g} A at the least, and "
                    "its motors have {}.",
                    payload_kg, motion, within->creeping_voltage_v, within->creeping_current_a, allowed)};
  }
  constexpr double noticed = 0.999;
  const auto less = [](double reached, double asked) { return reached < noticed * asked; };
  Limitation slower{true, wanted, {}};
  slower.reached.speed_m_s = drive.cruise.speed;
  slower.reached.acceleration_m_s2 = drive.cruise.acceleration;
  slower.reached.yaw_rate_rad_s = turn.cruise.speed;
  slower.reached.yaw_acceleration_rad_s2 = turn.cruise.acceleration;
  std::string what;
  const auto add = [&](double reached, double asked, const char* unit) {
    if (!less(reached, asked)) return;
    what += fmt::format("{}{:.3g} {} instead of {:.3g}", what.empty() ? "" : ", ", reached, unit, asked);
  };
  add(drive.cruise.speed, wanted.speed_m_s, "m/s");
  add(drive.cruise.acceleration, wanted.acceleration_m_s2, "m/s^2");
  add(turn.cruise.speed, wanted.yaw_rate_rad_s, "rad/s");
  add(turn.cruise.acceleration, wanted.yaw_acceleration_rad_s2, "rad/s^2");
  if (what.empty()) return std::nullopt;
  slower.sentence =
      fmt::format("With {:.4g} kg the robot's motors, which have {}, reach {}.", payload_kg, allowed, what);
  return slower;
}

}  // namespace joulecast::forecast

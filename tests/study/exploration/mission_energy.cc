#include "tests/study/exploration/mission_energy.h"

#include <fmt/format.h>

#include <algorithm>

#include "base/bounds.h"
#include "dynamics/drive_model.h"
#include "planning/line.h"
#include "tests/study/ramp/ramp.h"
#include "tests/support/straight_power.h"

namespace joulecast::exploration {
namespace {

Result<void> positive(const char* field, double value) {
  if (std::isfinite(value) && value > 0) return {};
  return invalid(field, fmt::format("is {}, must be positive", value));
}

// Power of the motors while turning on the spot at a constant rate [W].
double turning_power_w(const dynamics::DriveModel& model, double rate_rad_s, double payload_kg) {
  dynamics::Instant at;
  at.wheel_speed_rad_s = dynamics::wheels_of_body(model.parameters(), 0, rate_rad_s);
  at.payload_kg = payload_kg;
  const auto flow = model.flow(at);
  return flow.motor_power_w[0] + flow.motor_power_w[1];
}

void add(Spent& sum, double energy_j, double duration_s, double peak_speed_m_s) {
  sum.energy_j += energy_j;
  sum.duration_s += duration_s;
  sum.peak_speed_m_s = std::max(sum.peak_speed_m_s, peak_speed_m_s);
}

}  // namespace

Result<MissionEnergy> mission_energy(const robot::RobotModel& robot, std::span<const Motion> motions,
                                     const MissionOptions& options) {
  MissionEnergy mission;
  mission.payload_kg = options.payload_kg;
  mission.turn_rate_rad_s = options.turn_rate_rad_s.value_or(robot.limits.yaw_rate_rad_s);
  if (auto ok = positive("turn_rate_rad_s", mission.turn_rate_rad_s); !ok) return tl::unexpected(ok.error());
  if (auto ok = positive("triangle_peak_m_s", options.triangle_peak_m_s); !ok)
    return tl::unexpected(ok.error());
  if (const Bounds bounds{0, robot.limits.payload_kg}; !bounds.contain(options.payload_kg))
    return invalid("payload_kg", out_of_bounds(options.payload_kg, bounds, "kg"));

  const dynamics::DriveModel model(robot, std::span<const dynamics::ActiveEffect>{});
  const double idle_w = options.idle ? robot.idle_power_w : 0;
  const double left_w = idle_w + turning_power_w(model, mission.turn_rate_rad_s, options.payload_kg);
  const double right_w = idle_w + turning_power_w(model, -mission.turn_rate_rad_s, options.payload_kg);
  planning::LineTask task;
  task.power = dynamics::straight_power(robot, options.payload_kg).over_distance();
  task.power.c0 += idle_w;
  for (const Motion& motion : motions) {
    if (const auto* turn = std::get_if<Turn>(&motion)) {
      const double duration = std::fabs(turn->angle_rad) / mission.turn_rate_rad_s;
      add(mission.turns, (turn->angle_rad > 0 ? left_w : right_w) * duration, duration, 0);
      continue;
    }
    task.distance = std::get<Straight>(motion).length_m();
    const auto triangle = planning::ramp_in_time(task, 2 * task.distance / options.triangle_peak_m_s, 0.5);
    if (!triangle) return tl::unexpected(triangle.error());
    add(mission.triangle, triangle->energy_j(), triangle->duration_s(), triangle->peak_speed());
    const auto optimal = planning::line_in_free_time(task);
    if (!optimal) return tl::unexpected(optimal.error());
    add(mission.optimal, optimal->energy_j(), optimal->duration_s(), optimal->peak_speed());
  }
  return mission;
}

}  // namespace joulecast::exploration

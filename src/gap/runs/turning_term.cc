#include "gap/runs/turning_term.h"

#include <algorithm>
#include <cmath>

namespace joulecast::gap {

std::optional<TurningTerm> turning_term(std::span<const MissionRun> runs, const robot::RobotModel& robot) {
  const auto model = dynamics::drive_model(robot);
  if (!model) return std::nullopt;
  TurningTerm t;
  double xx = 0, xy = 0, yy = 0;
  for (const MissionRun& run : runs) {
    if (run.at.turn_rad == 0 || !run.by_motor() || std::isnan(run.model_motor_j[0])) continue;
    const RunEnergy right = run_energy(*model, run.at), halved = run_energy(*model, run.at, 0.5);
    // The given model is assumed proportional to the robot file's where their energies differ.
    const double scale =
        (run.model_motor_j[0] + run.model_motor_j[1]) / (halved.motor_j[0] + halved.motor_j[1]);
    std::array<double, 2> change{};
    for (std::size_t s : {0u, 1u}) {
      change[s] = scale * (right.motor_j[s] - halved.motor_j[s]);
      t.motor_error_before += 0.5 * std::fabs(1 - run.model_motor_j[s] / run.motor_j[s]);
      t.motor_error_after += 0.5 * std::fabs(1 - (run.model_motor_j[s] + change[s]) / run.motor_j[s]);
    }
    const double energy = run.measured_j();
    const double x = (change[0] - change[1]) / energy;
    const double y = (run.motor_j[0] - run.motor_j[1] - run.model_motor_j[0] + run.model_motor_j[1]) / energy;
    t.side_difference += std::fabs(x);
    t.sum += (change[0] + change[1]) / energy;
    xx += x * x, xy += x * y, yy += y * y;
    ++t.runs;
  }
  if (t.runs < 2 || xx <= 0) return std::nullopt;
  const double n = static_cast<double>(t.runs);
  t.side_difference /= n, t.sum /= n, t.motor_error_before /= n, t.motor_error_after /= n;
  t.share = xy / xx;
  t.share_sd = std::sqrt(std::max(0.0, yy - xy * xy / xx) / (n - 1) / xx);
  return t;
}

}  // namespace joulecast::gap

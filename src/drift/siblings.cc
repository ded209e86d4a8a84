#include "drift/siblings.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "drift/chance.h"
#include "statistics/robust.h"

namespace joulecast::drift {

std::vector<SiblingRatio> compare_siblings(std::span<const RobotRatios> robots, const Settings& settings) {
  std::vector<SiblingRatio> siblings;
  std::vector<double> errors;
  for (const RobotRatios& robot : robots) {
    std::vector<double> ratios;
    for (const MissionRatio& m : robot.missions)
      if (m.usable()) ratios.push_back(m.ratio());
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
      s.stands_out = std::fabs(s.deviation) > threshold(false_alarm / many, many - 1) &&
                     std::fabs(off) >= settings.least_change;
    }
  }
  std::ranges::sort(siblings, {}, &SiblingRatio::robot_id);
  return siblings;
}

}  // namespace joulecast::drift

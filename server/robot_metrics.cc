#include "server/robot_metrics.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "server/api/robot_json.h"

namespace joulecast::server {
namespace {

// In the order of the enumeration.
enum Place { live, silent, power, modelled, charge, drawn, returned, ledger, ratio };

std::vector<Metrics::Series> empty_series() {
  return {
      {"joulecast_robot_live", "1 while the robot's telemetry arrives"},
      {"joulecast_robot_silent_seconds", "Time since the robot's last message"},
      {"joulecast_robot_power_watts", "Measured power out of the battery, while live"},
      {"joulecast_robot_modelled_power_watts", "Modelled power out of the battery, while live"},
      {"joulecast_robot_charge_ratio", "State of charge, 0 to 1; of a silent robot the last one"},
      {"joulecast_robot_drawn_joules_total", "Energy out of the battery within missions"},
      {"joulecast_robot_returned_joules_total", "Energy back into the battery within missions"},
      {"joulecast_robot_ledger_joules", "Battery energy within missions by term; recovered counts negative"},
      {"joulecast_robot_energy_ratio", "Measured over modelled energy, median of the newest missions"},
  };
}

}  // namespace

void export_robot_metrics(Metrics& metrics, const ingest::FleetView& fleet, const GapWatch& watch,
                          std::function<std::int64_t()> now_utime_us, std::size_t most_robots) {
  const Gauge left_out = metrics.gauge("joulecast_robots_without_metrics",
                                       "Robots beyond metrics.robots, without metrics of their own");
  metrics.series([left_out, &fleet, &watch, most_robots, now = std::move(now_utime_us)] {
    const auto robots = fleet.all();
    const std::size_t shown = std::min(most_robots, robots.size());
    left_out.set(static_cast<double>(robots.size() - shown));
    if (most_robots == 0) return std::vector<Metrics::Series>{};
    std::vector<Metrics::Series> all = empty_series();
    const std::int64_t at_utime_us = now();
    const std::map<std::string, double> ratios = watch.counts().ratios;
    for (std::size_t k = 0; k < shown; ++k) {
      const ingest::RobotSnapshot& robot = *robots[k];
      const Labels labels{{"robot_id", robot.robot_id}};
      const auto add = [&](Place place, double value) {
        if (std::isfinite(value)) all[place].rows.emplace_back(labels, value);
      };
      const bool is_live = api::is_live(robot, at_utime_us);
      add(live, is_live ? 1 : 0);
      if (robot.received_utime_us > 0)
        add(silent, static_cast<double>(at_utime_us - robot.received_utime_us) * 1e-6);
      if (is_live) add(power, robot.measured_power_w);
      if (is_live) add(modelled, robot.modelled_power_w);
      add(charge, robot.state_of_charge);
      add(drawn, robot.drawn_j);
      add(returned, robot.returned_j);
      if (const auto found = ratios.find(robot.robot_id); found != ratios.end()) add(ratio, found->second);
      for (std::size_t term = 0; term < signals::term_count; ++term)
        all[ledger].rows.emplace_back(
            Labels{{"robot_id", robot.robot_id}, {"term", std::string(signals::term_names[term])}},
            robot.ledger.value[term]);
    }
    return all;
  });
}

}  // namespace joulecast::server

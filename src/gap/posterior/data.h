#pragma once

#include <Eigen/Dense>
#include <span>
#include <string>
#include <vector>

#include "gap/equations/channels.h"
#include "robot/robot_model.h"
#include "telemetry/recording.h"

namespace joulecast::gap::posterior {

constexpr Eigen::Index ix(std::size_t k) {
  return static_cast<Eigen::Index>(k);
}
constexpr std::size_t ux(Eigen::Index k) {
  return static_cast<std::size_t>(k);
}

// Rows of battery power, each the mean over some instants of the motion.
struct PowerRows {
  std::vector<Window> instants;
  std::vector<std::size_t> first{0};  // instant of each row, and the end
  std::vector<double> power_w;        // measured

  std::size_t size() const { return power_w.size(); }
  const Window& window(std::size_t row) const { return instants[first[row]]; }
  // Means over the rows of what `value` returns for each instant.
  template <class Value>
  Eigen::VectorXd mean(const Value& value) const {
    Eigen::VectorXd out(ix(size()));
    for (std::size_t r = 0; r < size(); ++r) {
      double sum = 0;
      for (std::size_t k = first[r]; k < first[r + 1]; ++k) sum += value(instants[k]);
      out[ix(r)] = sum / static_cast<double>(first[r + 1] - first[r]);
    }
    return out;
  }
};

// One robot's recordings as rows. With motor channels all rows are windows, and battery power has some of
// them; without, battery power has rows of its own at its fresh readings.
struct Data {
  robot::RobotModel robot;
  std::vector<dynamics::ActiveEffect> in_file;  // always in force
  std::vector<std::string> covariates;
  std::size_t missions = 0, blocks = 0;
  bool motors = false;  // motor currents were recorded
  bool power = false;   // battery power (or that of the motors, in its place) was
  FromMotion from_motion;
  double sample_s = 0;          // between samples
  std::vector<Window> windows;  // battery_voltage_v is the mission's mean: no regressor has its noise
  std::vector<double> battery_voltage_v;  // measured, of each window
  PowerRows rows;
  double mean_power_w = 1;

  // Rows that battery power alone judges.
  bool at_readings() const { return power && !motors; }
};

// The rows of these missions; in windows, electrical readings are moved back by `electrical_delay_s` first.
// Fault::invalid where fewer rows than needed have a known motion.
Result<Data> make_data(std::span<const telemetry::Recording> missions, const robot::RobotModel& robot,
                       double electrical_delay_s = 0);

// The battery power that the model with these effects predicts, by row [W]; mean of each row's instants.
Eigen::VectorXd predicted_power(const Data& data, std::span<const dynamics::ActiveEffect> effects);

}  // namespace joulecast::gap::posterior

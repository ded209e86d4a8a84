#pragma once

#include <Eigen/Dense>
#include <concepts>
#include <span>
#include <string>
#include <vector>

#include "gap/equations/channels.h"
#include "gap/posterior/constants.h"
#include "robot/robot_model.h"
#include "telemetry/recording.h"

namespace joulecast::gap::posterior {

constexpr Eigen::Index ix(std::size_t k) {
  return static_cast<Eigen::Index>(k);
}
constexpr std::size_t ux(Eigen::Index k) {
  return static_cast<std::size_t>(k);
}

// The sensors that read a power; `sides`: of the right motor, less the left one's.
enum class Meter { battery, motors, sides };

// The power that they would read [W].
template <class S>
S read_by(Meter meter, const MeteredPower<S>& p) {
  if (meter == Meter::sides) return p.motor_w[0] - p.motor_w[1];
  return meter == Meter::battery ? p.battery_w : p.motors_w;
}
template <class S>
S metered_by(Meter meter, const dynamics::BasicDriveModel<S>& model, const Window& w) {
  return read_by(meter, metered_powers(model, w));
}

// Rows of power, each the mean over some instants of the motion by their lengths.
struct PowerRows {
  std::vector<Window> instants;
  std::vector<std::size_t> first{0};  // instant of each row, and the end
  std::vector<double> power_w;        // measured, times the scale
  std::vector<double> scale{};        // on readings and model, so that all rows scatter alike; empty: 1
  std::vector<Meter> meter{};         // empty: the battery's

  std::size_t size() const { return power_w.size(); }
  const Window& window(std::size_t row) const { return instants[first[row]]; }
  std::vector<std::size_t> blocks() const {  // of each row
    std::vector<std::size_t> block(size());
    for (std::size_t r = 0; r < size(); ++r) block[r] = window(r).block;
    return block;
  }
  Eigen::VectorXd measured_w() const {
    return Eigen::Map<const Eigen::VectorXd>(power_w.data(), ix(power_w.size()));
  }
  // Means over the rows, times their scale, of what `value` returns for each instant, or for an instant and
  // the row's meter.
  template <class Value>
  Eigen::VectorXd mean(const Value& value) const {
    Eigen::VectorXd out(ix(size()));
    for (std::size_t r = 0; r < size(); ++r) {
      double sum = 0, lengths = 0;
      for (std::size_t k = first[r]; k < first[r + 1]; ++k) {
        const double length = first[r + 1] - first[r] == 1 ? 1 : instants[k].length_s;
        lengths += length;
        if constexpr (std::invocable<const Value&, const Window&, Meter>)
          sum += length * value(instants[k], meter.empty() ? Meter::battery : meter[r]);
        else
          sum += length * value(instants[k]);
      }
      out[ix(r)] = (scale.empty() ? 1 : scale[r]) * sum / lengths;
    }
    return out;
  }
};

// A condition of whole runs that an unknown cause may follow.
struct Condition {
  std::string name;
  Eigen::VectorXd value;  // of each row
};

// Channels with a posterior of their own where no motor current was recorded.
enum class Witness { power, terminals, kinematics };

// One robot's recordings as rows. Without motor channels, battery power has rows of its own.
struct Data {
  robot::RobotModel robot;
  std::vector<dynamics::ActiveEffect> in_file;  // always in force
  Witness witness = Witness::power;
  std::array<double, tolerance_factors.size()> factor_prior = tolerance_factor_prior;
  std::vector<std::string> covariates;
  std::size_t missions = 0, blocks = 0;
  std::vector<std::size_t> group;  // of each mission, where groups are compared
  bool motors = false;             // motor currents were recorded
  bool power = false;              // battery power (or that of the motors, in its place) was recorded
  bool voltages = false;           // of motors without currents were recorded
  double sample_s = 0;             // between samples
  std::vector<Window> windows;     // battery_voltage_v is the mission's mean: no regressor has its noise
  std::array<std::vector<Window>, 2> halves;  // the same by half_of(): of the residuals, and of the columns
  std::vector<double> battery_voltage_v;      // measured, of each window
  PowerRows rows;
  double mean_power_w = 1;
  std::size_t fewest = fewest_rows;  // fewest rows of a channel
  // Of whole runs that have energies alone.
  std::vector<Condition> conditions;
  PowerRows sides;                      // the motors one against the other, in rows of their own
  std::vector<Eigen::VectorXd> shifts;  // of each table: power of its rows, with a common shift

  // True if the rows are instants of recordings, not runs and not groups: power has a table of terms.
  bool of_instants() const { return conditions.empty() && group.empty() && rows.scale.empty(); }
  // True if battery power is the only evidence.
  bool at_readings() const { return power && !motors; }
};

// Returns the rows of these missions; in windows, electrical readings are first moved back by
// `electrical_delay_s`; `as_read`: a delay of battery power behind the motion stays in the rows.
// Fault::invalid where too few rows have a measured motion.
Result<Data> make_data(std::span<const telemetry::Recording> missions, const robot::RobotModel& robot,
                       double electrical_delay_s = 0, bool as_read = false);

// The same recordings with the rows of another witness; `factors`: posterior of the tolerance factors.
Data rows_of_witness(const Data& data, Witness witness, const Eigen::VectorXd& factors);

// The battery power that the model with these effects predicts, by row [W]; mean of each row's instants.
Eigen::VectorXd predicted_power(const Data& data, std::span<const dynamics::ActiveEffect> effects);

}  // namespace joulecast::gap::posterior

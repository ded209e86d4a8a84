#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <map>
#include <optional>
#include <span>
#include <vector>

#include "dynamics/drive_model.h"
#include "telemetry/recording_set.h"
#include "tests/study/corrections/hypotheses.h"
#include "tests/study/corrections/laplace.h"
#include "windows/windows.h"

namespace joulecast::gap::corrections {

// Readings that are compared with what the others, and the motion, say about them.
enum class Witness : std::size_t {
  voltage_right,  // V - R i - K w, or V by the motion where the current is not known
  voltage_left,
  current_right,  // i - i by the motion
  current_left,
  power,  // the battery's - that of the motors, or by the motion where these are not known
  battery_voltage,
  gyro,
  travel,
  turn
};
inline constexpr std::size_t witness_count = 9;

// Physical parameters that are free while errors compete. Of a ratio: its logarithm.
enum class Physical : std::size_t {
  base_load,
  dry,
  dry_more,
  viscous,
  viscous_more,
  mass,
  resistance,
  drag,
  unreturned,
  driver_loss,
  constant,
  scrub,
  yaw_inertia,
  grade,
  battery_resistance,
  battery_level,
  battery_drift,
  radius,
  track
};
inline constexpr std::size_t physical_count = 19;

// An error with its number where it is free.
struct Error {
  const Hypothesis* what = nullptr;
  double value = 0;
};

// The rows of a recording set, as errors leave them once removed.
class Witnesses {
 public:
  Witnesses(const telemetry::RecordingSet& recordings, const robot::RobotModel& robot);

  const Measured& measured() const { return measured_; }
  // Of the physical parameters that these recordings can move, in the order of `which`.
  const std::vector<Unknown>& unknowns() const { return unknowns_; }
  // Independent rows: one in 2 s, 60 at most; both sides of a motor share theirs.
  const std::vector<double>& independent() const { return independent_; }
  const std::vector<double>& fewest() const { return fewest_; }
  bool usable() const { return usable_; }
  // Of the prior of an offset of the motor currents [A].
  double offset_deviation() const { return 0.05 * robot_.limits.current_a; }

  // Residuals with errors removed. `x`: of unknowns().
  void compare(std::span<const Error> errors, const Eigen::VectorXd& x, Comparison& out);
  // Log likelihood of the largest readings by the limits of the robot file, and of driving forwards.
  double limits(std::span<const Error> errors);
  // Block of 15 s of each row of a comparison with these errors.
  std::vector<std::size_t> blocks(std::span<const Error> errors);
  // A start for the logarithm of a free factor, from pose or gyro.
  double start_of(const Hypothesis& hypothesis);
  // Whether power returns to the battery at each sample of a mission, by the motion.
  std::vector<std::uint8_t> returned(std::span<const Error> errors, const Eigen::VectorXd& x,
                                     std::size_t mission);

 private:
  struct Row {
    std::size_t mission = 0, block = 0;
    double t_s = 0, payload_kg = 0;
    std::array<double, 2> speed{}, acceleration{}, span{};
    std::array<bool, 2> moving{}, resting{};
    std::array<double, 2> voltage{}, current{}, current_slope{}, power{}, power_abs{}, braking{}, sign{};
    double battery_voltage = 0, battery_current = 0, battery_power = 0, charge = 0;
    double yaw_rate = 0, travel = 0, turn = 0, chord = 1, climb = 0;
    // Derived from the rest.
    std::array<double, 2> direction{}, load_nm{};
    double turning = 0;
  };
  struct Rows {
    std::vector<Row> rows;
    Eigen::ArrayXXd reading;
    bool rectified = false, supply = false;
    double offset_current = 0, offset_yaw = 0;
  };
  struct Predicted {
    std::array<double, 2> current{}, voltage{};
    double power = 0;
  };

  std::vector<Row> rows_of(const telemetry::RecordingSet& recordings, std::size_t most) const;
  const std::vector<Row>& recorded(std::span<const Error> errors);
  const Rows& corrected(std::span<const Error> errors);
  void remove(const Error& error, Row& row) const;
  void derive(Row& row) const;
  void read(Rows& rows) const;
  void choose_unknowns();
  std::array<double, physical_count> physical(const Eigen::VectorXd& x) const;
  Predicted predict(const Row& row, const std::array<double, physical_count>& q) const;
  void compare(const Rows& rows, const Row& row, const std::array<double, physical_count>& q, Eigen::Index at,
               Eigen::ArrayXXd& residual) const;

  const telemetry::RecordingSet& recordings_;
  const robot::RobotModel& robot_;
  dynamics::DriveModel drive_;
  dynamics::Parameters<double> file_;
  windows::Readings readings_;
  std::map<const Hypothesis*, std::vector<Row>> rebuilt_;  // nullptr: as recorded
  std::vector<std::pair<const Hypothesis*, double>> made_for_;
  Rows made_;
  bool made_any_ = false, usable_ = false, turns_ = false;
  Measured measured_;
  std::vector<Physical> which_;
  std::vector<Unknown> unknowns_;
  std::vector<double> independent_, fewest_;
};

}  // namespace joulecast::gap::corrections

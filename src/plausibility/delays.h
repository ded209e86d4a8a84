#pragma once

#include <Eigen/Dense>
#include <array>
#include <cstddef>
#include <optional>
#include <span>
#include <vector>

#include "telemetry/recording.h"

namespace joulecast::plausibility {

// Channels that are correlated with the motion to estimate their delay; the last one with the motors' power.
enum class Late : std::size_t { current_right, current_left, battery_power, yaw_rate, battery_by_motors };
inline constexpr std::size_t late_count = 5;

// Lag of a channel behind the motion [s]; negative: it leads. The 95 % interval is a bootstrap of blocks.
struct Delay {
  double value_s = 0;
  std::array<double, 2> interval{};
};

// Sums over a block of time, sufficient for the regression of a channel on the motion at every lag.
struct LagBlock {
  double rows = 0;
  Eigen::MatrixXd xx;  // of the motion's terms
  Eigen::MatrixXd xy;  // terms by lags
  Eigen::VectorXd yy;  // by lags
  void join(const LagBlock& other, double weight = 1);
};

// Correlates the missions' channels with their motion over lags of up to about a second.
class Lags {
 public:
  explicit Lags(std::span<const telemetry::Recording> missions);

  // Delay of a channel over all missions. Empty where the motion explains too little of it.
  std::optional<Delay> delay(Late late) const;

 private:
  void correlate(const telemetry::Recording& mission);

  double step_s_ = 0;  // of the first mission's uniform grid; those of another rate are left out
  std::array<std::vector<LagBlock>, late_count> blocks_;
};

}  // namespace joulecast::plausibility

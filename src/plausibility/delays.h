#pragma once

#include <Eigen/Dense>
#include <array>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <optional>
#include <span>
#include <vector>

#include "plausibility/products.h"
#include "signals/sample.h"

namespace joulecast::plausibility {

// Channels that are correlated with the motion to estimate their delay; the last one with the motors' power.
enum class Late : std::size_t { current_right, current_left, battery_power, yaw_rate, battery_by_motors };
inline constexpr std::size_t late_count = 5;

// Sums over a block of time, sufficient for the regression of a channel on the motion at every lag.
struct LagBlock {
  double rows = 0;
  Eigen::MatrixXd xx;  // of the motion's terms
  Eigen::MatrixXd xy;  // terms by lags
  Eigen::VectorXd yy;  // by lags
  void join(const LagBlock& other, double weight = 1);
};

// Correlates one mission's channels with its motion over lags of up to about a second, in bounded memory.
// Rows are first interpolated to a uniform grid; its step is derived from the first rows.
class LagSums {
 public:
  void add(const signals::Sample& sample);
  void finish();

  double step_s() const { return step_s_; }
  const std::vector<LagBlock>& blocks(Late late) const { return blocks_[static_cast<std::size_t>(late)]; }
  // Lags reach from -reach() to reach() steps.
  static constexpr Eigen::Index reach() { return 25; }

 private:
  struct Row {
    std::array<double, 2> speed{};
    double motor_power_w = 0;
    std::array<double, late_count> late{};
  };
  static Row row_of(const signals::Sample& sample);
  void take(const signals::Sample& sample);
  void take(const Row& row);
  bool moving() const;
  void correlate();
  void next_block();

  double step_s_ = 0;
  std::vector<signals::Sample> first_;  // until the step is determined
  std::optional<signals::Sample> last_;
  std::int64_t begin_us_ = 0;
  std::int64_t next_ = 0;  // place on the grid
  std::deque<Row> rows_;   // unbroken, of the grid
  std::array<LagBlock, late_count> open_;
  std::array<std::vector<LagBlock>, late_count> blocks_;
  std::size_t in_block_ = 0, stride_ = 1, waited_ = 0;
};

// Lag of a channel behind the motion [s]; negative: it leads. The 95 % interval is a bootstrap of blocks.
struct Delay {
  double value_s = 0;
  std::array<double, 2> interval{};
};

// Common delay of the channels over all missions. Empty where the motion explains too little of them.
std::optional<Delay> delay_between(std::span<const LagSums* const> missions, std::span<const Late> channels);

}  // namespace joulecast::plausibility

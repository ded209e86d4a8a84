#pragma once

#include <Eigen/Dense>
#include <array>
#include <cstddef>
#include <cstdint>
#include <deque>
#include <optional>
#include <span>
#include <vector>

#include "gap/checks/products.h"
#include "signals/sample.h"

namespace joulecast::gap {

// What is compared with the motion to see how late it comes; the last with the motors' power.
enum class Late : std::size_t { current_right, current_left, battery_power, yaw_rate, battery_by_motors };
inline constexpr std::size_t late_count = 5;

// Sums from which a channel's regression on the motion follows at every lag, by blocks of time.
struct LagBlock {
  double rows = 0;
  Eigen::MatrixXd xx;  // of the motion's terms
  Eigen::MatrixXd xy;  // terms by lags
  Eigen::VectorXd yy;  // by lags
};

// Correlates one mission's channels with its motion over lags of up to a second or so, in bounded memory.
// Rows are put on an even grid first; its step comes from the first rows.
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
  std::vector<signals::Sample> first_;  // until the step is known
  std::optional<signals::Sample> last_;
  std::int64_t begin_us_ = 0;
  std::int64_t next_ = 0;  // place on the grid
  std::deque<Row> rows_;   // unbroken, of the grid
  std::array<LagBlock, late_count> open_;
  std::array<std::vector<LagBlock>, late_count> blocks_;
  std::size_t in_block_ = 0, stride_ = 1, waited_ = 0;
};

// By how much a channel lags the motion [s]; negative: it leads. With its 95 % interval by a bootstrap of
// blocks.
struct Delay {
  double value_s = 0;
  std::array<double, 2> interval{};
};

// Over all missions, channels together. Unknown where the motion hardly explains them.
std::optional<Delay> delay_between(std::span<const LagSums* const> missions, std::span<const Late> channels);

}  // namespace joulecast::gap

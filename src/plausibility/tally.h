#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "signals/gaps.h"

namespace joulecast::plausibility {

// Number of runs of `rows` equal readings in a channel.
struct Repetitions {
  std::size_t rows = 0, count = 0;
};

// Number of rows for which a reading is held before the next one; 1 where none is repeated, or changes are
// too few. Lengths ascend. A coarse converter repeats values by chance, so that their lengths are geometric;
// those of a held channel are whole numbers of periods.
std::size_t rows_held(std::span<const Repetitions> lengths);

// True if a value is far from the level of both its neighbours, which are alike.
bool is_spike(double before, double value, double after);

// Statistics of one reading's values over a mission, in bounded memory.
class ValueTally {
 public:
  static constexpr std::size_t longest_run = 256;  // rows; longer ones count as this long
  static constexpr std::size_t slowest = 100;      // rows between values of a working sensor
  static constexpr std::size_t most_levels = 64;   // distinct values that are stored

  void add(double value);
  // Appends the other's rows, except for runs and spikes across the boundary.
  void append(const ValueTally& other);

  std::size_t rows() const { return rows_; }
  std::size_t known() const { return known_; }  // not NaN
  std::size_t zeros() const { return zeros_; }
  std::size_t lost() const;  // rows in gaps longer than those of any slow sensor
  double low() const { return lowest_.value; }
  double high() const { return highest_.value; }
  bool constant() const { return known_ > 0 && low() == high(); }
  double mean() const;
  double deviation() const;  // standard
  // Rows with the highest or the lowest value, the more frequent of the two, and the number of runs that they
  // form.
  struct Extreme {
    double value = 0;
    std::size_t rows = 0, runs = 0;
  };
  Extreme extreme() const;
  // Rows in which the value drops to zero or jumps up, and returns in the next row. Spikes of small values
  // are not counted: they are frequent in noise about zero.
  std::size_t spikes() const;

  // Usual number of rows for which a value is held before the next reading; 1 where each row has a new one
  // (rows_held).
  std::size_t held_rows() const;
  // Distance of neighbouring values if few are distinct; 0 if many are.
  double quantum() const;
  std::size_t levels() const { return fine_ ? most_levels + 1 : levels_.size(); }

 private:
  void join(const ValueTally& other);  // neither is empty; except for rows and lost
  void note_run();
  void note_level(double value);

  std::size_t rows_ = 0, known_ = 0, zeros_ = 0, lost_ = 0, missing_ = 0;
  std::array<std::uint32_t, 64> spikes_{};  // by the power of two of the level
  double origin_ = 0, sum_ = 0, square_ = 0;
  Extreme lowest_, highest_;
  std::array<std::uint32_t, longest_run + 1> runs_{};
  std::size_t run_ = 0;
  bool changed_ = false;  // the first run of a mission has an unknown length
  std::array<double, 2> last_{};
  bool fine_ = false;
  std::vector<double> levels_;  // ascending
};

// Statistics of the clock and the sequence numbers of a mission.
class ClockTally {
 public:
  void add(std::int64_t utime_us, std::int64_t sequence);

  std::size_t rows() const { return rows_; }
  std::int64_t first_us() const { return first_us_; }
  std::int64_t last_us() const { return last_us_; }
  double length_s() const { return 1e-6 * static_cast<double>(last_us_ - first_us_); }
  // Median time between rows; 0 without two that differ. A step much shorter than the one before is excluded:
  // an import inserts such steps before changes of a held reading (hold), and publishers catch up with such
  // steps after a stall.
  double period_s() const;
  std::size_t repeated() const { return repeated_; }  // same time as the row before
  std::size_t backward() const { return backward_; }  // earlier than the row before
  // As defined in signals/gaps.h.
  struct Gaps {
    std::size_t count = 0;
    double seconds = 0;
  };
  Gaps gaps() const;
  // Rows with a sequence number that is not above that of the row before.
  std::size_t disordered() const { return disordered_; }
  bool counts() const { return low_sequence_ != high_sequence_; }

 private:
  // Histogram of clock steps, 16 classes for each factor of ten from 1 us on.
  static constexpr std::size_t classes = std::size_t{16} * 10;
  struct Class {
    std::size_t count = 0;
    double seconds = 0;
  };

  std::size_t rows_ = 0, repeated_ = 0, backward_ = 0, disordered_ = 0;
  std::int64_t first_us_ = 0, last_us_ = 0, before_us_ = 0, step_us_ = 0, sequence_ = 0;
  std::int64_t low_sequence_ = 0, high_sequence_ = 0;
  std::array<Class, classes> steps_{};
  signals::GapDetector detector_;
  Gaps gaps_;
};

}  // namespace joulecast::plausibility

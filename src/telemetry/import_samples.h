#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "base/error.h"
#include "signals/covariates.h"
#include "signals/sample.h"

// Samples and covariates of a mission. Only the import's own sources use this.
namespace joulecast::telemetry {

// Range of positions that leap through more than half of it, such as angles within a turn; 0 of others.
[[nodiscard]] double leap_of(const std::vector<signals::Sample>& samples, std::size_t number);

// Puts the rate of a number in its place, over a window. Two samples at least; where fewer than two are
// measured within the window there is no rate. Returns the thrown jumps: of a position that jumps between two
// samples, in which the rate is many times farther from that before and that behind than rates change
// elsewhere. Jumps are taken out.
std::vector<double> differentiate(std::vector<signals::Sample>& samples, std::size_t number, double window_s);

// In a table of changes: repeats each sample until just before the next one, once in the usual interval of
// the rows or in a second, whichever is longer. Returns how many were added.
std::size_t hold_between(std::vector<signals::Sample>& samples);

inline constexpr std::size_t max_import_labels = 16;  // of one quantity

// The covariates of a table, row by row. Rows that give a sample are committed; values that differ from the
// last commit become changes at the sample's time.
class ImportedCovariates {
 public:
  void set(const std::string& name, double value) { numbers_[name].now = value; }

  // The quantity reads that text from this row on, an empty one: it has no label. Characters that a label may
  // not have become '_'. Fault::corrupt, without a field, for a text that is too long and for one label too
  // many.
  Result<void> set_label(const std::string& quantity, std::string_view text);

  void commit(std::int64_t utime_us);

  // The series of the mission; the next one in the table begins with the present values. The labels of a
  // quantity that are not read are 0. Fault::invalid for more names than a mission may have.
  Result<std::vector<signals::CovariateSeries>> finish();

 private:
  struct Quantity {
    double now = signals::unmeasured;  // of a labelled quantity its label's place in `labels`
    std::string label = {};
    std::vector<std::string> labels = {};  // of all missions, in order of appearance
    std::vector<std::pair<std::int64_t, double>> changes = {};
  };

  std::map<std::string, Quantity> numbers_, labelled_;
};

}  // namespace joulecast::telemetry

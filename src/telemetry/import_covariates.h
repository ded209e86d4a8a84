#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "base/error.h"
#include "signals/covariates.h"

namespace joulecast::telemetry {

inline constexpr std::size_t max_import_labels = 16;  // of one quantity

// The covariates of a table, row by row. Rows that give a sample are committed; values that differ from the
// last commit become changes at the sample's time. Only the import's own sources use this.
class ImportedCovariates {
 public:
  void set(const std::string& name, double value) { quantities_[name].now = value; }

  // The quantity reads that text from this row on, an empty one: it has no label. Characters that a label may
  // not have become '_'. Fault::corrupt, without a field, for a text that is too long and for one label too
  // many.
  Result<void> set_label(const std::string& quantity, std::string_view text);

  void commit(std::int64_t utime_us);

  // The series of the mission; the next one in the table begins with the present values. The labels of a
  // quantity that are not read are 0. Fault::invalid for more names than a mission may have.
  Result<std::vector<signals::CovariateSeries>> finish();

 private:
  template <class T>
  struct Quantity {
    T now{};
    std::vector<std::pair<std::int64_t, T>> changes = {};
  };

  std::map<std::string, Quantity<double>> quantities_;
  std::map<std::string, Quantity<std::string>> labelled_;
  std::map<std::string, std::vector<std::string>> labels_;  // of all missions, in order of appearance
};

}  // namespace joulecast::telemetry

#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "base/error.h"
#include "signals/covariates.h"

namespace joulecast::telemetry {

inline constexpr std::size_t max_import_labels = 16;  // of one quantity

// The covariates of a table, row by row. Rows that give a sample are committed; values that differ from the
// last commit become changes at the sample's time. Only the import's own sources use this.
class ImportedCovariates {
 public:
  void set(const std::string& name, double value);

  // The quantity reads that text from this row on: the label of the text holds and its others do not.
  // Characters that a label may not have become '_'. Fault::corrupt, without a field, for a text that is too
  // long and for one label too many.
  Result<void> set_label(const std::string& quantity, std::string_view text);
  // The quantity has no label from this row on.
  void forget_labels(const std::string& quantity);

  void commit(std::int64_t utime_us);

  // For the mission that follows in the same table: keeps the present values and labels, and has committed
  // nothing.
  [[nodiscard]] ImportedCovariates next_mission() const;

  // A label that comes later in the table did not hold before. Fault::invalid for more names than a mission
  // may have.
  Result<std::vector<signals::CovariateSeries>> finish();

 private:
  struct Labels {
    std::vector<std::string> names;
    bool known = false;
    std::int64_t first_utime_us = -1;  // committed with a label; -1: never
  };

  std::vector<std::string> names_;  // in order of appearance
  std::map<std::string, double, std::less<>> now_, committed_;
  std::map<std::string, Labels, std::less<>> labels_;
  std::vector<signals::CovariateChange> changes_;
};

}  // namespace joulecast::telemetry

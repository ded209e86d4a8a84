#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "signals/ids.h"
#include "signals/sample.h"

// robot_covariates_t, free of LCM: named quantities next to a robot's telemetry that may explain its power.
namespace joulecast::signals {

inline constexpr std::size_t max_covariates = 64;  // names in a message, and in a mission
inline constexpr std::size_t max_covariate_name_length =
    max_robot_id_length;  // of a name, and of the label after its '='

// The covariate from which the climb follows: height above any fixed datum, m.
inline constexpr std::string_view height_covariate = "height_m";

// "name" or "name=label", each part 1 to 47 of letters, digits, '.', '_' and '-'.
[[nodiscard]] bool is_valid_covariate_name(std::string_view name) noexcept;
[[nodiscard]] bool is_label(std::string_view covariate_name) noexcept;

struct Covariate {
  std::string name;
  double value = unmeasured;  // of a label 1 or 0; NaN: unknown from now on

  friend bool operator==(const Covariate&, const Covariate&) = default;
};

struct CovariateMessage {
  std::int64_t utime_us = 0;
  std::vector<Covariate> covariates;
};

// A value that is another than the one before it, and the robot's time from which on it holds.
struct CovariateChange {
  std::int64_t utime_us = 0;
  std::string name;
  double value = unmeasured;
};

// One covariate over a mission: value[k] holds from utime_us[k] until utime_us[k + 1]. Times increase; before
// the first the covariate is unknown.
struct CovariateSeries {
  std::string name;
  std::vector<std::int64_t> utime_us;
  std::vector<double> value;
};

// Changes in any order as series, as their names first come; of one name and time the last value holds.
[[nodiscard]] std::vector<CovariateSeries> series_of(std::span<const CovariateChange> changes);

// The series as changes in order of time.
[[nodiscard]] std::vector<CovariateChange> changes_of(std::span<const CovariateSeries> series);

// The series of that name, or null.
[[nodiscard]] const CovariateSeries* find_series(std::span<const CovariateSeries> series,
                                                 std::string_view name);

// Reads a series at times that do not go back. NaN: unknown.
class CovariateReader {
 public:
  // A null series is unknown throughout.
  explicit CovariateReader(const CovariateSeries* series) : series_(series) {}
  double at(std::int64_t utime_us);

 private:
  const CovariateSeries* series_;
  std::size_t next_ = 0;
};

}  // namespace joulecast::signals

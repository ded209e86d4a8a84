#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <string_view>

#include "fuzz.h"
#include "tests/support/import_csv.h"

namespace t = joulecast::telemetry;

// Input: a mapping, a NUL, a table. The table is also read through a valid mapping.
JOULECAST_FUZZ_TARGET(csv_import) {
  static const t::ImportMapping good = t::ImportMapping::parse(R"({
    "robot_id": "r", "mission_id": "m", "time": {"column": "t", "unit": "ns"}, "column_prefix": "p/",
    "column_limits": {"a": {"low": -10, "high": 10, "outside": "hold"}},
    "fields": {"wheel_velocity": [{"column": "a"}, {"columns": ["a", {"column": "b", "negate": true}], "combine": "mean"}],
               "motor_current": [{"column": "b", "sign_from": ["a"]}, null],
               "pose": [null, null, {"quaternion_yaw": ["a", "b", "a", "b"]}]},
    "covariates": {"load": {"column": "b", "scale": 2}}})")
                                           .value();
  const std::string_view text(reinterpret_cast<const char*>(data), size);
  const auto nul = text.find('\0');
  const std::string_view table = nul == std::string_view::npos ? text : text.substr(nul + 1);
  for (const auto& mapping :
       {t::ImportMapping::parse(text.substr(0, nul)), joulecast::Result<t::ImportMapping>(good)}) {
    if (!mapping) continue;
    const auto import = t::import_csv(table, *mapping);
    if (!import) continue;
    const t::ImportReport& report = import->report;
    if (report.rows != report.samples + report.rows_out_of_time + report.rows_without_motion) {
      std::abort();
    }
    std::int64_t before = -1;
    for (const joulecast::signals::Sample& sample : import->recording.samples) {
      if (sample.utime_us <= before || std::isnan(sample.wheel_velocity_rad_s[0])) std::abort();
      before = sample.utime_us;
    }
    for (const joulecast::signals::CovariateSeries& series : import->recording.covariates) {
      if (!joulecast::signals::is_valid_covariate_name(series.name) ||
          series.value.size() != series.utime_us.size())
        std::abort();
      if (!std::is_sorted(series.utime_us.begin(), series.utime_us.end())) std::abort();
    }
  }
}

#include "telemetry/import_series.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "base/try.h"
#include "telemetry/import_table.h"

namespace joulecast::telemetry {

Result<TableSeries> TableSeries::read(std::string_view csv, const TableLayout& layout,
                                      std::vector<SeriesColumn> columns, const std::string& source,
                                      const std::string& shown, std::vector<Glitch>& glitches) {
  TRY_ASSIGN(auto table, ImportTable::open(csv, layout, source));
  TableSeries series;
  std::vector<CellPlace> places;
  for (const SeriesColumn& column : columns) {
    TRY_ASSIGN(const auto place, table.find(column.name));
    places.push_back(place);
    series.columns_.push_back({column.interpolation, {}});
  }
  const auto read_row = [&](std::int64_t& last_us) -> Result<void> {
    TRY_ASSIGN(const auto since_zero_us, table.time());
    std::int64_t utime_us = 0;
    if (__builtin_add_overflow(since_zero_us, layout.epoch_us, &utime_us))
      return table.refuse("time", std::to_string(since_zero_us), "is no time");
    ++series.rows_;
    series.rows_unsorted_ += utime_us <= last_us;
    last_us = std::max(last_us, utime_us);
    for (std::size_t k = 0; k < columns.size(); ++k) {
      TRY_ASSIGN(const auto value, table.number(places[k], columns[k].name));
      if (!value || std::isnan(*value)) continue;
      double reading = *value;
      const ValueLimits* limits = columns[k].limits;
      if (!std::isfinite(reading) ||
          (limits != nullptr && !(reading >= limits->low && reading <= limits->high))) {
        const OutsidePolicy policy = limits != nullptr ? limits->outside : OutsidePolicy::blank;
        glitches.push_back({table.line(), shown + columns[k].name, reading,
                            std::string(outside_names[static_cast<std::size_t>(policy)])});
        if (policy != OutsidePolicy::clamp) continue;
        reading = std::clamp(reading, limits->low, limits->high);
      }
      series.columns_[k].points.push_back({utime_us, reading});
    }
    return {};
  };
  std::int64_t last_us = INT64_MIN;
  while (true) {
    const auto more = table.next();
    if (more && !*more) break;
    const auto taken = more ? read_row(last_us) : Result<void>(tl::unexpected(more.error()));
    if (!taken && !table.pass_damaged(more.has_value())) return tl::unexpected(taken.error());
  }
  for (Column& column : series.columns_) std::ranges::stable_sort(column.points, {}, &Point::utime_us);
  return series;
}

void TableSeries::shift(std::int64_t by_us) {
  for (Column& column : columns_)
    for (Point& point : column.points) point.utime_us += by_us;
}

TableSeries::Reading TableSeries::at(std::size_t column, std::int64_t utime_us,
                                     std::int64_t tolerance_us) const {
  const auto& [interpolation, points] = columns_[column];
  const auto next = std::ranges::upper_bound(points, utime_us, {}, &Point::utime_us);
  if (next == points.begin()) return {signals::unmeasured, 0, !points.empty()};
  const Point& before = *(next - 1);
  const std::int64_t age_us = utime_us - before.utime_us;
  if (interpolation == Interpolation::hold || age_us == 0)
    return age_us <= tolerance_us ? Reading{before.value, age_us, false}
                                  : Reading{signals::unmeasured, age_us, true};
  if (next == points.end() || next->utime_us - before.utime_us > tolerance_us)
    return {signals::unmeasured, age_us, true};
  const double share = static_cast<double>(age_us) / static_cast<double>(next->utime_us - before.utime_us);
  return {before.value + share * (next->value - before.value), std::min(age_us, next->utime_us - utime_us),
          false};
}

}  // namespace joulecast::telemetry

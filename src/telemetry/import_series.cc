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
    series.columns_.emplace_back();
  }
  const auto read_cells = [&](std::int64_t utime_us) -> Result<void> {
    for (std::size_t k = 0; k < columns.size(); ++k) {
      TRY_ASSIGN(const auto value, table.number(places[k], columns[k].name));
      if (!value || std::isnan(*value)) continue;
      const ValueLimits* limits = columns[k].limits;
      if (std::isfinite(*value) && (limits == nullptr || (*value >= limits->low && *value <= limits->high)))
        series.columns_[k].push_back({utime_us, *value});
      else
        glitches.push_back({table.line(), shown + columns[k].name, *value,
                            limits != nullptr && limits->holds ? "hold" : "unmeasured"});
    }
    return {};
  };
  std::int64_t last_us = INT64_MIN;
  while (true) {
    TRY_ASSIGN(const auto utime_us, table.next_time());
    if (!utime_us) break;
    if (auto taken = read_cells(*utime_us); !taken) {
      if (!table.pass_damaged(true)) return tl::unexpected(taken.error());
      continue;
    }
    ++series.rows_;
    series.rows_unsorted_ += *utime_us <= last_us;
    last_us = std::max(last_us, *utime_us);
  }
  for (auto& points : series.columns_) std::ranges::stable_sort(points, {}, &Point::utime_us);
  return series;
}

void TableSeries::shift(std::int64_t by_us) {
  for (auto& points : columns_)
    for (Point& point : points) point.utime_us += by_us;
}

TableSeries::Reading TableSeries::at(std::size_t column, std::int64_t utime_us,
                                     std::int64_t tolerance_us) const {
  const auto& points = columns_[column];
  const auto next = std::ranges::upper_bound(points, utime_us, {}, &Point::utime_us);
  if (next == points.begin()) return {signals::unmeasured, 0, !points.empty()};
  const Point& before = *(next - 1);
  const std::int64_t age_us = utime_us - before.utime_us;
  return age_us <= tolerance_us ? Reading{before.value, age_us, false}
                                : Reading{signals::unmeasured, age_us, true};
}

}  // namespace joulecast::telemetry
